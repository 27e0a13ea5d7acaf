"""What a new record says against the instrument's history: every cell, by its serial.

A cell is compared with the last approved record that it stood in. That is the instrument's last one, unless
the cell was exchanged: one that returns goes on with its own history. A serial that nobody has seen is a
replacement. It is held against the cell before it all the same: another span is what a replacement may have,
once somebody wrote why; another sign is not, unless something else confirms it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Protocol

from toolkit.calibration.fit.printed_digits import copies, own_scatter
from toolkit.calibration.records.record import CalibrationRecord, from_bytes
from toolkit.calibration.registry.gates import GateResult, layout, sign_and_span
from toolkit.calibration.registry.ledger import Ledger
from toolkit.calibration.registry.response import main_indications, response, same_dimension
from toolkit.calibration.registry.status import status_of
from toolkit.calibration.registry.stored import stored_loads
from toolkit.calibration.session.table import Table
from toolkit.errors import ToolkitError
from toolkit.inputs import read_regular

# Another cell for the same loads may be of another capacity; ten times the output is a slip of a unit.
REPLACED_SPAN = 10.0
_READ_ONCE = 0.5  # of a session's rows: fewer may be old ones that were joined to new ones


@dataclass(frozen=True, slots=True, kw_only=True)
class History:
    """``last``: the newest approved record; ``returned``: that of each cell that ``last`` does not know."""

    last: CalibrationRecord | None
    returned: Mapping[str, CalibrationRecord]


NO_HISTORY = History(last=None, returned={})


class Records(Protocol):
    """Where the records of a ledger are read: a registry."""

    @property
    def folder(self) -> Path:
        """The registry's folder."""

    def load_by(self, ledger: Ledger, record_id: str) -> CalibrationRecord:
        """Return a record that passes the gates of its loading."""


def approved_ids(ledger: Ledger, *, but: str = "") -> list[str]:
    """Return the approved records that are not withdrawn, the newest first."""
    ranks = []
    known_on = ledger.known_on()
    for record_id in ledger.entered():
        entries = ledger.of(record_id)
        status = status_of(record_id, entries, known_on)
        if record_id != but and status.state == "approved" and status.in_force_from is not None:
            ranks.append((status.in_force_from, max(entry.seq for entry in entries), record_id))
    return [record_id for _, _, record_id in sorted(ranks, reverse=True)]


def approved_before(ledger: Ledger, line: int, *, but: str) -> list[str]:
    """Return the records that `approved_ids` returned when a line was written."""
    since: dict[str, date] = {}
    ended = {but}
    for entry in ledger.decisions:
        if entry.seq >= line:
            break
        if entry.event != "approved":
            ended.add(entry.id)
            since.pop(entry.id, None)
        elif entry.since is not None and entry.id not in ended:
            since[entry.id] = min(entry.since, since.get(entry.id, entry.since))
    ranks = [
        (day, max(entry.seq for entry in ledger.of(record_id) if entry.seq < line), record_id)
        for record_id, day in since.items()
    ]
    return [record_id for _, _, record_id in sorted(ranks, reverse=True)]


def history_of(
    registry: Records, record: CalibrationRecord, ledger: Ledger, *, but: str = "", before: int | None = None
) -> History:
    """Return what a record's cells are compared with; ``before``: were, when its approval's line was written.

    Only where a cell is not that of the last record are older ones read.

    Raises
    ------
    RecordError
        a record that is compared with fails a gate
    """
    folder, ids = registry.folder / record.instrument, list[str]()
    if before is None:
        ids = approved_ids(ledger, but=but)
    elif (newest := ledger.newest_before.get(before)) is not None:
        ids = [newest]
    if not ids:
        return NO_HISTORY
    last = registry.load_by(ledger, ids[0])
    serials = {cell.name: cell.serial for cell in record.cells}
    # Without a serial nobody knows which cell it is.
    sought = {name for name in exchanged(record, last) if serials[name] is not None}
    returned: dict[str, CalibrationRecord] = {}
    if sought and before is not None:
        ids = approved_before(ledger, before, but=but)
    for record_id in ids[1:] if sought else ():
        path = folder / f"{record_id}.json"
        try:
            had = from_bytes(read_regular(path), where=path)
        except (ToolkitError, OSError):
            # `verify` names it; what it held cannot be told.
            continue
        unchanged = {cell.name for cell in had.cells if serials.get(cell.name) == cell.serial} & sought
        if unchanged:
            checked = registry.load_by(ledger, record_id)
            returned |= dict.fromkeys(unchanged, checked)
            sought -= unchanged
        if not sought:
            break
    return History(last=last, returned=returned)


def exchanged(new: CalibrationRecord, old: CalibrationRecord) -> tuple[str, ...]:
    """Return the indications whose serial is not that of an earlier record, or that it did not have."""
    before = {cell.name: cell.serial for cell in old.cells}
    return tuple(c.name for c in new.cells if c.name not in before or before[c.name] != c.serial)


def replaced(new: CalibrationRecord, history: History) -> tuple[str, ...]:
    """Return the indications whose place in the last record held another cell, which does not return."""
    if history.last is None:
        return ()
    before = {cell.name for cell in history.last.cells}
    return tuple(
        name for name in exchanged(new, history.last) if name in before and name not in history.returned
    )


