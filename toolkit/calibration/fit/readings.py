"""What a session's own readings say of the instrument: zero, shunt, creep, reversibility.

Everything follows from a record and its reference loads, so that a certificate or a budget of ten years ago
is made from what is stored. Full scale of an indication is its largest deflection in the fitted data, X_N
of ISO 376; full scale of a load is its largest reference load.

- zero: after minus before, and what it is worth as a load (ISO 376 f0 relates it to X_N);
- shunt: the step that a resistor across one arm makes, against the expected one. The step is the reading
  with the shunt minus the last zero before it (as wind-tunnel balance laboratories do it);
- creep c: change between 30 s and 300 s after loading or unloading, over X_N (ISO 376);
- reversibility: mean error going up minus mean error going down, at equal reference loads of one run, so
  that a reference load that is not quite the same twice does not count.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.session.readings import (
    SHUNT_TOLERANCE_PERCENT,
    CreepEntry,
    Scope,
    ZeroEntry,
    shunt_entry,
)
from toolkit.calibration.session.statements import statements_of
from toolkit.units import unit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.calibration.records.record import CalibrationRecord, LoadFit
    from toolkit.calibration.session.session_file import StatedEntries
    from toolkit.calibration.session.table import Table

CREEP_FROM_S, CREEP_TO_S = 30.0, 300.0
# Metal foil bridges give 1 to 4 mV/V at capacity, semiconductor bridges some ten times that.
LARGEST_RATIO_MV_V = {"foil": 10.0, "semiconductor": 100.0}
SAME_LOAD = 2e-3  # of full scale: reference loads that are called equal
_NO_LOAD = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class ZeroDrift:
    """An indication's zero, ``after`` minus ``before`` (the entries' words), in its unit."""

    name: str
    unit: str
    before: str
    after: str
    drift: float
    percent_fs: float


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadDrift:
    """What the drifts of the indications in ``cells`` are worth together, in the load's unit.

    ``tolerance`` is that of the check loads; an indication without readings counts as not moved.
    """

    load: str
    unit: str
    cells: tuple[str, ...]
    drift: float
    percent_fs: float
    tolerance: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ShuntCheck:
    """A shunt step. ``difference_percent`` of the expected one; None where nothing can be compared.

    ``source`` is the entry that was read; ``zero`` the reading that was subtracted, None where there was
    none or the step itself was stated.
    """

    name: str
    unit: str
    source: str
    measured: float
    zero: float | None
    expected: float | None
    difference_percent: float | None
    tolerance_percent: float

    @property
    def within(self) -> bool | None:
        """Whether the step is inside its tolerance; None where nothing can be compared."""
        difference = self.difference_percent
        return None if difference is None else abs(difference) <= self.tolerance_percent


@dataclass(frozen=True, slots=True, kw_only=True)
class Creep:
    """Change of an indication (or of a load that an indicator showed) from ``from_s`` to ``to_s`` [s].

    ``percent_fs`` is its absolute value in % of full scale; ``unloaded``: recovery after the load was
    taken off.
    """

    of: str
    unit: str
    load: str
    unloaded: bool
    from_s: float
    to_s: float
    change: float
    percent_fs: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Reversibility:
    """Up minus down at ``pairs`` equal reference loads: largest absolute and RMS, in the load's unit."""

    load: str
    unit: str
    pairs: int
    worst: float
    rms: float
    worst_percent_fs: float
    rms_percent_fs: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionReadings:
    """A session's readings. ``full_scale`` is X_N by indication, in its unit.

    ``largest_ratio`` is the largest |output| [mV/V] by indication that is one, with the largest that its
    bridge can give; ``unscaled`` are indications in counts with a scale that has no unit; ``creep_left_out``
    are loads whose creep readings give nothing.
    """

    full_scale: tuple[tuple[str, float], ...]
    zero: tuple[ZeroDrift, ...]
    zero_loads: tuple[LoadDrift, ...]
    shunts: tuple[ShuntCheck, ...]
    creep: tuple[Creep, ...]
    creep_left_out: tuple[str, ...]
    reversibility: tuple[Reversibility, ...]
    temperature_C: float | None
    largest_ratio: tuple[tuple[str, float, float], ...]
    unscaled: tuple[str, ...]


