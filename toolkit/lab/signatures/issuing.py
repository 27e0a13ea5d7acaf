"""Issuing a document: its entry in the ledger, the proof of the entry in its files, then its seals.

The order is that of what holds what. The entry holds the hashes of what was made before it: the content, the
Word file, the content of the digital certificate, the files that are handed over. Their proof, the entry with
its way to a checkpoint, enters the digital certificate and the PDF, as an attachment and as a code on its
last page. Seals cover all of it. What fails before the entry leaves nothing; what fails after it leaves an
entry over a document that never left, and issuing again makes another.

That a document left the laboratory is an entry of its record's ledger. The entry names the document, the hash
of what it says and the hashes of its files, and is signed as every decision is. What carries the proof of the
entry, the PDF and its manifest, is made after it and is none of these files. Signature and entry are one
transaction (`store`): a kill leaves both or neither.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolkit.calibration.registry.clock import now
from toolkit.calibration.registry.ledger import Ledger
from toolkit.calibration.registry.signatures import nobody
from toolkit.calibration.registry.store import Change
from toolkit.errors import ConfigError, RegistryError, TrustError
from toolkit.files import sha256_file
from toolkit.inputs import PDF_FILE, read_input
from toolkit.lab.signatures.proofs import MANIFEST, PROOF, TESTED, statements_hash
from toolkit.trust.people import Person, Version, inability, objections
from toolkit.trust.signing import HERE

if TYPE_CHECKING:
    from toolkit.calibration.registry.registry import Registry
    from toolkit.lab.signatures.sealing import Sealing
    from toolkit.report.content import ReportContent
    from toolkit.trust.anchor import Anchor


ISSUED = "issued"


def issuers(registry: Registry, record_id: str, named: Sequence[str] = ()) -> tuple[str, ...]:
    """Return the names of the people who issue; none where nobody is enrolled.

    They are those whose keys are at hand or have answered, and of a request those whom it is ``named`` to,
    by id: the document says who issues it before anybody signs.

    Raises
    ------
    TrustError
        ``not-signed``, ``not-allowed``; ``person``: a request to nobody, or to somebody who cannot sign it
    """
    version, travel = registry.people().history.now, registry.travel
    if version is None:
        if registry.signers or travel != HERE:
            raise nobody(record_id)
        return ()
    publics = [signer.public for signer in registry.signers]
    owners = [version.people.owner(public) for public in publics]
    if travel.request is not None:
        people = [_able(version, person_id, record_id) for person_id in named]
        if not people:
            raise _nobody_named("nobody")
        return _names(owners, people)
    elsewhere = [public for answer in travel.answers for public in answer.keys(version)]
    publics += elsewhere
    reasons = objections(version, "issue", registry.now(), publics)
    if reasons:
        demand = version.people.policy.demand("issue")
        raise TrustError(
            "these keys cannot issue" if publics else "to issue takes a signature", where=record_id,
            got="; ".join(reasons) if publics else "no key",
            expected=f"{demand.signatures} by {' or '.join(demand.roles)}",
            next_step="sign with --sign KEY; see 'toolkit person list'; nothing was issued",
            rule="not-allowed" if publics else "not-signed",
        )  # fmt: skip
    return _names(owners, [version.people.owner(public) for public in elsewhere])


def _names(here: Iterable[Person | None], elsewhere: Iterable[Person | None]) -> tuple[str, ...]:
    """Return names; those elsewhere by their ids: the order in which people answer changes no document."""
    names = [person.name for person in here if person is not None]
    names += [name for _, name in sorted((p.id, p.name) for p in elsewhere if p is not None)]
    return tuple(dict.fromkeys(names))


def _able(version: Version, person_id: str, where: str) -> Person:
    """Return who is named to issue, where one of the person's keys can."""
    person = version.people.of(person_id)
    if person is None:
        raise _nobody_named(person_id)
    reasons = [inability(version, "issue", now(), key.public) for key in person.keys]
    if None not in reasons:
        raise TrustError(
            "who is named cannot issue", where=where, got=str(reasons[-1]),
            expected=f"somebody who is {' or '.join(version.people.policy.demand('issue').roles)}",
            next_step="name another with --issued-by ID; nothing was issued", rule="not-allowed",
        )  # fmt: skip
    return person


