"""Issuing a document: its entry in the ledger, the proof of the entry in its files, then its seals.

The order is that of what holds what. The entry holds the hashes of what was made before it: the content, the
Word file, the content of the digital certificate, the files that are handed over. Their proof, the entry with
its way to a checkpoint, enters the digital certificate and the PDF, as an attachment and as a code on its
last page. Seals cover all of it. What fails before the entry leaves nothing; what fails after it leaves an
entry over a document that never left, and issuing again makes another.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolkit.errors import ConfigError
from toolkit.files import sha256_file
from toolkit.inputs import PDF_FILE, read_input
from toolkit.lab.signatures.proofs import PROOF
from toolkit.trust.signing import HERE

if TYPE_CHECKING:
    from toolkit.calibration.registry.registry import Registry
    from toolkit.lab.signatures.sealing import Sealing
    from toolkit.report.content import ReportContent
    from toolkit.trust.anchor import Anchor

Issue = Callable[[Path, Sequence[Path], int, str], Mapping[str, Any]]
"""Issues a PDF of so many pages in place, with the files that are handed over with it and the hash of what it
says; returns the ledger's proof."""


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
        from toolkit.calibration.registry.issuing import issuers

        names = issuers(self.registry, content.calibrations[0].id, self.named)
        return content.issued_by(" and ".join(names) or None)

    def issue(self, content: ReportContent, *, document: str, decided: str) -> Issue:
        """Return what issues a document, such as ``certificate CC-1``.

        ``decided`` is the hash of the last decision that the content knew of.
        """
        return partial(self._issue, content, document, decided)

    def _issue(
        self, content: ReportContent, document: str, decided: str,
        pdf: Path, others: Sequence[Path], pages: int, digest: str,
    ) -> Mapping[str, Any]:  # fmt: skip
        from toolkit.recording.marks import GENERATOR
        from toolkit.report.word.closing import place_of_symbol
        from toolkit.trust.seal.pdf import proved_pdf

        use = content.calibrations[0]
        place = place_of_symbol(pdf, pages, content)
        hashes = {file.name: _hash(file) for file in others}
        anchor = self._anchor(use.id, {"name": document, "content": digest, **hashes}, others, decided)
        ledger = {"schema": 1, **anchor.as_dict()}
        for file in others:
            if file.suffix == ".xml":
                file.write_bytes(self._digital(file, ledger))
        proof = {
            "generator": GENERATOR,
            "schema": 1,
            "document": document,
            "records": [{"id": use.id, "sha256": use.sha256}],
            "files": [{"name": file.name, "sha256": sha256_file(file)} for file in others],
            "ledger": ledger,
        }
        text = json.dumps(proof, ensure_ascii=False, indent=1).encode() + b"\n"
        data = proved_pdf(read_input(pdf, PDF_FILE), {PROOF: text}, anchor.compact, place)
        pdf.write_bytes(data if self.sealing is None else self.sealing.seal_pdf(data, document))
        return ledger

    def _anchor(
        self, record_id: str, document: Mapping[str, str], files: Sequence[Path], decided: str
    ) -> Anchor:
        from toolkit.calibration.registry.issuing import issue
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
