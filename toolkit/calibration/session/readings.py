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
from typing import Any

from toolkit.calibration.session.indications import RATIO, RATIO_DIMENSION, Bridge
from toolkit.calibration.session.settings import quantity, wrong
from toolkit.errors import UnitError
from toolkit.files import check_keys, is_number
from toolkit.units import unit

SHUNT_TOLERANCE_PERCENT = 0.1
_ZERO, _CREEP = ("when", "values"), ("load", "seconds", "value")
AGREEMENT = 0.2
_LARGEST_AGREEMENT = 0.5  # beyond it a reading of half the size, or of half again, would agree
_KEYS = ("load", "value", "indications", "zero", "tolerance")


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

    def value(self, name: str, entry: object, key: str) -> float:
        """Return a reading of an indication in the unit of the fit."""
        return self.bridges[name].stated(entry, key, column=self.columns[name], target=self.unit(name))


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


def zero_entries(entries: object, scope: Scope) -> tuple[ZeroEntry, ...]:
    """Read [[zero]].

    Raises
    ------
    ConfigError, UnitError
        an unknown key or cell, a value that is no number, a unit that does not lead to the indication's
    """
    made = []
    for at, entry in enumerate(_tables(entries, "zero", _ZERO, scope), start=1):
        place = f"zero {at}"
        when = entry.get("when")
        if not isinstance(when, str) or not when.strip():
            raise wrong(scope.where, f"{place}.when", when, 'a text: "before", "after", "run 1", "shunt"')
        values = _values(entry.get("values"), f"{place}.values", scope)
        if not values:
            expected = f"{{ {scope.indications[0]} = number }}, or a list of {len(scope.indications)} numbers"
            raise wrong(scope.where, f"{place}.values", entry.get("values"), expected)
        made.append(ZeroEntry(when=when.strip(), values=values))
    return tuple(made)


def creep_entries(entries: object, scope: Scope) -> tuple[CreepEntry, ...]:
    """Read [[creep]].

    Raises
    ------
    ConfigError, UnitError
        as `zero_entries`; an unknown load, seconds below zero, two readings of one moment
    """
    made: list[CreepEntry] = []
    times = set()
    for at, entry in enumerate(_tables(entries, "creep", _CREEP, scope), start=1):
        place = f"creep {at}"
        load, unloaded = _load(entry.get("load"), f"{place}.load", scope)
        seconds = entry.get("seconds")
        if isinstance(seconds, dict):
            seconds = quantity(seconds, "time", f"{scope.where}: {place}.seconds")
        if not is_number(seconds) or not seconds >= 0:
            raise wrong(scope.where, f"{place}.seconds", entry.get("seconds"), "seconds, zero or more")
        if entry.get("value") is None:
            raise wrong(scope.where, f"{place}.value", None, f"{{ {scope.indications[0]} = number }}")
        applied = _shown(entry["value"], entry.get("load"), f"{place}.value", scope)
        values = () if applied else _values(entry["value"], f"{place}.value", scope)
        for name, _ in (*values, *([applied] if applied else ())):
            if (load, name, float(seconds)) in times:
                raise wrong(scope.where, f"{place}.seconds", seconds, f"one reading of {name} at a time")
            times.add((load, name, float(seconds)))
        made.append(
            CreepEntry(load=load, unloaded=unloaded, seconds=float(seconds), values=values, shown=applied)
        )
    return tuple(made)


def shunt_entry(name: str, cell: Mapping[str, Any], scope: Scope) -> ShuntEntry | None:
    """Read the shunt of ``[cells.NAME]``; None where none is expected.

    The step is told as the bridge's output (mV/V) also where the column is scaled to a force; the measured
    one must then be told so too.

    Raises
    ------
    ConfigError, UnitError
        no finite number, an expected step of zero, a measured one or a tolerance without an expected one
    """
    key = f"cells.{name}.shunt_expected"
    if "shunt_expected" not in cell:
        if lone := sorted({"shunt_measured", "shunt_tolerance"} & set(cell)):
            raise wrong(scope.where, key, None, f"the step that {lone[0]} is held against")
        return None
    bridge, column, text = scope.bridges[name], scope.columns[name], scope.unit(name)
    entry = cell["shunt_expected"]
    try:
        expected = bridge.stated(entry, key, column=column, target=text)
    except UnitError:
        if unit(entry["unit"], where=f"{scope.where}: {key}").dimension != RATIO_DIMENSION:
            raise
        text = RATIO
        expected = bridge.stated(entry, key, column=column, target=text)
    if expected == 0:
        raise wrong(scope.where, key, entry, "a step that is not zero")
    measured = None
    if "shunt_measured" in cell:
        measured = bridge.stated(
            cell["shunt_measured"], f"cells.{name}.shunt_measured", column=column, target=text
        )
    tolerance = cell.get("shunt_tolerance", SHUNT_TOLERANCE_PERCENT)
    if isinstance(tolerance, dict):
        tolerance = 100 * quantity(tolerance, "ratio", f"{scope.where}: cells.{name}.shunt_tolerance")
    if not is_number(tolerance) or not tolerance > 0:
        raise wrong(scope.where, f"cells.{name}.shunt_tolerance", tolerance, "per cent, above zero")
    return ShuntEntry(
        name=name, unit=text, expected=expected, measured=measured, tolerance_percent=float(tolerance)
    )


def _tables(entries: object, key: str, keys: Sequence[str], scope: Scope) -> list[dict[str, Any]]:
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise wrong(scope.where, key, entries, f"tables [[{key}]] with {', '.join(keys)}")
    return entries


