"""The physics of a record: how a load answers to an indication, in SI, whatever units were written.

A response is d load / d indication, [N or N*m] per [V/V] (or count, N, ...). Records in other units, and with
other models, are compared by it: of a model with higher terms it is the secant over a range.

The difference of two records is each coefficient, and what it moves in the load. Records in other units are
compared as they are in SI: the change is given in the units of the first one, and a note says which unit
changed and what both responses are in SI.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from toolkit.calibration.records.record import CalibrationRecord, Indication, LoadFit
from toolkit.calibration.terms import evaluate, parse_term, term_matrix
from toolkit.units import unit

MAIN = 0.1  # of the largest load: an indication that moves a load by more is one of its main ones


@dataclass(frozen=True, slots=True, kw_only=True)
class Response:
    """One indication's response in one load, SI; ``u`` is its standard uncertainty, 0 where none is known.

    ``extent`` [SI of the indication] is the range that it was taken over, None where the record has none.
    """

    value: float
    u: float
    extent: float | None
    per: str

    @property
    def effect(self) -> float | None:
        """How much load [SI] the indication moves over its range; None without a range."""
        return None if self.extent is None else abs(self.value) * self.extent

    def __str__(self) -> str:
        if self.per.endswith("/(V/V)"):
            # Nobody reads a bridge in volts per volt.
            return f"{1e-3 * self.value:.6g} {self.per.removesuffix('(V/V)')}(mV/V)"
        return f"{self.value:.6g} {self.per}"


def range_of(cell: Indication) -> tuple[float, float] | None:
    """Return an indication's fitted range in SI; None where the record has none."""
    if cell.minimum is None or cell.maximum is None or not cell.maximum > cell.minimum:
        return None
    factor = unit(cell.unit).factor
    return cell.minimum * factor, cell.maximum * factor


def response(
    record: CalibrationRecord, load: LoadFit, cell: Indication, over: tuple[float, float] | None = None
) -> Response:
    """Return the response of a load to an indication, the other indications being zero.

    ``over`` is the range in SI; default: the record's own. Without any it is the linear coefficient.
    """
    x, y = unit(cell.unit), unit(load.unit)
    over = over or range_of(cell)
    if over is None:
        step = np.array([float(term == cell.name) for term in load.terms])
    else:
        points = {name: np.zeros(2) for name in record.indications}
        points[cell.name] = np.array(over) / x.factor
        low, high = term_matrix(load.terms, points)
        step = (high - low) / (points[cell.name][1] - points[cell.name][0])
    scale = y.factor / x.factor
    variance = step @ np.array(load.covariance) @ step if load.covariance else 0.0
    return Response(
        value=float(step @ np.array(load.coefficients)) * scale,
        u=float(np.sqrt(max(variance, 0.0))) * scale,
        extent=None if over is None else over[1] - over[0],
        per=f"{y.si}/({x.si})",
    )


def largest_load(load: LoadFit) -> float:
    """Return the largest load of the fitted data in SI; NaN where there is none."""
    return load.largest * unit(load.unit).factor


def tolerance(load: LoadFit) -> float:
    """Return the check loads' tolerance in SI; NaN where the record has neither tolerance nor range."""
    return load.check_tolerance * unit(load.unit).factor


def main_indications(record: CalibrationRecord, load: LoadFit) -> tuple[str, ...]:
    """Return the indications whose response makes a load: those that move over a tenth of the largest one.

    A legacy record has no range; there it is a tenth of the largest response.
    """
    responses = {cell.name: response(record, load, cell) for cell in record.cells}
    effects = {name: sensitivity.effect for name, sensitivity in responses.items()}
    if any(effect is None for effect in effects.values()):
        effects = {name: abs(sensitivity.value) for name, sensitivity in responses.items()}
        scale = max((effect or 0.0) for effect in effects.values())
    else:
        scale = largest_load(load)
    return tuple(name for name, effect in effects.items() if (effect or 0.0) > MAIN * scale)


def same_unit(first: str, second: str) -> bool:
    """Tell whether two spellings are one unit."""
    a, b = unit(first), unit(second)
    return (a.dimension, a.factor) == (b.dimension, b.factor)


def same_dimension(first: str, second: str) -> bool:
    """Tell whether two units measure the same kind of quantity."""
    a, b = unit(first), unit(second)
    return (a.dimension, a.si) == (b.dimension, b.si)


