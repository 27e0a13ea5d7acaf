"""What a new record says against the instrument's history: sign and span of every cell, by its serial.

A cell is compared with the last approved record that it stood in. That is the instrument's last one, unless
the cell was exchanged: a serial that nobody has seen begins a new history, one that returns goes on with its
own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from toolkit.calibration.records.record import from_bytes
from toolkit.calibration.registry.gates import GateResult, new_history, sign_and_span
from toolkit.calibration.registry.registry import load_checked, today
from toolkit.calibration.registry.status import status_of
from toolkit.errors import ToolkitError
from toolkit.files import read_regular
from toolkit.findings import Finding

if TYPE_CHECKING:
    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.calibration.registry.ledger import Ledger
    from toolkit.calibration.registry.registry import Registry


@dataclass(frozen=True, slots=True, kw_only=True)
class History:
    """``last``: the newest approved record; ``returned``: that of each cell that ``last`` does not know."""

    last: CalibrationRecord | None
    returned: Mapping[str, CalibrationRecord]


def approved_ids(ledger: Ledger, *, but: str = "") -> list[str]:
    """Return the approved records that are not withdrawn, the newest first."""
    ranks = []
    for record_id in ledger.entered():
        entries = ledger.of(record_id)
        status = status_of(record_id, entries, today())
        if record_id != but and status.state == "approved" and status.in_force_from is not None:
            ranks.append((status.in_force_from, max(entry.seq for entry in entries), record_id))
    return [record_id for _, _, record_id in sorted(ranks, reverse=True)]


def history_of(registry: Registry, record: CalibrationRecord, ledger: Ledger, *, but: str = "") -> History:
    """Return what a record's cells are compared with.

    Only where a cell is not that of the last record are older ones read.

    Raises
    ------
    RecordError
        a record that is compared with fails a gate
    """
    folder, ids = registry.folder / record.instrument, approved_ids(ledger, but=but)
    if not ids:
        return History(last=None, returned={})
    last = load_checked(folder, ids[0], ledger)
    units = {cell.name: (cell.serial, cell.unit) for cell in record.cells}
    # Without a serial nobody knows which cell it is.
    sought = {name for name in new_history(record, last) if units[name][0] is not None}
    returned: dict[str, CalibrationRecord] = {}
    for record_id in ids[1:] if sought else ():
        path = folder / f"{record_id}.json"
        try:
            had = from_bytes(read_regular(path), where=path)
        except (ToolkitError, OSError):
            # `verify` names it; what it held cannot be told.
            continue
        found = {cell.name for cell in had.cells if units.get(cell.name) == (cell.serial, cell.unit)} & sought
        if found:
            checked = load_checked(folder, record_id, ledger)
            returned |= dict.fromkeys(found, checked)
            sought -= found
        if not sought:
            break
    return History(last=last, returned=returned)


def compared(record: CalibrationRecord, history: History) -> tuple[GateResult, ...]:
    """Return the coefficients whose sign or span is not that of their cell's history."""
    if history.last is None:
        return ()
    failed = sign_and_span(record, history.last)
    for name, older in history.returned.items():
        failed += sign_and_span(record, older, only=(name,))
    return failed


def history_findings(record: CalibrationRecord, history: History) -> tuple[Finding, ...]:
    """Return the findings against the instrument's approved records."""
    last = history.last
    if last is None:
        return ()
    found = [
        Finding(rule=one.rule, where=one.where, message=one.message) for one in compared(record, history)
    ]
    before = {cell.name: cell for cell in last.cells}
    for name in new_history(record, last):
        cell = next(c for c in record.cells if c.name == name)
        old, older = before.get(name), history.returned.get(name)
        told = "it has no history" if old is None else (
            f"serial {old.serial or 'not stated'} [{old.unit}] in {last.id}, "
            f"now {cell.serial or 'not stated'} [{cell.unit}]"
        )  # fmt: skip
        message = f"a new sign and span history begins: {told}"
        if older is not None:
            message = (
                f"serial {cell.serial} returns: its sign and span history goes on from {older.id}; {told}"
            )
        found.append(Finding(rule="serial", where=name, message=message))
    return tuple(found)
