"""As found and as left: what an instrument indicated before anybody adjusted it.

The record in force when the instrument came in is applied to the rows of a session with
``phase = "as_found"``. An error beyond the tolerance says that tests since the last good as-found result
may be wrong (ISO/IEC 17025:2017, 7.8.4.1 d, 7.10). An ``as_left`` session belongs to the as-found one
before it.
"""

from __future__ import annotations

import bisect
import datetime as dt
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.apply import apply_record
from toolkit.calibration.records.record import CalibrationRecord, Zero, from_bytes
from toolkit.calibration.registry.ledger import Ledger
from toolkit.calibration.registry.registry import Registry, load_checked, load_many
from toolkit.calibration.registry.status import status_of
from toolkit.calibration.registry.stored import stored_loads
from toolkit.calibration.session.statements import entries_of
from toolkit.calibration.session.table import Table
from toolkit.declared import Entry, derived
from toolkit.errors import ToolkitError, UnitError
from toolkit.files import sha256_bytes
from toolkit.findings import Finding
from toolkit.inputs import read_regular
from toolkit.units import si_scale

# Errors of a session's rows by a record that was not fitted to them.


def errors_by(record: CalibrationRecord, table: Table, *, zero: Zero) -> dict[str, Array] | str:
    """Return fitted minus reference (rows,) of each load that both have, in the table's unit.

    ``zero`` is the session's. A text tells why the record cannot be held against these rows: another
    indication or unit, or indications that were not tared where the record needs that. Tared rows under a
    record that includes the zero are compared without its intercept.
    """
    if record.zero != "included" and zero == "included":
        return f"{record.id} was fitted to tared indications, the session's are not tared"
    missing = [name for name in record.indications if not table.has(name)]
    if missing:
        return f"{record.id} needs {', '.join(missing)}, which the session does not have"
    units = record.units
    try:
        in_units = table.in_units(units)
    except UnitError as error:
        return f"{record.id}: {error.what}"
    loads = [load.load for load in record.loads if table.has(load.load)]
    if not loads:
        return f"{record.id} has none of the session's loads"
    tare = dict.fromkeys(units, 0.0) if (record.zero == "included") != (zero == "included") else None
    try:
        fitted = apply_record(
            record, in_units.columns(record.indications), units=units, tare=tare, only=loads
        )
        return {
            load: fitted[load] / si_scale(table.unit(load), where=f"column {load}") - table.column(load)
            for load in loads
        }
    except ToolkitError as error:
        return f"{record.id}: {error.what}"


# Which record an instrument was used with when it came to a session.

Approvals = tuple[tuple[dt.date, int, str, dt.date | None], ...]
"""First day in force, number of the entry, record and day of the decision of each approval, in order."""


def in_use_before(
    registry: Registry,
    instrument: str,
    on: dt.date,
    *,
    but: str | None = None,
    ledger: Ledger | None = None,
    checked: Mapping[str, CalibrationRecord] | None = None,
    approvals: Approvals | None = None,
) -> CalibrationRecord | None:
    """Return the record that was in force when a session of day ``on`` began; None where there was none.

    A session cannot be judged by itself: the record ``but`` is left out, and so is every fitted record of
    the same day or later, whose approval may reach back. Else the rule is that of `Registry.in_force`, as
    known on the session's day: a withdrawal that came later does not change what was in force then.

    ``ledger``, its ``approvals``, and ``checked`` (records by id that passed their gates) are what a caller
    has read already.

    Raises
    ------
    RegistryError, RecordError
        the ledger is damaged, or that record fails a gate
    """
    ledger = registry.ledger(instrument) if ledger is None else ledger
    approvals = approvals_of(ledger) if approvals is None else approvals
    past = approvals[: bisect.bisect_right(approvals, on, key=lambda approval: approval[0])]
    for was_known in (True, False):
        for _, _, record_id, known_on in reversed(past):
            if record_id == but or (known_on is not None and known_on <= on) != was_known:
                continue
            void_from = status_of(record_id, ledger.of(record_id), on).void_from
            if void_from is not None and on >= void_from:
                continue
            record = (checked or {}).get(record_id)
            record = record or load_checked(registry.folder / instrument, record_id, ledger)
            if record.kind != "fit" or dt.date.fromisoformat(record.date) < on:
                return record
    return None