def readings_of(record: CalibrationRecord, loads: Table) -> SessionReadings:
    """Evaluate the readings of a record's session; ``loads`` are its reference loads in its units.

    Raises
    ------
    ConfigError, UnitError
        an entry of a record made before they were checked cannot be read
    """
    statements = statements_of(record)
    scope, entries, zero = statements.scope, statements.entries, statements.zero
    at_rest = _unloaded(record, loads)
    columns = loads.columns(record.indications)
    full = {name: float(np.abs(columns[name] - at_rest[name]).max()) for name in record.indications}
    drifts = _zero_drifts(zero, scope, full)
    series, left_out = _creeps(
        statements.creep, scope, full, {load.load: load.largest for load in record.loads}
    )
    return SessionReadings(
        full_scale=tuple(full.items()),
        zero=drifts,
        zero_loads=tuple(_load_drift(record, load, drifts, zero, at_rest) for load in record.loads if drifts),
        shunts=tuple(_shunts(zero, entries, scope)),
        creep=series,
        creep_left_out=left_out,
        reversibility=_reversibility(record, loads),
        temperature_C=statements.temperature_C,
        largest_ratio=tuple(
            (
                name,
                1e3 * unit(text).factor * float(np.abs(columns[name]).max()),
                LARGEST_RATIO_MV_V[entries.cell(name).bridge or "foil"],
            )
            for name, text in zip(record.indications, record.indication_units, strict=True)
            if unit(text).dimension == "bridge_ratio"
        ),
        unscaled=tuple(
            name
            for name, text in scope.columns.items()
            if isinstance(entries.cell(name).scale, float) and unit(text).dimension == "count"
        ),
    )


def readings_json(readings: SessionReadings) -> dict[str, Any]:
    """Return the readings as JSON values, by indication and load."""

    def by_name(parts: Iterable[Any], key: str) -> dict[str, Any]:
        entries = [dataclasses.asdict(part) for part in parts]
        return {entry.pop(key): entry for entry in entries}

    return {
        "full_scale": dict(readings.full_scale),
        "zero": by_name(readings.zero, "name"),
        "zero_loads": by_name(readings.zero_loads, "load"),
        "shunt": [{**dataclasses.asdict(shunt), "within": shunt.within} for shunt in readings.shunts],
        "creep": [dataclasses.asdict(series) for series in readings.creep],
        "reversibility": by_name(readings.reversibility, "load"),
        "temperature_C": readings.temperature_C,
    }


def _unloaded(record: CalibrationRecord, table: Table) -> dict[str, float]:
    """Return each indication without load: the mean of the unloaded rows, else by a line through all rows."""
    matrix = table.matrix([load.load for load in record.loads])
    cells = table.matrix(record.indications)
    idle = (np.abs(matrix) <= _NO_LOAD * np.abs(matrix).max(axis=0)).all(axis=1)
    if idle.any():
        values = cells[idle].mean(axis=0)
    else:
        scaled = matrix / np.abs(matrix).max(axis=0)
        values = np.linalg.lstsq(np.column_stack([np.ones(len(cells)), scaled]), cells, rcond=None)[0][0]
    return dict(zip(record.indications, values.tolist(), strict=True))


def _zero_drifts(zero: tuple[ZeroEntry, ...], scope: Scope, full: dict[str, float]) -> tuple[ZeroDrift, ...]:
    zero_drifts = []
    for name in scope.indications:
        stated = [
            (entry.when, dict(entry.values)[name])
            for entry in zero
            if not entry.shunt and name in dict(entry.values)
        ]
        if len(stated) < 2:
            continue
        moments = [when.casefold() for when, _ in stated]
        first = next((i for i, text in enumerate(moments) if text.startswith("before")), 0)
        last = max((i for i, text in enumerate(moments) if text.startswith("after")), default=len(stated) - 1)
        drift = stated[last][1] - stated[first][1]
        zero_drifts.append(
            ZeroDrift(
                name=name, unit=scope.unit(name), before=stated[first][0], after=stated[last][0], drift=drift,
                percent_fs=100 * drift / full[name],
            )
        )  # fmt: skip
    return tuple(zero_drifts)


def _load_drift(
    record: CalibrationRecord,
    load: LoadFit,
    drifts: tuple[ZeroDrift, ...],
    zero: tuple[ZeroEntry, ...],
    at_rest: dict[str, float],
) -> LoadDrift:
    start = dict(at_rest)
    for entry in reversed(zero):
        start |= {} if entry.shunt else dict(entry.values)
    moved = start | {drift.name: start[drift.name] + drift.drift for drift in drifts}
    points = {name: np.array([start[name], moved[name]]) for name in record.indications}
    before, after = load.at(points).tolist()
    tolerance = load.check_tolerance
    return LoadDrift(
        load=load.load, unit=load.unit, cells=tuple(drift.name for drift in drifts), drift=after - before,
        percent_fs=100 * (after - before) / load.largest, tolerance=tolerance,
    )  # fmt: skip


def _shunts(zero: tuple[ZeroEntry, ...], entries: StatedEntries, scope: Scope) -> Iterable[ShuntCheck]:
    for name in scope.indications:
        stated = shunt_entry(name, entries.cell(name), scope)
        if stated is not None and stated.measured is not None:
            yield _shunt_check(name, stated.unit, "shunt_measured", stated.measured, None, stated)
        last: float | None = None
        for entry in zero:
            reading = dict(entry.values).get(name)
            if reading is None:
                continue
            if not entry.shunt:
                last = reading
                continue
            yield _shunt_check(name, scope.unit(name), entry.when, reading - (last or 0.0), last, stated)


