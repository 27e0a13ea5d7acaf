"""Which record an instrument was used with when it came to a session."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from typing import TYPE_CHECKING

from toolkit.calibration.registry.registry import load_checked
from toolkit.calibration.registry.status import status_of

if TYPE_CHECKING:
    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.calibration.registry.ledger import Ledger
    from toolkit.calibration.registry.registry import Registry


def in_use_before(
    registry: Registry,
    instrument: str,
    on: dt.date,
    *,
    but: str | None = None,
    ledger: Ledger | None = None,
    checked: Mapping[str, CalibrationRecord] | None = None,
) -> CalibrationRecord | None:
    """Return the record that was in force when a session of day ``on`` began; None where there was none.

    A session cannot be judged by itself: the record ``but`` is left out, and so is every fitted record of
    the same day or later, whose approval may reach back. Else the rule is that of `Registry.in_force`, as
    known on the session's day: a withdrawal that came later does not change what was in force then.

    ``ledger`` and ``checked`` (records by id that passed their gates) are what a caller has read already.

    Raises
    ------
    RegistryError, RecordError
        the ledger is damaged, or that record fails a gate
    """
    ledger = registry.ledger(instrument) if ledger is None else ledger
    ranks = [
        rank
        for record_id in ledger.entered()
        if record_id != but
        for rank in _approvals(ledger, record_id, on)
    ]
    for rank in sorted(ranks, reverse=True):
        record = (checked or {}).get(rank[3]) or load_checked(registry.folder / instrument, rank[3], ledger)
        if record.kind != "fit" or dt.date.fromisoformat(record.date) < on:
            return record
    return None


def _approvals(ledger: Ledger, record_id: str, on: dt.date) -> list[tuple[bool, dt.date, int, str]]:
    entries = ledger.of(record_id)
    if not any(
        entry.event == "approved" and entry.since is not None and entry.since <= on for entry in entries
    ):
        return []
    status = status_of(record_id, entries, on)
    if status.void_from is not None and on >= status.void_from:
        return []
    return [
        (entry.known_on is not None and entry.known_on <= on, entry.since, entry.seq, record_id)
        for entry in entries
        if entry.event == "approved" and entry.since is not None and entry.since <= on
    ]
