"""Fit the Magic Formula to many curves at once, without start values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.arrays import Array
from toolkit.errors import FitError, refuse_unknown
from toolkit.estimate import Estimate
from toolkit.tires.colour import noise_of
from toolkit.tires.evaluate import estimate_at, slope_at, slope_estimate_at, value_at, zero_crossing
from toolkit.tires.kernel import (
    C_HIGH,
    C_LOW,
    E_HIGH,
    E_LOW,
    SPAN_HIGH,
    SPAN_LOW,
    Problems,
    curvature_parameter,
    sine,
    theta_of,
)
from toolkit.tires.model import CHANNEL_UNIT, LOSSES, Curve, CurveFit, Loss, Parameter
from toolkit.tires.models.magic_formula import MODEL, slope, value
from toolkit.tires.quality import error_percent, scatter_floor_percent
from toolkit.tires.solver import Solution, solve, solve_robust
from toolkit.tires.uncertainty import Spread, curve_columns, spread

__all__ = [
    "MIN_POINTS",
    "Curve",
    "estimate_at",
    "fit_curves",
    "slope_at",
    "slope_estimate_at",
    "value_at",
    "why_not",
    "zero_crossing",
]

MIN_POINTS = 7  # six parameters and one degree of freedom
_ONE_LOAD = 0.10  # standard deviation over the mean: a curve of one load is no curve of a range of them
_BATCH = 1024  # curves that are searched at once
_SHIFT = np.deg2rad(10.0)
_TINY_VARIANCE = 1e-24  # of max|y|^2: rounding of noise-free data


def fit_curves(curves: Sequence[Curve], *, loss: Loss = "linear") -> tuple[CurveFit, ...]:
    """Fit the Magic Formula to curves, all in one batch; no start values.

    Parameters
    ----------
    curves : of any lengths; `why_not` tells beforehand whether one can be fitted
    loss : ``linear`` is least squares; ``robust`` bounds the influence of outliers (Tukey's biweight)

    Returns
    -------
    one fit a curve, in their order

    Raises
    ------
    FitError
        fewer than seven rows or slip angles, a constant column, NaN or infinity, an unknown loss
    """
    refuse_unknown("loss", loss, LOSSES, where="--loss", rule="unknown-loss", error=FitError)
    for curve in curves:
        if (problem := why_not(curve)) is not None:
            raise problem
    fits: dict[int, CurveFit] = {}
    for first in range(0, len(curves), _BATCH):
        batch = curves[first : first + _BATCH]
        groups = _groups([len(curve.y) for curve in batch])
        parts = [[batch[i] for i in group] for group in groups]
        scaled = [_normalise(part) for part in parts]
        solved = _solved([problems for problems, _ in scaled], loss)
        for group, part, (_, scale), fitted in zip(groups, parts, scaled, solved, strict=True):
            fits.update(zip([first + i for i in group], _fit_group(part, scale, *fitted, loss), strict=True))
    return tuple(fits[i] for i in range(len(curves)))


def why_not(curve: Curve) -> FitError | None:
    """Return why a curve cannot be fitted, None where it can."""
    where = f"{curve.channel} at " + ("all loads" if curve.load_N is None else f"{curve.load_N:.0f} N")

    def problem(rule: str, what: str, got: str, expected: str, next_step: str) -> FitError:
        return FitError(what, where=where, got=got, expected=expected, next_step=next_step, rule=rule)

    SA, y = curve.SA, curve.y
    lengths = {len(SA), len(y)} | (set() if curve.sigma is None else {len(curve.sigma)})
    if len(lengths) > 1:
        return problem(
            "lengths", "columns of different lengths", str(sorted(lengths)), "one length", "check the rows"
        )
    if len(y) < MIN_POINTS:
        return problem(
            "too-few-points",
            "too few points for the Magic Formula",
            f"{len(y)} points",
            f"at least {MIN_POINTS}: six parameters and one degree of freedom",
            "measure more slip angles at this load",
        )
    if not (np.isfinite(SA).all() and np.isfinite(y).all()):
        row = int(np.argmax(~(np.isfinite(SA) & np.isfinite(y)))) + 1
        return problem(
            "not-finite", "a value is not a number", f"row {row}: SA {SA[row - 1]}, y {y[row - 1]}",
            "finite numbers", "remove or mend that row",
        )  # fmt: skip
    if curve.sigma is not None and not (np.isfinite(curve.sigma).all() and (curve.sigma >= 0).all()):
        return problem(
            "bad-sigma",
            "a standard uncertainty is negative or not a number",
            "sigma",
            "finite, >= 0",
            "mend it",
        )
    if curve.load_N is not None and curve.load_sd_N > _ONE_LOAD * curve.load_N:
        return problem(
            "load-varies",
            "the load is not one load",
            f"a mean of {curve.load_N:.0f} N with a standard deviation of {curve.load_sd_N:.0f} N, without "
            "steps that part it",
            f"loads held at steps, each within {_ONE_LOAD:.0%}",
            "fit a model that reads the load (--model mf61), or measure at steps of load",
        )
    places = len(np.unique(np.rint(SA / np.deg2rad(0.05))))
    if places < MIN_POINTS:
        return problem(
            "constant-column" if places < 2 else "too-few-points",
            "the slip angle does not change" if places < 2 else "too few different slip angles",
            f"{places} different slip angle{'s' * (places > 1)} in {len(SA)} rows",
            f"at least {MIN_POINTS}, 0.05 deg apart",
            "measure more slip angles at this load",
        )
    if np.ptp(y) <= 1e-12 * np.abs(y).max():
        return problem(
            "constant-column", f"{curve.channel} does not change with slip angle", f"{y[0]:g} in every row",
            "a channel that follows the slip angle", "check the column and its calibration",
        )  # fmt: skip
    return None


def _groups(lengths: Sequence[int]) -> list[list[int]]:
    # Curves of like length share a batch: padding a short one to a long one would be wasted work.
    order = sorted(range(len(lengths)), key=lambda i: lengths[i])
    groups: list[list[int]] = []
    for i in order:
        if groups and lengths[i] <= 1.5 * lengths[groups[-1][0]] and len(groups[-1]) < 256:
            groups[-1].append(i)
        else:
            groups.append([i])
    return groups


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Scale:
    # Of each curve: middle and half range of slip angle [rad], max|y|, and the known variance of a row of
    # weight one in normalised units (NaN where no uncertainties were given).
    middle: Array
    half: Array
    top: Array
    known: Array


def _normalise(curves: Sequence[Curve]) -> tuple[Problems, _Scale]:
    count, points = len(curves), max(len(curve.y) for curve in curves)
    u, y, sw = np.zeros((count, points)), np.zeros((count, points)), np.zeros((count, points))
    middle, half, top, known = (np.full(count, np.nan) for _ in range(4))
    for i, curve in enumerate(curves):
        n = len(curve.y)
        low, high = curve.SA.min(), curve.SA.max()
        middle[i], half[i], top[i] = (low + high) / 2, (high - low) / 2, np.abs(curve.y).max()
        u[i, :n] = (curve.SA - middle[i]) / half[i]
        y[i, :n] = curve.y / top[i]
        sw[i, :n] = 1.0
        if curve.sigma is not None and (curve.sigma > 0).any():
            # A stated zero would be an infinite weight: no sigma below a hundredth of the typical one.
            sigma = np.maximum(curve.sigma, 0.01 * np.median(curve.sigma[curve.sigma > 0]))
            unit = 1.0 / np.sqrt(np.mean(1.0 / sigma**2))
            sw[i, :n] = unit / sigma
            known[i] = (unit / top[i]) ** 2
    low4, high4 = np.empty((count, 4)), np.empty((count, 4))
    low4[:, 0], high4[:, 0] = np.log(SPAN_LOW / 2), np.log(SPAN_HIGH / 2)
    low4[:, 1], high4[:, 1] = C_LOW, C_HIGH
    low4[:, 2], high4[:, 2] = curvature_parameter(E_HIGH), curvature_parameter(E_LOW)
    low4[:, 3], high4[:, 3] = (middle - _SHIFT) / half, (middle + _SHIFT) / half
    problems = Problems(u=u, y=y, sw=sw, low=low4, high=high4)
    return problems, _Scale(middle=middle, half=half, top=top, known=known)


def _solved(groups: Sequence[Problems], loss: Loss) -> list[tuple[Problems, Solution, Array]]:
    # Each group's problems with their final weights, its minima, and the inflation of their variance.
    if loss == "robust":
        robust = [solve_robust(group) for group in groups]
        return [(problems, solution, inflation) for solution, problems, inflation in robust]
    return [
        (group, solution, np.ones(len(group.u)))
        for group, solution in zip(groups, solve(groups), strict=True)
    ]


def _fit_group(
    curves: Sequence[Curve],
    scale: _Scale,
    problems: Problems,
    solution: Solution,
    inflation: Array,
    loss: Loss,
) -> list[CurveFit]:
    linear = solution.state.linear
    residual = problems.y - linear[:, :1] * sine(solution.state.p, problems.u) - linear[:, 1:]
    lengths = np.array([len(curve.y) for curve in curves])
    columns = curve_columns(solution, problems)
    # Known uncertainties are a floor: scatter or misfit beyond them widens the intervals (Birge).
    cost = np.maximum(inflation * solution.state.cost, _TINY_VARIANCE * (lengths - 6))
    parts = None if loss == "robust" else _parts(solution, problems)
    noise = noise_of(residual * problems.sw, columns, lengths, cost, scale.known, parts)
    spreads = spread(solution, problems, zero=-scale.middle / scale.half, noise=noise)
    return [
        _result(curve, i, solution, spreads, scale, residual[i, : len(curve.y)], float(noise.time[i]), loss)
        for i, curve in enumerate(curves)
    ]


def _parts(solution: Solution, problems: Problems) -> Array:
    # What makes rows scatter: the channel itself, the slip angle, the load or a gain (curves, 3, points).
    theta = theta_of(solution.state)
    level = value(theta.T[..., None], problems.u) - theta[:, 5:]
    each = np.stack([np.ones_like(problems.u), slope(theta.T[..., None], problems.u), level], axis=1)
    return np.asarray((each * problems.sw[:, None]) ** 2)


def _result(
    curve: Curve,
    i: int,
    solution: Solution,
    spread: Spread,
    scale: _Scale,
    residual: Array,
    time: float,
    loss: Loss,
) -> CurveFit:
    middle, half, top = (float(column[i]) for column in (scale.middle, scale.half, scale.top))
    factor = np.array([1 / half, 1.0, top, 1.0, half, top])
    values = spread.theta[i] * factor
    values[4] -= middle
    covariance = spread.covariance[i] * np.outer(factor, factor)
    errors = spread.error[i] * np.abs(factor)
    ends = spread.ends[i] * factor[:, None]
    ends[4] -= middle
    names = [spec.name for spec in MODEL.parameters]
    determined, bound = spread.determined[i], spread.at_bound[i]
    unit = CHANNEL_UNIT[curve.channel]

    dof = [float(count) for count in spread.dof[i]]

    def estimate(value: float, u: float, factor: float, unit: str, dof: float) -> Estimate | None:
        if not np.isfinite(u):
            return None
        return Estimate(value=float(value) * factor, u=float(u) * factor, unit=unit, dof=dof)

    converged = bool(solution.agreeing[i] >= 2)
    not_determined = tuple(name for name, ok in zip(names, determined, strict=True) if not ok)
    at_bound = tuple(name for name, at in zip(names, bound, strict=True) if at)
    return CurveFit(
        model=MODEL.name,
        channel=curve.channel,
        load_N=curve.load_N,
        axes=curve.axes,
        n=len(curve.y),
        dof=len(curve.y) - 6,
        parameters=tuple(
            Parameter(
                name=spec.name,
                value=float(value),
                unit=spec.unit_of(curve.channel),
                standard_error=float(error) if ok else None,
                dof=own if ok else None,
                interval95=_interval(low, high),
            )
            for spec, value, error, ok, own, (low, high) in zip(
                MODEL.parameters, values, errors, determined, dof[:6], ends.tolist(), strict=True
            )
        ),
        covariance=tuple(tuple(row) for row in covariance.tolist()),
        not_determined=not_determined,
        at_bound=at_bound,
        error_percent=error_percent(residual * top, curve.y),
        scatter_floor_percent=scatter_floor_percent(curve.SA, curve.y),
        slope_at_zero=estimate(spread.slope[i], spread.slope_se[i], top / half, f"{unit}/rad", dof[6]),
        value_at_zero=estimate(spread.value[i], spread.value_se[i], top, unit, dof[7]),
        loss=loss,
        converged=converged,
        message=_message(curve, values, converged, not_determined, at_bound, time),
    )


def _interval(low: float, high: float) -> tuple[float | None, float | None] | None:
    # Open where a bound alone ends it.
    ends = tuple(end if np.isfinite(end) else None for end in (low, high))
    return None if ends == (None, None) else (ends[0], ends[1])


def _message(
    curve: Curve,
    values: Array,
    converged: bool,
    not_determined: tuple[str, ...],
    at_bound: tuple[str, ...],
    time: float,
) -> str:
    parts = [] if converged else ["only one start ended at the lowest cost: the minimum is not confirmed"]
    low, high = np.rad2deg(curve.SA.min()), np.rad2deg(curve.SA.max())
    if low * high >= 0 or min(-low, high) < 0.1 * (high - low):
        parts.append(f"slip angles of one sign ({low:.2f} to {high:.2f} deg): the shifts rest on the model")
    B, C, _, E, Sh, _ = values
    z = B * (np.array([curve.SA.min(), curve.SA.max()]) + Sh)
    if np.max(np.abs(C * np.arctan(z - E * (z - np.arctan(z))))) < np.pi / 2:
        parts.append("the peak is not reached within the slip angles measured")
    if at_bound:
        parts.append(f"at its bound: {', '.join(at_bound)}")
    if undetermined := [name for name in not_determined if name not in at_bound]:
        parts.append(f"not determined by these data: {', '.join(undetermined)}")
    if curve.sigma is not None:
        parts.append("weighted by the stated standard uncertainties")
    if time > 1:
        parts.append(
            f"residuals are autocorrelated, {time:.1f} rows say as much as one: standard errors allow for it"
        )
    return "; ".join(parts)
