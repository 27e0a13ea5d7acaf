"""Which parameters the data determine, and how well: linear propagation, checked against the real cost.

The Gauss-Newton covariance holds only where the cost is a parabola. So every parameter is moved by two
standard errors, all else is fitted again, and the cost is compared: where it is not what the parabola
says, a bound is in the way, or another minimum is as good, the parameter is not determined and gets no
standard error. Rows of a 100 Hz
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
    theta_of,
)
from toolkit.tires.models.magic_formula import jacobian, slope, slope_jacobian, value
from toolkit.tires.solver import compress

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.tires.kernel import Array
    from toolkit.tires.solver import Solution

_STEP = 2.0  # standard errors by which a parameter is moved
_PARABOLA = (0.5, 1.8)  # of the expected rise of the cost: beyond, a linear interval would mislead
_REFITS = 4  # steps by which all else is fitted again where one quantity is held
_APART = 3.0  # standard errors between minima that differ
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


def spread(solution: Solution, problems: Problems, *, zero: Array, variance: Array) -> Spread:
    """Return what the data say about the parameters at a minimum.

    Parameters
    ----------
    zero : normalised slip angle of SA = 0 (curves,)
    variance : variance of a row of weight one, autocorrelation included (curves,)
    """
    theta = theta_of(solution.state)
    low, high, width = _box(theta, problems)
    margin = 1e-6 * (high - low)
    at_bound = (theta <= low + margin) | (theta >= high - margin)
    columns = np.moveaxis(jacobian(theta.T[..., None], problems.u), 0, 1) * problems.sw[:, None, :]
    information = columns @ columns.transpose(0, 2, 1) / variance[:, None, None]
    # What the bounds alone say keeps the inverse finite; it is negligible for what the data determine.
    information += np.eye(6) / (width * width)[:, :, None]
    # A parameter at its bound stays free here: the others would else look better known than they are.
    covariance = _inverse(information)
    at_zero, level = slope(theta.T, zero), value(theta.T, zero)
    gradients = np.concatenate(
        [
            np.broadcast_to(np.eye(6)[:, None, :], (6, *theta.shape)),
            slope_jacobian(theta.T, zero).T[None],
            jacobian(theta.T, zero).T[None],
        ]
    )
    along = np.matvec(covariance, gradients)
    errors = np.sqrt(np.maximum(np.vecdot(gradients, along), 0.0))
    along /= np.where(errors > 0, errors, 1.0)[..., None]
    steady = _steady(theta, gradients[:6], along[:6], compress(problems), variance, low, high)
    sd = errors[:6].T
    determined = (~at_bound) & (sd <= _WIDE * width) & steady.T
    # Another minimum that the noise cannot tell from the lowest: what differs there is not determined.
    rival = (solution.excess <= _STEP**2 * variance[:, None])[..., None]
    apart = np.abs(solution.rivals - theta[:, None, :]) > _APART * sd[:, None, :] + 1e-6
    determined &= ~(rival & apart).any(axis=1)
    # Beyond the data a curve is an extrapolation of the model, whatever its covariance says.
    # A slope needs rows on both sides; a value may stand at the end of them.
    slope_ok = (np.abs(zero) <= 0.95) & (errors[6] <= _WIDE * np.abs(at_zero))
    return Spread(
        theta=theta,
        covariance=covariance,
        determined=determined,
        at_bound=at_bound,
        slope=at_zero,
        slope_se=np.where(slope_ok, errors[6], np.nan),
        value=level,
        value_se=np.where(np.abs(zero) <= 1.05, errors[7], np.nan),
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


def _steady(
    theta: Array,
    gradients: Array,
    along: Array,
    problems: Problems,
    variance: Array,
    low: Array,
    high: Array,
) -> NDArray[np.bool_]:
    # Does the cost rise as the parabola says when a quantity is held _STEP standard errors away, on both
    # sides, and all else is fitted again? gradients, along (quantities, curves, 6) -> (quantities, curves).
    quantities, curves = len(gradients), len(theta)
    sides = np.array([_STEP, -_STEP])[:, None, None, None]
    moved = (theta + sides * along).reshape(-1, 6)
    repeat = np.tile(np.arange(curves), 2 * quantities)
    held = np.concatenate([gradients, gradients]).reshape(-1, 6)
    own = np.einsum("sjpj->sjp", moved.reshape(2, quantities, curves, 6)[:, :6])
    margin = 0.02 * (high - low).T
    reachable = np.ones((quantities, curves), dtype=np.bool_)
    reachable[:6] = ((own >= low.T - margin) & (own <= high.T + margin)).all(axis=0)
    part, low, high = problems.take(repeat), low[repeat], high[repeat]
    moved = np.clip(moved, low, high)
    cost, columns, residual = _linearised(moved, part)
    for _ in range(_REFITS):
        normal = columns @ columns.transpose(0, 2, 1)
        diagonal = np.einsum("pii->pi", normal)
        diagonal[...] += 1e-9 * diagonal.max(axis=1)[:, None] + 1e-300
        inverse = _inverse(normal)
        descent = np.matvec(inverse, np.matvec(columns, residual))
        across = np.matvec(inverse, held)
        share = np.vecdot(held, descent) / np.maximum(np.vecdot(held, across), 1e-300)
        trial = np.clip(moved + descent - share[:, None] * across, low, high)
        new_cost, new_columns, new_residual = _linearised(trial, part)
        better = new_cost < cost
        moved[better], cost[better] = trial[better], new_cost[better]
        columns[better], residual[better] = new_columns[better], new_residual[better]
    base, _, _ = _linearised(theta, problems)
    rise = (cost.reshape(2, quantities, curves) - base) / (_STEP**2 * variance)
    fair = ((rise >= _PARABOLA[0]) & (rise <= _PARABOLA[1])).all(axis=0)
    result: NDArray[np.bool_] = reachable & fair
    return result


def _linearised(theta: Array, problems: Problems) -> tuple[Array, Array, Array]:
    # Cost (curves,), the columns of the Jacobian (curves, 6, points) and the residual, all weighted.
    columns = np.moveaxis(jacobian(theta.T[..., None], problems.u), 0, 1) * problems.sw[:, None, :]
    residual = (problems.y - value(theta.T[..., None], problems.u)) * problems.sw
    return np.vecdot(residual, residual), columns, residual


def _inverse(matrix: Array) -> Array:
    scale = 1.0 / np.sqrt(np.einsum("pii->pi", matrix))
    unit = matrix * (scale[:, :, None] * scale[:, None, :])
    result: Array = np.linalg.inv(unit) * (scale[:, :, None] * scale[:, None, :])
    return result


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