def _shunt_check(
    name: str, text: str, source: str, measured: float, zero: float | None, stated: Any
) -> ShuntCheck:
    # A reading in newtons says nothing of a step that is told in mV/V.
    comparable = stated is not None and stated.unit == text
    return ShuntCheck(
        name=name,
        unit=text,
        source=source,
        measured=measured,
        zero=zero,
        expected=stated.expected if comparable else None,
        difference_percent=100 * (measured / stated.expected - 1) if comparable else None,
        tolerance_percent=SHUNT_TOLERANCE_PERCENT if stated is None else stated.tolerance_percent,
    )


def _creeps(
    entries: tuple[CreepEntry, ...], scope: Scope, full: dict[str, float], largest: dict[str, float]
) -> tuple[tuple[Creep, ...], tuple[str, ...]]:
    series: dict[tuple[str, str, bool], dict[float, float]] = {}
    evaluated: dict[str, bool] = {}
    for entry in entries:
        evaluated.setdefault(entry.load, False)
        for name, value in (*entry.values, *([entry.shown] if entry.shown else ())):
            series.setdefault((entry.load, name, entry.unloaded), {})[entry.seconds] = value
    creeps = []
    for (load, name, unloaded), values in series.items():
        if len(values) < 2:
            continue
        standard = CREEP_FROM_S in values and CREEP_TO_S in values
        first, last = (CREEP_FROM_S, CREEP_TO_S) if standard else (min(values), max(values))
        change, of_load = values[last] - values[first], name in largest
        creeps.append(
            Creep(
                of=name, unit=scope.loads[name] if of_load else scope.unit(name), load=load,
                unloaded=unloaded, from_s=first, to_s=last, change=change,
                percent_fs=100 * abs(change) / (largest[name] if of_load else full[name]),
            )
        )  # fmt: skip
        evaluated[load] = True
    return tuple(creeps), tuple(load for load, is_evaluated in evaluated.items() if not is_evaluated)


def _reversibility(record: CalibrationRecord, table: Table) -> tuple[Reversibility, ...]:
    if table.run is None or table.up is None:
        return ()
    up = table.up
    names = [load.load for load in record.loads]
    matrix = table.matrix(names)
    largest = np.abs(matrix).max(axis=0)
    loaded = (np.abs(matrix) > SAME_LOAD * largest).any(axis=1)
    if not (up & loaded).any() or not (~up & loaded).any():
        return ()
    _, key = np.unique(table.run[loaded], return_inverse=True)
    for column, full in zip(matrix[loaded].T, largest, strict=True):
        levels = _levels(column, SAME_LOAD * full)
        # Brought back to few numbers at each step, so that the key stays far from its largest value.
        _, key = np.unique(key * (int(levels.max()) + 1) + levels, return_inverse=True)
    rises = up[loaded]
    ups, downs = (np.bincount(key[direction], minlength=int(key.max()) + 1) for direction in (rises, ~rises))
    paired = (ups > 0) & (downs > 0)
    if not paired.any():
        return ()
    columns = table.columns(record.indications)
    reversals = []
    for load, full in zip(record.loads, largest.tolist(), strict=True):
        error = (load.at(columns) - table.column(load.load))[loaded]
        mean_up, mean_down = (
            np.bincount(key[direction], weights=error[direction], minlength=len(ups))[paired] / count[paired]
            for direction, count in ((rises, ups), (~rises, downs))
        )
        apart = mean_up - mean_down
        worst, rms = float(np.abs(apart).max()), float(np.sqrt(np.mean(apart**2)))
        reversals.append(
            Reversibility(
                load=load.load, unit=load.unit, pairs=int(paired.sum()), worst=worst, rms=rms,
                worst_percent_fs=100 * worst / full, rms_percent_fs=100 * rms / full,
            )
        )  # fmt: skip
    return tuple(reversals)


def _levels(values: Array, within: float) -> NDArray[np.int64]:
    """Return which level each load belongs to: loads nearer than ``within`` are one, unless they chain."""
    order = np.argsort(values, kind="stable")
    steps = np.cumsum(np.diff(values[order], prepend=values[order[0]]) > within)
    starts = np.searchsorted(steps, np.arange(steps[-1] + 1))
    ends = np.append(starts[1:], len(values)) - 1
    if (values[order][ends] - values[order][starts] > within).any():
        return np.unique(values, return_inverse=True)[1].astype(np.int64)
    numbers = np.empty(len(values), dtype=np.int64)
    numbers[order] = steps
    return numbers
