"""Fit MF 6.1 to the curves of several loads: one set of coefficients for FY, one for MZ, no start values.

What the data give directly is taken from them: stiffness and peak of every load, then PKY1 linear for each
PKY2. Only shape and curvature are tried from several starts; the fit counts as converged where two of
them end at the same lowest cost.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from toolkit.channels import signs
from toolkit.errors import FitError
from toolkit.tires.fit import why_not
from toolkit.tires.mf61 import aligning, lateral
from toolkit.tires.model import Curve

Array = NDArray[np.float64]

# name: lower bound, upper bound, size of a change that matters
_LATERAL = {
    "PCY1": (0.8, 2.2, 0.1),
    "PDY1": (0.1, 3.0, 0.1),
    "PDY2": (-1.0, 1.0, 0.1),
    "PEY1": (-15.0, 1.0, 0.5),
    "PEY2": (-15.0, 15.0, 0.5),
    "PEY3": (-1.0, 1.0, 0.2),
    "PKY1": (-200.0, -1.0, 2.0),
    "PKY2": (0.1, 20.0, 0.3),
    "PHY1": (-0.05, 0.05, 1e-3),
    "PHY2": (-0.05, 0.05, 1e-3),
    "PVY1": (-0.3, 0.3, 1e-2),
    "PVY2": (-0.3, 0.3, 1e-2),
}
_ALIGNING = {
    "QBZ1": (0.5, 60.0, 2.0),
    "QBZ2": (-40.0, 40.0, 2.0),
    "QBZ3": (-40.0, 40.0, 2.0),
    "QBZ10": (0.0, 3.0, 0.2),
    "QCZ1": (0.3, 3.0, 0.1),
    "QDZ1": (0.0, 1.0, 0.02),
    "QDZ2": (-1.0, 1.0, 0.02),
    "QDZ6": (-0.1, 0.1, 1e-3),
    "QDZ7": (-0.1, 0.1, 1e-3),
    "QEZ1": (-20.0, 1.0, 0.5),
    "QEZ2": (-20.0, 20.0, 0.5),
    "QEZ4": (-2.0, 2.0, 0.2),
    "QHZ1": (-0.05, 0.05, 1e-3),
    "QHZ2": (-0.05, 0.05, 1e-3),
}
_SAME = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class TireFit:
    """MF 6.1 coefficients [ISO-W, SI] with what they were fitted to.

    ``coefficients`` (name, value); ``*_range`` smallest and largest slip angle [rad] and load [N] of the
    data; errors in percent as in the files contract, None where the channel was not measured.
    """

    coefficients: tuple[tuple[str, float], ...]
    FNOMIN: float
    UNLOADED_RADIUS: float
    SA_range: tuple[float, float]
    FZ_range: tuple[float, float]
    n: int
    error_percent_FY: float
    error_percent_MZ: float | None
    at_bound: tuple[str, ...]
    converged: bool


def fit_mf61(
    curves: Sequence[Curve], *, unloaded_radius_m: float, rated_load_N: float | None = None
) -> TireFit:
    """Fit FY, and MZ where it is there, of all loads at zero camber and one pressure.

    Parameters
    ----------
    curves : FY and MZ curves of two loads or more, in any axes
    unloaded_radius_m : it only scales the trail's coefficients
    rated_load_N : FNOMIN; without it the load nearest the middle of the range

    Raises
    ------
    FitError
        no FY curves, one load only, or a curve that `why_not` refuses
    """
    loads = sorted({one.load_N for one in curves if one.channel == "FY" and one.load_N is not None})
    if len(loads) < 2:
        raise FitError(
            "a model over all loads needs FY at two loads or more",
            got=f"FY at {len(loads)} load{'s' * (len(loads) != 1)}",
            expected="two loads or more, five for a load sensitivity to trust",
            next_step="measure more loads, or fit each by magic_formula",
            rule="one-load",
        )
    for one in curves:
        if (problem := why_not(one)) is not None:
            raise problem
    F0 = rated_load_N or min(loads, key=lambda load: abs(load - (loads[0] + loads[-1]) / 2))
    SA, FZ, FY = _rows(curves, "FY")
    p, bound, converged = _search(
        _LATERAL,
        _lateral_starts(SA, FZ, FY, loads, F0),
        lambda p: (lateral(p, SA=SA, FZ=FZ, FNOMIN=F0).FY - FY) / np.abs(FY).max(),
    )
    error_FY = _error(lateral(p, SA=SA, FZ=FZ, FNOMIN=F0).FY, FY)
    error_MZ = None
    if any(one.channel == "MZ" for one in curves):
        A, Z, MZ = _rows(curves, "MZ")
        base = dict(p)

        def moment(q: dict[str, float]) -> Array:
            return aligning({**base, **q}, SA=A, FZ=Z, FNOMIN=F0, UNLOADED_RADIUS=unloaded_radius_m)

        top = np.abs(MZ).max()
        q, more, both = _search(
            _ALIGNING, _aligning_starts(unloaded_radius_m), lambda q: (moment(q) - MZ) / top
        )
        error_MZ = _error(moment(q), MZ)
        p, bound, converged = {**p, **q}, bound + more, converged and both
    return TireFit(
        coefficients=tuple(p.items()),
        FNOMIN=F0,
        UNLOADED_RADIUS=unloaded_radius_m,
        SA_range=(float(SA.min()), float(SA.max())),
        FZ_range=(loads[0], loads[-1]),
        n=len(SA),
        error_percent_FY=error_FY,
        error_percent_MZ=error_MZ,
        at_bound=bound,
        converged=converged,
    )


def _rows(curves: Sequence[Curve], channel: str) -> tuple[Array, Array, Array]:
    # SA, FZ and the channel of all curves, in ISO-W.
    chosen = [one for one in curves if one.channel == channel]
    flips = [signs(one.axes, "ISO-W") for one in chosen]
    SA = np.concatenate([one.SA * flip["SA"] for one, flip in zip(chosen, flips, strict=True)])
    y = np.concatenate([one.y * flip[channel] for one, flip in zip(chosen, flips, strict=True)])
    FZ = np.concatenate([np.full(len(one.SA), one.load_N, dtype=np.float64) for one in chosen])
    return SA, FZ, y


def _lateral_starts(SA: Array, FZ: Array, FY: Array, loads: list[float], F0: float) -> list[dict[str, float]]:
    df = np.array(loads) / F0 - 1
    peaks, slopes = [], []
    for load in loads:
        own = np.equal(FZ, load)
        peaks.append(np.abs(FY[own]).max() / load)
        near = own & (np.abs(SA) <= max(np.radians(2.5), np.sort(np.abs(SA[own]))[min(3, own.sum() - 1)]))
        slopes.append(np.polyfit(SA[near], FY[near], 1)[0])
    PDY2, PDY1 = np.polyfit(df, peaks, 1)
    best = (np.inf, -10.0, 2.0)
    for PKY2 in np.geomspace(0.3, 12.0, 25):
        shape = F0 * np.sin(2 * np.arctan(np.array(loads) / F0 / PKY2))
        PKY1 = float(shape @ slopes / (shape @ shape))
        cost = float(np.sum((PKY1 * shape - slopes) ** 2))
        best = min(best, (cost, PKY1, float(PKY2)))
    common = {"PDY1": float(PDY1), "PDY2": float(PDY2), "PKY1": 1.1 * best[1], "PKY2": best[2]}
    return [{**common, "PCY1": C, "PEY1": E} for C, E in product((1.15, 1.5), (-2.0, 0.0, 0.7))]


def _aligning_starts(radius: float) -> list[dict[str, float]]:
    # A trail of 30 mm at the nominal load is right for any road tire within a factor of three.
    common = {"QDZ1": 0.03 / radius, "QBZ10": 0.5}
    return [
        {**common, "QBZ1": B, "QCZ1": C, "QEZ1": E} for B, C, E in product((6.0, 14.0), (1.1, 1.6), (-2.0,))
    ]


def _search(
    table: dict[str, tuple[float, float, float]],
    starts: list[dict[str, float]],
    residual: Callable[[dict[str, float]], Array],
) -> tuple[dict[str, float], tuple[str, ...], bool]:
    from scipy.optimize import least_squares

    names = list(table)
    low, high, size = np.array(list(table.values())).T

    def misfit(x: Array) -> Array:
        return residual(dict(zip(names, x.tolist(), strict=True)))

    found = []
    for start in starts:
        first = np.array([start.get(name, 0.0) for name in names])
        result = least_squares(
            misfit,
            np.clip(first, low + 1e-6 * size, high - 1e-6 * size),
            bounds=(low, high),
            x_scale=size,
            max_nfev=150,
        )
        found.append((float(result.cost), result.x))
    found.sort(key=lambda one: one[0])
    cost, x = found[0]
    agreeing = sum(other <= cost * (1 + _SAME) + 1e-18 for other, _ in found)
    edge = np.minimum(x - low, high - x) <= 1e-4 * size
    bound = tuple(name for name, at in zip(names, edge, strict=True) if at)
    return dict(zip(names, x.tolist(), strict=True)), bound, agreeing >= 2


def _error(model: Array, y: Array) -> float:
    return float(100 * np.sqrt(np.sum((model - y) ** 2) / np.sum(y**2)))
