"""Which parameters the data determine, and how well: linear propagation, checked against the real cost.

The Gauss-Newton covariance holds only where the cost is a parabola. So every parameter is moved by two
standard errors along its ridge, and the cost there is computed: where it is not what the parabola says, or
a bound is in the way, the parameter is not determined and gets no standard error. Rows of a 100 Hz
sweep repeat themselves: the covariance is multiplied by the residual's integrated autocorrelation time.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.tires.kernel import (
    C_HIGH,
    C_LOW,
    D_LIMIT,
    E_HIGH,
    E_LOW,
    SPAN_HIGH,
    SPAN_LOW,
    SV_LIMIT,
    Problems,
    State,
    shape_of,
)
from toolkit.tires.models.magic_formula import jacobian, slope, slope_jacobian, value

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.tires.kernel import Array

_STEP = 2.0  # standard errors by which a parameter is moved
_PARABOLA = (0.35, 3.0)  # of the expected rise of the cost: beyond, a linear interval would mislead
_WIDE = 0.25  # of the spread that the bounds alone leave: beyond, the data say next to nothing
_ROWS_FOR_CORRELATION = 40


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Spread:
    """Per curve, in normalised parameters (B, C, D, E, h, Sv): what the data say about each.

    ``theta`` (curves, 6); ``covariance`` (curves, 6, 6); ``determined`` ``at_bound`` (curves, 6);
    ``slope`` ``value`` at SA = 0 with their standard errors, NaN where not determined (curves,).
    """

    theta: Array
    covariance: Array
    determined: NDArray[np.bool_]
    at_bound: NDArray[np.bool_]
    slope: Array
    slope_se: Array
    value: Array
    value_se: Array


def spread(state: State, problems: Problems, *, zero: Array, variance: Array) -> Spread:
    """Return what the data say about the parameters at a minimum.

    Parameters
    ----------
    zero : normalised slip angle of SA = 0 (curves,)
    variance : variance of a row of weight one, autocorrelation included (curves,)
    """
    B, C, E, h = shape_of(state.p)
    theta = np.stack([B, C, state.linear[:, 0], E, h, state.linear[:, 1]], axis=1)
    low, high, width = _box(theta, problems)
    margin = 1e-6 * (high - low)
    at_bound = (theta <= low + margin) | (theta >= high - margin)
    columns = np.moveaxis(jacobian(theta.T[..., None], problems.u), 0, 1) * problems.sw[:, None, :]
    information = columns @ columns.transpose(0, 2, 1) / variance[:, None, None]
    # What the bounds alone say keeps the inverse finite; it is negligible for what the data determine.
    information += np.eye(6) / (width * width)[:, :, None]
    free = (~at_bound).astype(np.float64)
    information = information * (free[:, :, None] * free[:, None, :])
    np.einsum("pii->pi", information)[...] += at_bound
    covariance = _inverse(information) * (free[:, :, None] * free[:, None, :])
    sd = np.sqrt(np.maximum(np.einsum("pii->pi", covariance), 0.0))
    ridge = covariance / np.where(sd > 0, sd, 1.0)[:, None, :]
    steady = _parabolic(theta, ridge, problems, state.cost, variance, low, high)
    determined = (~at_bound) & (sd <= _WIDE * width) & steady
    at_zero = slope(theta.T, zero)
    slope_se, slope_ok = _propagated(
        slope_jacobian(theta.T, zero).T, theta, covariance, problems, state.cost, variance
    )
    level = value(theta.T, zero)
    value_se, value_ok = _propagated(
        jacobian(theta.T, zero).T, theta, covariance, problems, state.cost, variance
    )
    inside = np.abs(zero) <= 1.05
    slope_ok = inside & (slope_se <= _WIDE * np.abs(at_zero))
    return Spread(
        theta=theta,
        covariance=covariance,
        determined=determined,
        at_bound=at_bound,
        slope=at_zero,
        slope_se=np.where(slope_ok, slope_se, np.nan),
        value=level,
        value_se=np.where(inside, value_se, np.nan),
    )


def _box(theta: Array, problems: Problems) -> tuple[Array, Array, Array]:
    # Bounds of the six normalised parameters, and the standard deviation of "anywhere within them".
    ones = np.ones(len(theta))
    h_low, h_high = problems.low[:, 3], problems.high[:, 3]
    low = np.stack(
        [ones * SPAN_LOW / 2, ones * C_LOW, -D_LIMIT * ones, E_LOW * ones, h_low, -SV_LIMIT * ones], axis=1
    )
    high = np.stack(
        [ones * SPAN_HIGH / 2, ones * C_HIGH, D_LIMIT * ones, E_HIGH * ones, h_high, SV_LIMIT * ones], axis=1
    )
    width = (high - low) / np.sqrt(12.0)
    # B is a scale: its width is one of ratios, ln(50/0.05)/sqrt(12) = 2 times B itself.
    width[:, 0] = theta[:, 0] * np.log(SPAN_HIGH / SPAN_LOW) / np.sqrt(12.0)
    return low, high, width


def _inverse(matrix: Array) -> Array:
    scale = 1.0 / np.sqrt(np.einsum("pii->pi", matrix))
    unit = matrix * (scale[:, :, None] * scale[:, None, :])
    return np.linalg.inv(unit) * (scale[:, :, None] * scale[:, None, :])


def _cost(theta: Array, problems: Problems) -> Array:
    # theta (directions, curves, 6) -> cost (directions, curves)
    model = value(np.moveaxis(theta, -1, 0)[..., None], problems.u)
    residual = (model - problems.y) * problems.sw
    return np.vecdot(residual, residual)


def _parabolic(
    theta: Array, ridge: Array, problems: Problems, cost: Array, variance: Array, low: Array, high: Array
) -> NDArray[np.bool_]:
    # Six parameters, two sides: does the cost rise by _STEP^2 variances, inside the box?
    moves = _STEP * np.moveaxis(ridge, 2, 0)
    moved = np.stack([theta + moves, theta - moves])
    own = np.einsum("sjpj->sjp", moved)
    inside = ((own >= low.T) & (own <= high.T)).all(axis=0)
    rise = (_cost(moved.reshape(-1, *theta.shape), problems) - cost) / (_STEP**2 * variance)
    fair = ((rise >= _PARABOLA[0]) & (rise <= _PARABOLA[1])).reshape(2, 6, -1).all(axis=0)
    result: NDArray[np.bool_] = (inside & fair).T
    return result


def _propagated(
    gradient: Array, theta: Array, covariance: Array, problems: Problems, cost: Array, variance: Array
) -> tuple[Array, NDArray[np.bool_]]:
    # Delta method for a derived quantity, with the same check of the cost along its ridge.
    along = np.matvec(covariance, gradient)
    se = np.sqrt(np.maximum(np.vecdot(gradient, along), 0.0))
    direction = _STEP * along / np.where(se > 0, se, 1.0)[:, None]
    rise = (_cost(np.stack([theta + direction, theta - direction]), problems) - cost) / (_STEP**2 * variance)
    return se, (rise <= _PARABOLA[1]).all(axis=0) & np.isfinite(se)


def autocorrelation_time(residual: Array) -> float:
    """Return 1 + 2 sum of the autocorrelations of residuals in the order of recording (Geyer 1992).

    The sum ends where a pair of neighbouring terms is no longer positive. Few rows give 1: there the
    estimate would be noise.

    >>> autocorrelation_time(np.tile([1.0, -1.0], 50))
    1.0
    """
    n = len(residual)
    if n < _ROWS_FOR_CORRELATION:
        return 1.0
    r = residual - residual.mean()
    size = 1 << (2 * n - 1).bit_length()
    spectrum = np.fft.rfft(r, size)
    acov = np.fft.irfft(spectrum * np.conj(spectrum), size)[:n]
    if acov[0] <= 0:
        return 1.0
    rho = acov / acov[0]
    if rho[1] < 2.0 / np.sqrt(n):
        return 1.0
    pairs = rho[: n - n % 2].reshape(-1, 2).sum(axis=1)
    end = int(np.argmax(pairs <= 0)) if (pairs <= 0).any() else len(pairs)
    time = 2.0 * float(np.minimum.accumulate(pairs[:end]).sum()) - 1.0
    return float(np.clip(time, 1.0, n / 8))
