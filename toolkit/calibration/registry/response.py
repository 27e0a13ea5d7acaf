"""The physics of a record: how a load answers to an indication, in SI, whatever units were written.

A response is d load / d indication, [N or N*m] per [V/V] (or count, N, ...). Records in other units, and with
other models, are compared by it: of a model with higher terms it is the secant over a range.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.terms import term_matrix
from toolkit.units import unit

if TYPE_CHECKING:
    from toolkit.calibration.records.record import CalibrationRecord, Indication, LoadFit

MAIN = 0.1  # of the largest load: an indication that moves a load by more is one of its main ones
_TOLERANCE = 1e-3  # of the largest load, where none is stated


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
    return (load.tolerance or _TOLERANCE * load.largest) * unit(load.unit).factor


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