def approvals_of(ledger: Ledger) -> Approvals:
    """Return the approvals of a ledger in the order in which they count: first day in force, then entry."""
    return tuple(
        sorted(
            (entry.since, entry.seq, record_id, entry.known_on)
            for record_id in ledger.entered()
            for entry in ledger.of(record_id)
            if entry.event == "approved" and entry.since is not None
        )
    )


_SLACK = 1 + 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class AsFoundLoad:
    """The errors of a session's rows by the record that was in force before it."""

    load: str
    unit: str
    reference: Annotated[tuple[float, ...], Entry("of each row")]
    error: Annotated[tuple[float, ...], Entry("fitted minus reference of each row")]
    tolerance: float
    full_scale: Annotated[float, Entry("the largest load of the session")]
    max_error: Annotated[float, Entry("the largest one, with its sign")]
    max_percent_fs: float
    worst_row: Annotated[int, Entry("from 1")]

    @property
    @derived()
    def within(self) -> bool:
        """Whether no error is beyond the tolerance."""
        return abs(self.max_error) <= self.tolerance * _SLACK


@dataclass(frozen=True, slots=True, kw_only=True)
class AsFound:
    """A session's rows by the record in force before it.

    ``session_record`` is the record that the session led to, ``record`` the one that was applied (None:
    there was none), ``since`` the date of that record's own session. ``reason`` tells why nothing could be
    compared, and then ``loads`` is empty.
    """

    instrument: str
    date: dt.date
    session_record: str
    record: str | None
    record_sha256: str | None
    since: dt.date | None
    loads: tuple[AsFoundLoad, ...]
    reason: str | None

    @property
    def within(self) -> bool | None:
        """Whether every load was within its tolerance; None where nothing could be compared."""
        return all(load.within for load in self.loads) if self.loads else None

    @property
    def worst_share(self) -> float | None:
        """Largest |error| of all loads as a share of its tolerance; None where nothing was compared."""
        return max((abs(load.max_error) / load.tolerance for load in self.loads), default=None)


def phase_of(record: CalibrationRecord) -> str | None:
    """Return ``as_found``, ``as_left`` or None, as the record's session stated."""
    return entries_of(record).phase


def as_found(registry: Registry, record: CalibrationRecord) -> AsFound:
    """Return what a session found, by the record in force before it; ``record`` is the session's own.

    Raises
    ------
    RegistryError, RecordError
        the ledger is damaged, or the record in force fails a gate
    """
    date = dt.date.fromisoformat(record.date)
    before = in_use_before(registry, record.instrument, date, but=record.id)
    table = stored_loads(registry.folder, record)
    loads: tuple[AsFoundLoad, ...] = ()
    reason = None
    if before is None:
        reason = f"no record was in force before {date.isoformat()}"
    elif table is None:
        reason = f"{record.id} has no reference-load data"
    else:
        errors = errors_by(before, table, zero=record.zero)
        if isinstance(errors, str):
            reason = errors
        else:
            loads = tuple(_load(record, name, table.column(name), error) for name, error in errors.items())
    return AsFound(
        instrument=record.instrument,
        date=date,
        session_record=record.id,
        record=None if before is None else before.id,
        record_sha256=None if before is None else before.sha256,
        since=None if before is None else dt.date.fromisoformat(before.date),
        loads=loads,
        reason=reason,
    )