__all__ = [
    "MAIN",
    "Response",
    "largest_load",
    "main_indications",
    "range_of",
    "response",
    "same_dimension",
    "same_unit",
    "tolerance",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class TermDifference:
    """One term of one load: its coefficients as written (None where a record has no such term).

    ``change`` is other - one in the units of ``one``, ``change_percent`` the same of its coefficient; None
    where a term is missing or a unit measures another kind of quantity. ``effect`` is the largest load
    [``unit``, that of ``one``] that the change moves over the indications' range, ``effect_percent_fs`` the
    same in percent of the largest load; None where neither record has a range. ``note`` says in words what
    changed in units, loads or terms, with both coefficients in SI.
    """

    load: str
    term: str
    unit: str
    one: float | None
    other: float | None
    change: float | None
    change_percent: float | None
    effect: float | None
    effect_percent_fs: float | None
    differs: bool
    note: str | None


def differences(first: CalibrationRecord, second: CalibrationRecord) -> tuple[TermDifference, ...]:
    """Compare two records term by term, in the order of the first."""
    names = dict.fromkeys(load.load for record in (first, second) for load in record.loads)
    terms_apart: list[TermDifference] = []
    for name in names:
        terms = (_coefficients(_load(record, name)) for record in (first, second))
        terms_apart += [
            _difference(first, second, name, term) for term in dict.fromkeys(t for x in terms for t in x)
        ]
    return tuple(terms_apart)


def _difference(record: CalibrationRecord, other: CalibrationRecord, name: str, term: str) -> TermDifference:
    a, b = _load(record, name), _load(other, name)
    first, second = _coefficients(a).get(term), _coefficients(b).get(term)
    unit_of_load = next(x.unit for x in (a, b) if x is not None)
    changed = _changed_units(record, other, a, b, term)
    comparable = a is not None and b is not None and all(same_dimension(x, y) for _, x, y in changed)
    change = percent = effect = None
    if first is not None and second is not None and a is not None and b is not None and comparable:
        factor = _scale(other, b, term) / _scale(record, a, term) if changed else 1.0
        change = second * factor - first
        percent = 100 * change / abs(first) if first else None
        extent = _extent(term, record, other)
        effect = None if extent is None else abs(change) * extent
    scale = unit(unit_of_load).factor
    largest = max(
        (x.largest * unit(x.unit).factor / scale for x in (a, b) if x is not None and x.largest > 0),
        default=math.nan,
    )
    return TermDifference(
        load=name,
        term=term,
        unit=unit_of_load,
        one=first,
        other=second,
        change=change,
        change_percent=percent,
        effect=effect,
        effect_percent_fs=None if effect is None or math.isnan(largest) else 100 * effect / largest,
        differs=first != second or bool(changed),
        note=_note(record, other, (a, b), term, changed),
    )


_Changed = list[tuple[str, str, str]]


def _changed_units(
    first: CalibrationRecord, second: CalibrationRecord, a: LoadFit | None, b: LoadFit | None, term: str
) -> _Changed:
    """Return the load and the term's indications whose unit differs: (name, unit in one, in other)."""
    pairs = [] if a is None or b is None else [(a.load, a.unit, b.unit)]
    units = [{cell.name: cell.unit for cell in record.cells} for record in (first, second)]
    pairs += [
        (name, units[0][name], units[1][name])
        for name in sorted(set(parse_term(term).indications))
        if name in units[0] and name in units[1]
    ]
    return [pair for pair in pairs if not same_unit(pair[1], pair[2])]


def _note(
    first: CalibrationRecord,
    second: CalibrationRecord,
    loads: tuple[LoadFit | None, LoadFit | None],
    term: str,
    changed: _Changed,
) -> str | None:
    parts = []
    for record, load in zip((first, second), loads, strict=True):
        if load is None:
            parts.append(f"{record.id} does not have the load")
        elif term not in load.terms:
            parts.append(f"{record.id} does not have the term")
    for name, x, y in changed:
        parts.append(f"{name} in {x}, then in {y}")
        if not same_dimension(x, y):
            parts[-1] += ", which is another kind of quantity: no change can be given"
    values = [
        f"{_coefficients(load)[term] * _scale(record, load, term):.6g} {_si(record, load, term)}"
        for record, load in zip((first, second), loads, strict=True)
        if load is not None and term in load.terms
    ]
    if changed and len(values) == 2 and all(same_dimension(x, y) for _, x, y in changed):
        parts.append(f"that is {values[0]}, then {values[1]}")
    return "; ".join(parts) or None


def _scale(record: CalibrationRecord, load: LoadFit, term: str) -> float:
    """Return the factor from a coefficient as written to SI."""
    units = {cell.name: unit(cell.unit).factor for cell in record.cells}
    return unit(load.unit).factor / float(evaluate(parse_term(term), units, 1.0))


def _si(record: CalibrationRecord, load: LoadFit, term: str) -> str:
    """Return the SI unit of a coefficient, such as N/(V/V)."""
    parsed = parse_term(term)
    units = {cell.name: unit(cell.unit).si for cell in record.cells}
    below = [f"({units[name]})" + (f"^{power}" if power > 1 else "") for name, power in parsed.powers]
    below += [f"({units[name]})" for name in parsed.absolutes]
    return "/".join([unit(load.unit).si, *below])


def _load(record: CalibrationRecord, name: str) -> LoadFit | None:
    return next((load for load in record.loads if load.load == name), None)


def _coefficients(load: LoadFit | None) -> dict[str, float]:
    return {} if load is None else dict(zip(load.terms, load.coefficients, strict=True))


def _extent(term: str, record: CalibrationRecord, second: CalibrationRecord) -> float | None:
    """Return the largest absolute value of a term over the ranges of both records, in units of ``one``."""
    ranges: dict[str, float] = {}
    units = {cell.name: cell.unit for cell in record.cells}
    for cell in (*record.cells, *second.cells):
        if cell.minimum is not None and cell.maximum is not None and cell.name in units:
            comparable = same_unit(cell.unit, units[cell.name])
            factor = 1.0 if comparable else unit(cell.unit).factor / unit(units[cell.name]).factor
            largest = max(abs(cell.minimum), abs(cell.maximum)) * factor
            ranges[cell.name] = max(ranges.get(cell.name, 0.0), largest)
    if not ranges.keys() >= set(parse_term(term).indications):
        return None
    return float(evaluate(parse_term(term), ranges, 1.0))