def _nobody_named(got: str) -> TrustError:
    return TrustError(
        "a request says who issues: the document states the name", where="--issued-by", got=got,
        expected="the id of each person who will sign", rule="person",
        next_step="add --issued-by ID; see 'toolkit person list'; nothing was issued",
    )  # fmt: skip


def issue(
    registry: Registry,
    record_id: str,
    document: Mapping[str, str],
    *,
    decided: str,
    named: Sequence[str] = (),
) -> int:
    """Enter that a document was issued over a record; return the entry's number.

    ``document`` has its ``name``, the hash ``content`` of what it says, those of its files by name, and of a
    report the day of its test as ``tested``.
    ``decided`` is the hash of the last decision that the document knew of (`Ledger.decided`), ``named`` as of
    `issuers`.

    Raises
    ------
    RegistryError
        ``ledger-moved``: something was decided since; ``missing``; nothing is entered
    TrustError
        ``not-signed``, ``not-allowed``; ``request``: an answer is of another document; nothing is entered
    Requested
        the issue was written to a file to be signed elsewhere
    OutputError
        the registry cannot be written to
    """
    from toolkit.calibration.registry.registry import instrument_of

    instrument, names = instrument_of(record_id), issuers(registry, record_id, named)
    numbers: list[int] = []

    def build(ledger: Ledger) -> Change:
        if record_id not in ledger.entered() or ledger.decided != decided:
            raise RegistryError(
                "a decision was entered while the document was being made", where=record_id,
                got=f"the ledger's last decision {ledger.decided[:16]}...",
                expected=f"{decided[:16]}..., by which the document was made",
                next_step="issue the document again; nothing was issued", rule="ledger-moved",
            )  # fmt: skip
        numbers.append(len(ledger.entries) + 1)
        event = {
            "event": ISSUED, "id": record_id, "time": now(), "by": names[0] if names else "not stated",
            "document": dict(document),
        }  # fmt: skip
        return Change(files={}, event=event)

    registry.commit(instrument, build)
    return numbers[-1]


