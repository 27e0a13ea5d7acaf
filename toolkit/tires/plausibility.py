"""What no tire does: values beyond it are a wrong unit or a slip of the pen, and would move a whole table.

Single values are refused, generously: the largest aircraft tires carry some 300 kN. A unit that is wrong by
a factor leaves every value possible, and shows only in ratios, of the rows and of what is fitted: those are
told, never refused, by the bounds that hold for every test (`toolkit.reduction.limits`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from toolkit.arrays import Array
from toolkit.errors import CellError
from toolkit.findings import Finding
from toolkit.reduction.limits import LARGEST_TRAIL_M, LEAST_LOAD_N, STIFFNESS
from toolkit.tires.model import CurveFit

# The largest size [SI] by dimension; of a slip or inclination angle any, of the two angles that turn on none.
LARGEST = {
    "TIRE_ANGLE": math.inf, "DRUM_ANGLE": math.inf, "angle": math.pi, "force": 1e6, "moment": 1e5,
    "pressure": 1e8, "speed": 1e3, "ratio": 1e3, "temperature": 5e3, "time": 1e12,
}  # fmt: skip
# Of a tire's characteristics, by SI unit: no residual angle is as large as a quarter turn; of others any.
_CHARACTERISTIC = {
    "N": LARGEST["force"], "N*m": LARGEST["moment"], "N/rad": 1e8, "N*m/rad": 1e7, "rad": math.pi / 2,
}  # fmt: skip
_SHOWN = {"rad": "90 deg"}
_SURE = 3.0  # standard errors
_ZERO = 0.02  # of the largest load: a lifted wheel reads as much, of either sign


def demand_possible(value: float, unit: str, *, where: str, U: bool = False) -> None:
    """Refuse a characteristic [SI] that no tire has; an uncertainty ``U`` that is negative too.

    Raises
    ------
    CellError
        ``wrong-value``

    >>> demand_possible(4000.0, "N", where="maker.csv, row 2, column FZ")
    """
    limit = _CHARACTERISTIC.get(unit, math.inf)
    if abs(value) <= limit and not (U and value < 0):
        return
    printed = _SHOWN.get(unit, f"{limit:g} {unit}")
    raise CellError(
        "an uncertainty is negative" if U and value < 0 else "a value is larger than any tire's",
        where=where,
        got=f"{value:g} {unit}",
        expected=f"0 to {printed}" if U else f"at most {printed}",
        next_step="correct the cell, or the unit in the header",
        rule="wrong-value",
    )


def load_of(FZ: Array, *, where: str, rows: Sequence[int] | None = None, spikes: float = 0.0) -> Array:
    """Return the load [N], not negative: FZ in whatever sense its axes give it, one sense in all rows.

    Parameters
    ----------
    rows : numbers of the rows as the file counts them
    spikes : part of the rows that may have the other sense, as single samples of a fast recording do

    Raises
    ------
    CellError
        ``mixed-load-signs``: rows of both signs, by more than the zero of a load cell
    """
    size = np.abs(FZ)
    largest = int(np.argmax(size)) if len(FZ) else 0
    away = np.flatnonzero((np.sign(FZ) == -np.sign(FZ[largest])) & (size > _ZERO * size[largest]))
    if len(away) <= spikes * len(FZ):
        return np.asarray(size, dtype=np.float64)
    number = int(away[0]) + 1 if rows is None else rows[away[0]]
    raise CellError(
        "FZ has both signs",
        where=f"{where}, row {number}",
        got=f"{FZ[away[0]]:.6g} N, and {FZ[largest]:.6g} N in another row; {len(away)} of {len(FZ)} have "
        "that sign",
        expected="one sign in all rows: the load, positive (ISO 8855) or negative (SAE J670)",
        next_step="correct those rows: no tire pulls at the road",
        rule="mixed-load-signs",
    )


def size_findings(fits: Sequence[CurveFit], where: str) -> tuple[Finding, ...]:
    """Return a finding where fitted stiffnesses are of a size that no tire has: a unit may be wrong.

    Judged are the slopes at zero that the data determine: cornering stiffness over load, and aligning over
    cornering stiffness; and the loads themselves. A factor that leaves all within the range, as pounds for
    newtons, cannot be seen in one table.
    """
    slopes: dict[tuple[str, float], tuple[float, float]] = {}
    for fit in fits:
        if fit.slope_at_zero is not None and fit.load_N:
            slopes[fit.channel, fit.load_N] = abs(fit.slope_at_zero.value), fit.slope_at_zero.u
    ratios = [(value / load, u / load) for (name, load), (value, u) in slopes.items() if name == "FY"]
    findings = []
    low, high = STIFFNESS.low, STIFFNESS.high
    odd = [value for value, u in ratios if value + _SURE * u < low or value - _SURE * u > high]
    if 2 * len(odd) > len(ratios):
        findings.append(
            Finding(
                rule="implausible-stiffness",
                where=f"{where}, FY",
                message=f"the cornering stiffness is {_range(odd)} times the load per rad in {len(odd)} of "
                f"{len(ratios)} load blocks, that of tires {low:g} to {high:g}: is SA in another unit than "
                "its header says, or FY in another than FZ?",
            )
        )
    trails = [
        (value / slopes["FY", load][0], u / slopes["FY", load][0])
        for (name, load), (value, u) in slopes.items()
        if name == "MZ" and slopes.get(("FY", load), (0.0, 0.0))[0] > 0
    ]
    long = [value for value, u in trails if value - _SURE * u > LARGEST_TRAIL_M]
    if 2 * len(long) > len(trails):
        findings.append(
            Finding(
                rule="implausible-stiffness",
                where=f"{where}, MZ",
                message=f"the aligning stiffness is {_range(long)} m times the cornering stiffness in "
                f"{len(long)} of {len(trails)} load blocks, a trail that is longer than any tire's "
                f"({LARGEST_TRAIL_M:g} m): is MZ in another unit than its header says, or FY?",
            )
        )
    loads = [load for _, load in slopes]
    if loads and max(loads) < LEAST_LOAD_N:
        findings.append(
            Finding(
                rule="implausible-load",
                where=f"{where}, FZ",
                message=f"the largest load is {max(loads):.3g} N, less than any vehicle's tire carries: are "
                "forces in another unit than their headers say?",
            )
        )
    return tuple(findings)


def _range(values: Sequence[float]) -> str:
    low, high = (
        f"{extreme:.0f}" if extreme >= 100 else f"{extreme:.3g}" for extreme in (min(values), max(values))
    )
    return low if low == high else f"{low} to {high}"
