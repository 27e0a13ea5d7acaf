"""An issue: that a document left the laboratory is an entry of its record's ledger.

The entry names the document, the hash of what it says and the hashes of its files, and is signed as every
decision is. What carries the proof of the entry, the PDF and its manifest, is made after it and is none of
these files. Signature and entry are one transaction (`store`): a kill leaves both or neither.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

from toolkit.calibration.registry.clock import now
from toolkit.calibration.registry.ledger import Ledger
from toolkit.calibration.registry.signatures import nobody
from toolkit.calibration.registry.store import Change
from toolkit.errors import RegistryError, TrustError
from toolkit.trust.people import Person, Version, inability, objections
from toolkit.trust.signing import HERE

if TYPE_CHECKING:
    from toolkit.calibration.registry.registry import Registry

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

    ``document`` has its ``name``, the hash ``content`` of what it says, and those of its files by kind.
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
