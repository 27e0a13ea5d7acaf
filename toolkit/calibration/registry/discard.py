"""The end of a candidate: a line in the ledger. The record stays, and is known for ever."""

from __future__ import annotations

import datetime as dt
from typing import TYPE_CHECKING

from toolkit.calibration.registry.clock import now
from toolkit.calibration.registry.registry import Registry, instrument_of, today
from toolkit.calibration.registry.status import RecordStatus, status_of
from toolkit.calibration.registry.store import Change, commit
from toolkit.errors import RegistryError

if TYPE_CHECKING:
    from toolkit.calibration.registry.ledger import Ledger


def discard(registry: Registry, record_id: str, *, reason: str, by: str = "not stated") -> RecordStatus:
    """Discard a candidate: it can never be approved, and nothing is compared with it.

    The record is not read: a candidate that fails its gates may be discarded too.

    Raises
    ------
    RegistryError
        ``discard``: no reason, or the record was approved, withdrawn or discarded before; ``missing``; the
        ledger is damaged. Nothing is written
    """
    folder = registry.folder / instrument_of(record_id)
    if not reason.strip():
        raise _refused(record_id, "a discard needs a reason", "nothing", "--reason TEXT", "discard")

    def build(ledger: Ledger) -> Change:
        if record_id not in ledger.entered():
            raise _refused(record_id, "no such record", record_id, ", ".join(ledger.entered()), "missing")
        entries = ledger.of(record_id)
        status = status_of(record_id, entries, dt.date.max)
        if status.state != "candidate":
            told = f"{status.state}: {status.reason}" if status.reason else status.state
            raise _refused(
                record_id, f"the record is {status.state}, and only a candidate can be discarded", told,
                "a candidate that was never approved; an approved record is withdrawn", "discard",
            )  # fmt: skip
        return Change(
            files={},
            event={
                "event": "discarded",
                "id": record_id,
                "time": now(),
                "by": by,
                "known_on": today().isoformat(),
                "reason": reason.strip(),
            },
        )

    if not folder.is_dir():
        known = ", ".join(registry.instruments()) or "a record"
        raise _refused(record_id, "no such record", record_id, known, "missing")
    commit(folder, build)
    return registry.status(record_id)


def _refused(record_id: str, what: str, got: str, expected: str, rule: str) -> RegistryError:
    return RegistryError(
        what, where=record_id, got=got, expected=expected,
        next_step="nothing was changed; see 'toolkit calibration list --all'", rule=rule,
    )  # fmt: skip
