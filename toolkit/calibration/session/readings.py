"""Readings of a session apart from its rows: zero, shunt, creep, polarity; entries -> the units of the fit.

    [[zero]]                              [[creep]]
    when = "before"                       load = "FY"          # a load's name (its largest), a number,
    values = { D51 = 12, D52 = -8 }       seconds = 30         # or { value, unit }; 0 after unloading
                                          value = { D51 = 83012 }

    [cells.D51]
    shunt_expected = { value = 1.0021, unit = "mV/V" }   # the step that the shunt makes
    shunt_measured = 102100                              # the step that was read
    shunt_tolerance = 0.1                                # per cent

    [[polarity]]                                         # one load of known direction
    load = "FY"
    value = { value = 500, unit = "lbf" }                # its sign is the direction
    indications = { D51 = { value = 0.11, unit = "mV/V" }, D52 = { value = 0.12, unit = "mV/V" } }
    zero = { D51 = { value = 0.01, unit = "mV/V" } }     # without load, where it is not zero
    tolerance = 0.2                                      # share of the load; default 0.2

A bare number is in the column's own unit. ``values`` may be a list in the order of the indications, or one
number where there is one indication. A [[zero]] whose ``when`` begins with "shunt" was read with the shunt
connected. A creep reading in a load's unit, or a bare number where several indications leave no other
reading, is what an indicator showed of the load that ``load`` names.

Polarity readings stand in SESSION.toml, or in a file of their own that an approval is given. Every number in
them states its unit: a bare one would be read in the unit of the very columns that the reading is to confirm.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from toolkit.calibration.session.indications import RATIO, RATIO_DIMENSION, Bridge, bridges_of
from toolkit.calibration.session.session_file import (
    Amount,
    CellEntries,
    Creep,
    Polarity,
    Reading,
    Stated,
    StatedEntries,
)
from toolkit.calibration.session.settings import wrong
from toolkit.declared import Quantity
from toolkit.errors import UnitError
from toolkit.files import check_keys
from toolkit.units import unit

Readings = Mapping[str, Stated] | tuple[Stated, ...] | Stated

SHUNT_TOLERANCE_PERCENT = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Scope:
    """What the entries are read against: bridges and the columns' units by indication, loads' units."""

    bridges: Mapping[str, Bridge]
    columns: Mapping[str, str]
    loads: Mapping[str, str]
    where: object

    @property
    def indications(self) -> tuple[str, ...]:
        """Names of the indications, in order."""
        return tuple(self.bridges)

    def unit(self, name: str) -> str:
        """Return the unit in which an indication is fitted."""
        return self.bridges[name].unit(self.columns[name])

    def value(self, name: str, entry: Stated, key: str) -> float:
        """Return a reading of an indication in the unit of the fit."""
        return self.bridges[name].stated(entry, key, column=self.columns[name], target=self.unit(name))


def scope_of_entries(
    entries: StatedEntries, *, columns: Mapping[str, str], loads: Mapping[str, str], where: object
) -> Scope:
    """Return what a session's entries are read against; units of columns and loads by name."""
    return Scope(
        bridges=bridges_of(entries, tuple(columns), where=where), columns=columns, loads=loads, where=where
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ZeroEntry:
    """Indications without load, by name, in the unit of the fit."""

    when: str
    values: tuple[tuple[str, float], ...]

    @property
    def shunt(self) -> bool:
        """Whether the shunt was connected."""
        return self.when.casefold().startswith("shunt")


@dataclass(frozen=True, slots=True, kw_only=True)
class CreepEntry:
    """Indications ``seconds`` after a load (``load`` as text) was applied, or taken off (``unloaded``).

    ``shown`` is a reading of the load itself, as (load, number in its unit). ``values`` is empty then, and
    both are empty where it cannot be said of what the number is a reading.
    """

    load: str
    unloaded: bool
    seconds: float
    values: tuple[tuple[str, float], ...]
    shown: tuple[str, float] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ShuntEntry:
    """A cell's shunt step: ``expected`` and ``measured`` in ``unit``; tolerance in % of the expected one."""

    name: str
    unit: str
    expected: float
    measured: float | None
    tolerance_percent: float


def zero_entries(entries: Sequence[Reading], scope: Scope) -> tuple[ZeroEntry, ...]:
    """Return the readings of [[zero]] in the units of the fit.

    Raises
    ------
    ConfigError, UnitError
        not a reading of each indication, a unit that does not lead to the indication's
    """
    zeros = []
    for at, entry in enumerate(entries, start=1):
        values = _values(entry.values, f"zero[{at}].values", scope)
        if not values:
            expected = f"{{ {scope.indications[0]} = number }}, or a list of {len(scope.indications)} numbers"
            raise wrong(scope.where, f"zero[{at}].values", entry.values, expected)
        zeros.append(ZeroEntry(when=entry.when.strip(), values=values))
    return tuple(zeros)


def creep_entries(entries: Sequence[Creep], scope: Scope) -> tuple[CreepEntry, ...]:
    """Return the readings of [[creep]] in the units of the fit.

    Raises
    ------
    ConfigError, UnitError
        as `zero_entries`; an unknown load, two readings of one moment
    """
    readings: list[CreepEntry] = []
    times = set()
    for at, entry in enumerate(entries, start=1):
        place, seconds = f"creep[{at}]", float(entry.seconds)
        load, unloaded = _load(entry.load, f"{place}.load", scope)
        load_reading = _load_reading(entry.value, entry.load, f"{place}.value", scope)
        values = () if load_reading else _values(entry.value, f"{place}.value", scope)
        for name, _ in (*values, *([load_reading] if load_reading else ())):
            if (load, name, seconds) in times:
                raise wrong(
                    scope.where, f"{place}.seconds", f"{seconds:g}", f"one reading of {name} at a time"
                )
            times.add((load, name, seconds))
        readings.append(
            CreepEntry(load=load, unloaded=unloaded, seconds=seconds, values=values, shown=load_reading)
        )
    return tuple(readings)


def shunt_entry(name: str, cell: CellEntries, scope: Scope) -> ShuntEntry | None:
    """Return the shunt of ``[cells.NAME]``; None where none is expected.

    The step is told as the bridge's output (mV/V) also where the column is scaled to a force; the measured
    one must then be told so too.

    Raises
    ------
    UnitError
    """
    entry = cell.shunt_expected
    if entry is None:
        return None
    bridge, column, text = scope.bridges[name], scope.columns[name], scope.unit(name)
    key = f"cells.{name}.shunt_expected"
    try:
        expected = bridge.stated(entry, key, column=column, target=text)
    except UnitError:
        stated = unit(entry.unit if isinstance(entry, Amount) else column, where=f"{scope.where}: {key}")
        if stated.dimension != RATIO_DIMENSION:
            raise
        text = RATIO
        expected = bridge.stated(entry, key, column=column, target=text)
    measured = None
    if cell.shunt_measured is not None:
        measured = bridge.stated(
            cell.shunt_measured, f"cells.{name}.shunt_measured", column=column, target=text
        )
    tolerance = cell.shunt_tolerance
    if tolerance is None:
        percent = SHUNT_TOLERANCE_PERCENT
    elif isinstance(tolerance, Quantity) and tolerance.unit == "%":
        percent = float(tolerance.value)
    else:
        percent = 100 * tolerance
    return ShuntEntry(name=name, unit=text, expected=expected, measured=measured, tolerance_percent=percent)


def _values(entry: Readings, key: str, scope: Scope) -> tuple[tuple[str, float], ...]:
    names = scope.indications
    by_name: Mapping[str, Stated]
    if isinstance(entry, Mapping):
        by_name = {name: entry[name] for name in names if name in entry}
    elif isinstance(entry, tuple):
        if len(entry) != len(names):
            expected = f"one value each of {', '.join(names)}, in order"
            raise wrong(scope.where, key, f"{len(entry)} values", expected)
        by_name = dict(zip(names, entry, strict=True))
    elif len(names) > 1:
        return ()
    else:
        by_name = {names[0]: entry}
    return tuple((name, scope.value(name, reading, f"{key}.{name}")) for name, reading in by_name.items())


def _load_reading(value: Readings, load: str | Stated, key: str, scope: Scope) -> tuple[str, float] | None:
    name = load if isinstance(load, str) else next(iter(scope.loads)) if len(scope.loads) == 1 else None
    if name is None or name not in scope.loads:
        return None
    if isinstance(value, Amount):
        # A force that the indication itself is in stays a reading of the indication.
        stated = unit(value.unit, where=f"{scope.where}: {key}").dimension
        scale = unit(scope.loads[name])
        if stated != scale.dimension or stated in {
            unit(scope.unit(indication)).dimension for indication in scope.indications
        }:
            return None
        return name, value.si(stated, f"{scope.where}: {key}") / scale.factor
    if isinstance(value, Mapping | tuple) or len(scope.indications) == 1:
        return None
    return name, value


def _load(entry: str | Stated, key: str, scope: Scope) -> tuple[str, bool]:
    if isinstance(entry, str):
        if entry in scope.loads:
            return entry, False
        raise wrong(scope.where, key, entry, f"{', '.join(scope.loads)}, a number, or {{ value, unit }}")
    if isinstance(entry, Amount):
        dimensions = {unit(load).dimension for load in scope.loads.values()}
        place = f"{scope.where}: {key}"
        if unit(entry.unit, where=place).dimension not in dimensions:
            entry.si(min(dimensions), place)  # which refuses it
        return f"{entry.value:.12g} {entry.unit}", entry.value == 0
    text = f" {next(iter(scope.loads.values()))}" if len(scope.loads) == 1 else ""
    return f"{entry:.12g}{text}", entry == 0


@dataclass(frozen=True, slots=True, kw_only=True)
class PolarityReading:
    """One reading: ``value`` in the load's unit of the fit, ``indications`` and ``zero`` in the cells'.

    ``zero`` is empty where none is stated. ``tolerance`` is a share of ``value``.
    """

    load: str
    value: float
    unit: str
    indications: tuple[tuple[str, float], ...]
    zero: tuple[tuple[str, float], ...]
    tolerance: float
    place: str


def polarity_readings(entries: Sequence[Polarity], scope: Scope) -> tuple[PolarityReading, ...]:
    """Return the readings of [[polarity]] in a session's or a record's units.

    Raises
    ------
    ConfigError, UnitError
        an unknown load, an indication without a reading, a unit that does not lead to the fit's
    """
    return tuple(_reading(entry, f"polarity[{at}]", scope) for at, entry in enumerate(entries, start=1))


def _reading(entry: Polarity, place: str, scope: Scope) -> PolarityReading:
    if entry.load not in scope.loads:
        raise wrong(scope.where, f"{place}.load", entry.load, ", ".join(scope.loads))
    text = scope.loads[entry.load]
    stated = unit(text)
    value = entry.value.si(stated.dimension, f"{scope.where}: {place}.value") / stated.factor
    indications = _indications(entry.indications, f"{place}.indications", scope)
    lacking = [name for name in scope.indications if name not in dict(indications)]
    if lacking:
        expected = f"a reading of every indication: {', '.join(lacking)} too"
        raise wrong(scope.where, f"{place}.indications", ", ".join(dict(indications)), expected)
    return PolarityReading(
        load=entry.load,
        value=value,
        unit=text,
        indications=indications,
        zero=_indications(entry.zero, f"{place}.zero", scope),
        tolerance=entry.tolerance,
        place=f"{scope.where}: {place}",
    )


def _indications(
    entries: Sequence[tuple[str, Amount]], key: str, scope: Scope
) -> tuple[tuple[str, float], ...]:
    stated = dict(entries)
    check_keys(stated, scope.indications, where=f"{scope.where}: {key}")
    return tuple(
        (name, scope.value(name, stated[name], f"{key}.{name}"))
        for name in scope.indications
        if name in stated
    )