Issue = Callable[[Path, Sequence[Path], int, str, Mapping[str, Any] | None], Mapping[str, Any]]
"""Issues a PDF of so many pages in place, with the files that are handed over with it, the hash of what it
says and what its manifest says, where it has one; returns the ledger's proof."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Issuing:
    """How the documents of a call are issued: over which registry, by its signers, with which seal.

    ``named`` are the people, by id, whom a request asks to sign.
    """

    registry: Registry
    sealing: Sealing | None = None
    named: tuple[str, ...] = ()

    def content(self, content: ReportContent) -> ReportContent:
        """Return the content of a document that is issued: its line of signatures, the place of its proof.

        Raises
        ------
        TrustError
            ``not-signed``, ``not-allowed``: asked before anything is made
        """

        names = issuers(self.registry, content.calibrations[0].id, self.named)
        return content.issued_by(" and ".join(names) or None)

    def issue(
        self, content: ReportContent, *, document: str, decided: str, tested: str | None = None
    ) -> Issue:
        """Return what issues a document, such as ``certificate CC-1``.

        ``decided`` is the hash of the last decision that the content knew of, ``tested`` the day of the test
        that a report tells of: what is decided of that day later is held against it.
        """
        stated = {"name": document} | ({} if tested is None else {TESTED: tested})
        return partial(self._issue, content, stated, decided)

    def _issue(
        self, content: ReportContent, stated: Mapping[str, str], decided: str,
        pdf: Path, others: Sequence[Path], pages: int, digest: str, manifest: Mapping[str, Any] | None,
    ) -> Mapping[str, Any]:  # fmt: skip
        from toolkit.recording.marks import GENERATOR
        from toolkit.report.word.closing import place_of_symbol
        from toolkit.trust.seal.pdf import proved_pdf

        use = content.calibrations[0]
        place = place_of_symbol(pdf, pages, content)
        hashes = {file.name: _hash(file) for file in others}
        anchor = self._anchor(use.id, {**stated, "content": digest, **hashes}, others, decided)
        ledger = {"schema": 1, **anchor.as_dict()}
        for file in others:
            if file.suffix == ".xml":
                file.write_bytes(self._digital(file, ledger))
        proof = {
            "generator": GENERATOR,
            "schema": 1,
            "document": stated["name"],
            "records": [{"id": use.id, "sha256": use.sha256}],
            "files": [{"name": file.name, "sha256": sha256_file(file)} for file in others],
            "ledger": ledger,
        }
        if manifest is not None:
            proof[MANIFEST] = statements_hash(manifest)
        text = json.dumps(proof, ensure_ascii=False, indent=1).encode() + b"\n"
        data = proved_pdf(read_input(pdf, PDF_FILE), {PROOF: text}, anchor.compact, place)
        pdf.write_bytes(data if self.sealing is None else self.sealing.seal_pdf(data, stated["name"]))
        return ledger

    def _anchor(
        self, record_id: str, document: Mapping[str, str], files: Sequence[Path], decided: str
    ) -> Anchor:
        from toolkit.calibration.registry.registry import instrument_of
        from toolkit.lab.signatures.people import checkpoint_of, lines_of
        from toolkit.trust.anchor import anchor_of
        from toolkit.trust.ssh import ED25519

        registry = self.registry
        if registry.travel.request is not None:
            registry = registry.travelling(replace(registry.travel, files=tuple(files)))
        seq = issue(registry, record_id, document, decided=decided, named=self.named)
        instrument = instrument_of(record_id)
        # The entry is what people sign, by whatever key; of the checkpoint only Ed25519 is a signature.
        signers = [signer for signer in self.registry.signers if signer.public.kind == ED25519]
        checkpoint = checkpoint_of(self.registry, instrument, signers)
        return anchor_of(lines_of(self.registry, instrument), seq - 1, checkpoint)

    def _digital(self, file: Path, ledger: Mapping[str, Any]) -> bytes:
        from toolkit.inputs import DCC_FILE
        from toolkit.trust.seal.xml import with_proof

        data = with_proof(read_input(file, DCC_FILE), json.dumps(ledger, ensure_ascii=False))
        return data if self.sealing is None else self.sealing.seal_xml(data)


def open_issuing(
    registry: Registry, sealing: Sealing | None, *, asked: bool, draft: bool, named: Sequence[str] = ()
) -> Issuing | None:
    """Return how a document is issued where that, or a seal, was asked for; None where neither was.

    ``named`` as of `Issuing`.

    Raises
    ------
    ConfigError
        ``usage``: a draft is never issued; keys that sign nothing
    """
    if asked and draft:
        raise ConfigError(
            "a draft is never issued", where="--draft, --issue", got="both", expected="one of the two",
            next_step="approve the record first, or leave out --issue; nothing was made", rule="usage",
        )  # fmt: skip
    if not asked and sealing is None:
        if registry.signers or registry.travel != HERE:
            raise ConfigError(
                "a signature belongs to an issue", where="--sign, --request, --answer", got="no --issue",
                expected="--issue too: what is signed is the ledger's entry of the document",
                next_step="add --issue, or leave these out; nothing was made", rule="usage",
            )  # fmt: skip
        return None
    return Issuing(registry=registry, sealing=sealing, named=tuple(named))


def _hash(file: Path) -> str:
    """Return the hash that the entry holds of a file: a digital certificate's is that of its content."""
    from toolkit.inputs import DCC_FILE
    from toolkit.trust.seal.xml import content_hash

    return str(content_hash(read_input(file, DCC_FILE))) if file.suffix == ".xml" else sha256_file(file)