def _values(entry: object, key: str, scope: Scope) -> tuple[tuple[str, float], ...]:
    names = scope.indications
    if isinstance(entry, dict) and not {"value", "unit"} & set(entry):
        check_keys(entry, names, where=f"{scope.where}: {key}")
        by_name = {name: entry[name] for name in names if name in entry}
    elif isinstance(entry, list):
        if len(entry) != len(names):
            raise wrong(
                scope.where, key, f"{len(entry)} values", f"one value each of {', '.join(names)}, in order"
            )
        by_name = dict(zip(names, entry, strict=True))
    elif entry is None or len(names) > 1:
        return ()
    else:
        by_name = {names[0]: entry}
    return tuple((name, scope.value(name, reading, f"{key}.{name}")) for name, reading in by_name.items())


def _shown(value: object, load: object, key: str, scope: Scope) -> tuple[str, float] | None:
    name = load if isinstance(load, str) else next(iter(scope.loads)) if len(scope.loads) == 1 else None
    if name is None or name not in scope.loads:
        return None
    found = unit(scope.loads[name])
    if isinstance(value, dict) and isinstance(value.get("unit"), str):
        # A force that the indication itself is in stays a reading of the indication.
        told = unit(value["unit"], where=f"{scope.where}: {key}").dimension
        if told != found.dimension or told in {
            unit(scope.unit(indication)).dimension for indication in scope.indications
        }:
            return None
        value = quantity(value, told, f"{scope.where}: {key}") / found.factor
    elif isinstance(value, dict | list) or len(scope.indications) == 1:
        return None
    if not is_number(value):
        raise wrong(scope.where, key, value, "a finite number")
    return name, float(value)


def _load(entry: object, key: str, scope: Scope) -> tuple[str, bool]:
    if isinstance(entry, str) and entry in scope.loads:
        return entry, False
    value, text = entry, next(iter(scope.loads.values())) if len(scope.loads) == 1 else None
    if isinstance(entry, dict):
        dimensions = {unit(load).dimension for load in scope.loads.values()}
        text = entry.get("unit")
        dimension = unit(text, where=f"{scope.where}: {key}").dimension if isinstance(text, str) else ""
        if dimension not in dimensions:
            # Says what is wrong: no unit, no number, or a unit of none of the loads.
            quantity(entry, sorted(dimensions)[0], f"{scope.where}: {key}")
        value = entry.get("value")
    if not is_number(value):
        expected = f"{', '.join(scope.loads)}, a number, or {{ value, unit }}"
        raise wrong(scope.where, key, entry, expected)
    return f"{value:.12g}" + ("" if text is None else f" {text}"), value == 0


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


def polarity_readings(entries: object, scope: Scope) -> tuple[PolarityReading, ...]:
    """Read [[polarity]] against a session's or a record's units.

    Raises
    ------
    ConfigError, UnitError
        an unknown key, load or indication, an indication without a reading, a number without a unit or in
        one that does not lead to the fit's
    """
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise wrong(scope.where, "polarity", entries, "tables [[polarity]] with load, value, indications")
    return tuple(_reading(entry, f"polarity {at}", scope) for at, entry in enumerate(entries, start=1))


def _reading(entry: dict[str, Any], place: str, scope: Scope) -> PolarityReading:
    check_keys(entry, _KEYS, where=f"{scope.where}: {place}")
    load = entry.get("load")
    if not isinstance(load, str) or load not in scope.loads:
        raise wrong(scope.where, f"{place}.load", load, ", ".join(scope.loads))
    text = scope.loads[load]
    stated = unit(text)
    value = (
        quantity(entry.get("value", {}), stated.dimension, f"{scope.where}: {place}.value") / stated.factor
    )
    if not is_number(value) or value == 0:
        raise wrong(scope.where, f"{place}.value", entry.get("value"), "a load that is not zero")
    indications = _indications(entry.get("indications"), f"{place}.indications", scope)
    lacking = [name for name in scope.indications if name not in dict(indications)]
    if lacking:
        expected = f"a reading of every indication: {', '.join(lacking)} too"
        raise wrong(scope.where, f"{place}.indications", ", ".join(dict(indications)), expected)
    tolerance = entry.get("tolerance", AGREEMENT)
    if not is_number(tolerance) or not 0 < tolerance <= _LARGEST_AGREEMENT:
        expected = f"a share of the load above 0 and up to {_LARGEST_AGREEMENT:g}"
        raise wrong(scope.where, f"{place}.tolerance", tolerance, expected)
    zero = _indications(entry["zero"], f"{place}.zero", scope) if "zero" in entry else ()
    return PolarityReading(
        load=load,
        value=float(value),
        unit=text,
        indications=indications,
        zero=zero,
        tolerance=float(tolerance),
        place=f"{scope.where}: {place}",
    )


def _indications(entry: object, key: str, scope: Scope) -> tuple[tuple[str, float], ...]:
    example = f'{{ {scope.indications[0]} = {{ value = 0.1, unit = "mV/V" }} }}'
    if not isinstance(entry, dict):
        raise wrong(scope.where, key, entry, example)
    check_keys(entry, scope.indications, where=f"{scope.where}: {key}")
    for name, reading in entry.items():
        if not isinstance(reading, dict):
            raise wrong(scope.where, f"{key}.{name}", reading, f"a number with its unit: {example}")
    return tuple(
        (name, scope.value(name, entry[name], f"{key}.{name}")) for name in scope.indications if name in entry
    )
