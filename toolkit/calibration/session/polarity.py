"""Polarity readings: one load of known direction, applied apart from the session's rows.

    [[polarity]]
    load = "FY"
    value = { value = 500, unit = "lbf" }          # its sign is the direction
    indications = { D51 = { value = 0.11, unit = "mV/V" }, D52 = { value = 0.12, unit = "mV/V" } }
    zero = { D51 = { value = 0.01, unit = "mV/V" } }   # without load, where it is not zero
    tolerance = 0.2                                # share of the load; default 0.2

They stand in SESSION.toml, or in a file of their own that an approval is given. Every number states its unit:
a bare one would be read in the unit of the very columns that the reading is to confirm.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from toolkit.calibration.session.reading_entries import Scope
from toolkit.calibration.session.settings import wrong
from toolkit.files import check_keys, is_number
from toolkit.machine.quantity import quantity
from toolkit.units import unit

AGREEMENT = 0.2
_LARGEST_AGREEMENT = 0.5  # beyond it a reading of half the size, or of half again, would agree
_KEYS = ("load", "value", "indications", "zero", "tolerance")


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
