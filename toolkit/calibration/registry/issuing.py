"""An issue: that a document left the laboratory is an entry of its record's ledger.

The entry names the document, the hash of what it says and the hashes of its files, and is signed as every
decision is. What carries the proof of the entry, the PDF and its manifest, is made after it and is none of
these files. Signature and entry are one transaction (`store`): a kill leaves both or neither.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from toolkit.calibration.registry.clock import now
from toolkit.calibration.registry.ledger import Ledger
from toolkit.calibration.registry.signatures import nobody
from toolkit.calibration.registry.store import Change
from toolkit.errors import RegistryError, TrustError
from toolkit.trust.people import objections

if TYPE_CHECKING:
    from toolkit.calibration.registry.registry import Registry

ISSUED = "issued"


def issuers(registry: Registry, record_id: str) -> tuple[str, ...]:
    """Return the names of the people whose keys at hand issue; none where nobody is enrolled.

    Raises
    ------
    TrustError
        ``not-signed``, ``not-allowed``
    """
    version = registry.people().history.now
    if version is None:
        if registry.signers:
            raise nobody(record_id)
        return ()
    publics = [signer.public for signer in registry.signers]
    reasons = objections(version, "issue", now(), publics)
    if reasons:
        demand = version.people.policy.demand("issue")
        raise TrustError(
            "these keys cannot issue" if publics else "to issue takes a signature", where=record_id,
            got="; ".join(reasons) if publics else "no key",
            expected=f"{demand.signatures} by {' or '.join(demand.roles)}",
            next_step="sign with --sign KEY; see 'toolkit person list'; nothing was issued",
            rule="not-allowed" if publics else "not-signed",
        )  # fmt: skip
    people = (version.people.owner(public) for public in publics)
    return tuple(dict.fromkeys(person.name for person in people if person is not None))


def issue(registry: Registry, record_id: str, document: Mapping[str, str], *, decided: str) -> int:
    """Enter that a document was issued over a record; return the entry's number.

    ``document`` has its ``name``, the hash ``content`` of what it says, and those of its files by kind.
    ``decided`` is the hash of the last decision that the document knew of (`Ledger.decided`).

    Raises
    ------
    RegistryError
        ``ledger-moved``: something was decided since; ``missing``; nothing is entered
    TrustError
        ``not-signed``, ``not-allowed``; nothing is entered
    OutputError
        the registry cannot be written to
    """
    from toolkit.calibration.registry.registry import instrument_of

    instrument, names = instrument_of(record_id), issuers(registry, record_id)
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