def as_found_findings(as_found: AsFound) -> tuple[Finding, ...]:
    """Return a finding for each load that was out of tolerance, or a note where nothing was compared."""
    if as_found.reason is not None:
        message = f"the as-found session could not be judged: {as_found.reason}"
        level = "note" if as_found.record is None else "warning"
        return (Finding(rule="as-found", where=as_found.session_record, message=message, level=level),)  # type: ignore[arg-type]
    return tuple(
        Finding(
            rule="as-found",
            where=load.load,
            message=f"as found, {as_found.record} is off by {load.max_error:+.4g} {load.unit} in row "
            f"{load.worst_row} ({load.max_percent_fs:.3g} % of full scale), tolerance {load.tolerance:.4g} "
            f"{load.unit}",
        )
        for load in as_found.loads
        if not load.within
    )


def as_found_history(registry: Registry, instrument: str) -> tuple[AsFound, ...]:
    """Return every as-found result of an instrument, oldest first; withdrawn and discarded ones are left out.

    Raises
    ------
    RegistryError, RecordError
        the ledger is damaged, or a record fails a gate
    """
    return tuple(
        as_found(registry, session_record) for session_record in _of_phase(registry, instrument, "as_found")
    )


def as_found_before(registry: Registry, as_left: CalibrationRecord) -> AsFound | None:
    """Return the as-found result that an as-left session belongs to.

    That is the newest as-found session not after it, unless another as-left session lies between.
    """
    day = dt.date.fromisoformat(as_left.date)
    entered = list(registry.ledger(as_left.instrument).entered())
    at = (as_left.date, entered.index(as_left.id) if as_left.id in entered else len(entered))

    def place(record: CalibrationRecord) -> tuple[str, int]:
        return record.date, entered.index(record.id)

    earlier = [o for o in _of_phase(registry, as_left.instrument, "as_found") if place(o) < at]
    settled = [o for o in _of_phase(registry, as_left.instrument, "as_left") if place(o) < at]
    if not earlier or (settled and place(settled[-1]) > place(earlier[-1])):
        return None
    newest = earlier[-1]
    return as_found(registry, newest) if dt.date.fromisoformat(newest.date) <= day else None


def _of_phase(registry: Registry, instrument: str, phase: str) -> list[CalibrationRecord]:
    ledger = registry.ledger(instrument)
    standing = [
        record_id
        for record_id in ledger.entered()
        if not status_of(record_id, ledger.of(record_id), dt.date.max).ended
    ]
    dated = []
    folder = registry.folder / instrument
    records = [record_id for record_id in standing if _may_state(folder, record_id, ledger, phase)]
    for at, record in enumerate(load_many(folder, records, ledger).values()):
        if isinstance(record, ToolkitError):
            raise record
        if phase_of(record) == phase:
            dated.append((record.date, at, record))
    return [record for _, _, record in sorted(dated, key=lambda entry: entry[:2])]


def _may_state(folder: Path, record_id: str, ledger: Ledger, phase: str) -> bool:
    """Tell whether a record has to pass its gates for its phase; no other one is used, and none is refitted.

    What a file says without them counts only where its bytes are those that were entered.
    """
    path = folder / f"{record_id}.json"
    try:
        data = read_regular(path)
        if sha256_bytes(data) != ledger.entered()[record_id].file:
            return True
        return phase_of(from_bytes(data, where=path)) == phase
    except (OSError, ToolkitError):
        return True


def _load(
    record: CalibrationRecord,
    name: str,
    reference: np.ndarray[tuple[int, ...], np.dtype[np.float64]],
    error: np.ndarray[tuple[int, ...], np.dtype[np.float64]],
) -> AsFoundLoad:
    load = record.load(name)
    worst = int(np.abs(error).argmax())
    full = float(np.abs(reference).max())
    return AsFoundLoad(
        load=name,
        unit=load.unit,
        reference=tuple(reference.tolist()),
        error=tuple(error.tolist()),
        tolerance=load.check_tolerance,
        full_scale=full,
        max_error=float(error[worst]),
        max_percent_fs=100 * abs(float(error[worst])) / full,
        worst_row=worst + 1,
    )
