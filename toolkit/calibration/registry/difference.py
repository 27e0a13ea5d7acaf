"""What changes from one record to another: each coefficient, and what it moves in the load."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from toolkit.calibration.terms import evaluate, parse_term

if TYPE_CHECKING:
    from toolkit.calibration.records.record import CalibrationRecord, LoadFit


@dataclass(frozen=True, slots=True, kw_only=True)
class TermDifference:
    """One term of one load: its coefficients (None where a record has no such term).

    ``change`` is other - one; None where a term is missing or the units differ, so that a difference would
    mean nothing. ``effect`` is the largest load [unit] that the change moves over the indications' range,
    and ``effect_percent_fs`` the same in percent of the largest load; None where neither record has a range.
    """

    load: str
    term: str
    unit: str
    one: float | None
    other: float | None
    change: float | None
    effect: float | None
    effect_percent_fs: float | None
    differs: bool


def differences(one: CalibrationRecord, other: CalibrationRecord) -> tuple[TermDifference, ...]:
    """Compare two records term by term, in the order of the first."""
    found: list[TermDifference] = []
    names = dict.fromkeys(load.load for record in (one, other) for load in record.loads)
    for name in names:
        a, b = _load(one, name), _load(other, name)
        before, after = _coefficients(a), _coefficients(b)
        unit = " against ".join(dict.fromkeys(load.unit for load in (a, b) if load is not None))
        largest = max((x.largest for x in (a, b) if x is not None and x.largest > 0), default=math.nan)
        for term in dict.fromkeys([*before, *after]):
            first, second = before.get(term), after.get(term)
            comparable = (
                a is not None and b is not None and a.unit == b.unit and _same_units(one, other, term)
            )
            change = None if first is None or second is None or not comparable else second - first
            extent = _extent(term, one, other)
            effect = None if change is None or extent is None else abs(change) * extent
            found.append(
                TermDifference(
                    load=name,
                    term=term,
                    unit=unit,
                    one=first,
                    other=second,
                    change=change,
                    effect=effect,
                    effect_percent_fs=None
                    if effect is None or math.isnan(largest)
                    else 100 * effect / largest,
                    differs=first != second or not comparable,
                )
            )
    return tuple(found)


def _load(record: CalibrationRecord, name: str) -> LoadFit | None:
    return next((load for load in record.loads if load.load == name), None)


def _coefficients(load: LoadFit | None) -> dict[str, float]:
    return {} if load is None else dict(zip(load.terms, load.coefficients, strict=True))


def _indications(term: str) -> set[str]:
    parsed = parse_term(term)
    return {name for name, _ in parsed.powers} | set(parsed.absolutes)


def _same_units(one: CalibrationRecord, other: CalibrationRecord, term: str) -> bool:
    units = [{cell.name: cell.unit for cell in record.cells} for record in (one, other)]
    return all(units[0].get(name) == units[1].get(name) for name in _indications(term))


def _extent(term: str, *records: CalibrationRecord) -> float | None:
    """Return the largest absolute value of a term over the ranges of both records."""
    ranges: dict[str, float] = {}
    for record in records:
        for cell in record.cells:
            if cell.minimum is not None and cell.maximum is not None:
                ranges[cell.name] = max(ranges.get(cell.name, 0.0), abs(cell.minimum), abs(cell.maximum))
    if not _indications(term) <= ranges.keys():
        return None
    return float(evaluate(parse_term(term), ranges, 1.0))