def agreeing(
    new: CalibrationRecord, history: History, results: Collection[GateResult]
) -> frozenset[tuple[str, str]]:
    """Return the pairs of a load and a main indication that its own history has too, with the same sign.

    ``results`` are those of `compared`. A replacement has no history of its own: that the cell before it had
    the same sign says nothing about how the new one was wired. Nor has an indication in another kind of unit.
    """
    if history.last is None:
        return frozenset()
    units = {load.load: load.unit for load in history.last.loads}
    before = {cell.name: cell.unit for cell in history.last.cells}
    cells = {
        cell.name
        for cell in new.cells
        if cell.name in before
        and same_dimension(cell.unit, before[cell.name])
        and cell.name not in replaced(new, history)
    }
    changed = {result.where for result in results if result.rule == "sign"}
    return frozenset(
        (load.load, name)
        for load in new.loads
        if load.load in units and same_dimension(load.unit, units[load.load])
        for name in main_indications(new, load)
        if name in cells and f"{load.load}, {name}" not in changed
    )


def compared(
    new: CalibrationRecord,
    history: History,
    *,
    confirmed: Collection[tuple[str, str]] = (),
    reasons: Mapping[str, str] | None = None,
) -> tuple[GateResult, ...]:
    """Return what the history of its cells says about a record.

    Parameters
    ----------
    confirmed : pairs of load and indication whose sign a machine definition or a reading confirms; for a
        replacement that settles a changed sign
    reasons : why a cell was replaced, by indication
    """
    last = history.last
    if last is None:
        return ()
    out = replaced(new, history)
    results = list(layout(new, last))
    stay = [c.name for c in new.cells if c.name not in out and c.name not in history.returned]
    results += sign_and_span(new, last, only=stay)
    for name, older in history.returned.items():
        results += sign_and_span(new, older, only=(name,))
        message = f"serial {_serial(new, name)} returns: its sign and span history goes on from {older.id}"
        results.append(GateResult(rule="serial", where=name, message=message, effect="tells"))
    for result in sign_and_span(new, last, only=out):
        load, name = result.where.split(", ")
        settled = result.rule == "sign" and (load, name) in confirmed
        allowed = result.rule == "span" and _within(new, last, load, name)
        remark = "; the cell is a replacement"
        if result.rule == "sign":
            remark += " and its sign is confirmed" if settled else (
                ": the machine definition or a polarity reading must confirm the new sign"
            )  # fmt: skip
        results.append(
            dataclasses.replace(
                result, message=result.message + remark, effect="tells" if settled or allowed else "blocks"
            )
        )
    for name in out:
        results += _replacement(new, last, name, (reasons or {}).get(name))
    return (*results, *_twice(new))


def _replacement(
    new: CalibrationRecord, last: CalibrationRecord, name: str, reason: str | None
) -> list[GateResult]:
    serial = _serial(new, name)
    message = f"a replacement: serial {_serial(last, name)} in {last.id}, now {serial}"
    stood = next((c.name for c in last.cells if c.serial is not None and c.serial == serial), None)
    if stood is not None:
        message += f", which stood at {stood} in {last.id}: were two cells or two serials exchanged?"
    if reason:
        return [GateResult(rule="serial", where=name, message=f"{message}; reason: {reason}", effect="tells")]
    needed = (
        "a replaced cell needs a reason: approve --reason TEXT, or replacement = TEXT in "
        f"[cells.{name}] of SESSION.toml"
    )
    return [
        GateResult(rule="serial", where=name, message=message, effect="tells"),
        GateResult(rule="replacement", where=name, message=needed, effect="asks"),
    ]


def _within(new: CalibrationRecord, last: CalibrationRecord, load: str, name: str) -> bool:
    before, now = (
        response(record, record.load(load), next(c for c in record.cells if c.name == name)).value
        for record in (last, new)
    )
    return before != 0 and 1 / REPLACED_SPAN < abs(now / before) < REPLACED_SPAN


def _twice(new: CalibrationRecord) -> list[GateResult]:
    serials = [cell.serial for cell in new.cells if cell.serial is not None]
    return [
        GateResult(
            rule="serial",
            where=", ".join(cell.name for cell in new.cells if cell.serial == serial),
            message=f"serial {serial} is stated for more than one cell",
        )
        for serial in dict.fromkeys(serials)
        if serials.count(serial) > 1
    ]


def _serial(record: CalibrationRecord, name: str) -> str:
    return next((c.serial for c in record.cells if c.name == name), None) or "not stated"


def read_before(
    registry: Records, record: CalibrationRecord, table: Table, ledger: Ledger, *, but: str = ""
) -> tuple[GateResult, ...]:
    """Return the approved records of other days whose readings are those of a record.

    ``table`` holds the record's reference loads in its own units. Loads that are applied again have noise of
    their own: most rows of two sessions never agree. Rows are compared, not files: their order and the digits
    in which they are written may differ. An evaluation of the same day's readings is none of another day.
    """
    names = [*record.indications, *(load.load for load in record.loads)]
    equations = [(load.terms, load.coefficients, load.residual_sd or 0.0) for load in record.loads]
    scatter = own_scatter(record.indications, equations) + [0.0] * len(record.loads)
    told = []
    for record_id in approved_ids(ledger, but=but):
        older = registry.load_by(ledger, record_id)
        had = stored_loads(registry.folder, older) if older.date != record.date else None
        if had is None or not all(had.has(name) for name in names):
            continue
        if not all(same_dimension(had.unit(name), table.unit(name)) for name in names):
            continue
        had = had.in_units({name: table.unit(name) for name in names})
        again = len(copies(table.matrix(names), had.matrix(names), scatter))
        if again > _READ_ONCE * table.rows:
            message = (
                f"{again} of {table.rows} rows are readings of {record_id}, of {older.date}: readings have "
                "one date. Loads that are applied again have noise of their own"
            )
            told.append(
                GateResult(rule="readings-again", where=record.instrument, message=message, effect="tells")
            )
    return tuple(told)
