"""How well the data determine each parameter: an interval that holds, and whether it is worth showing.

Intervals of 95 % start from linear propagation and are held against the model itself: with a parameter held
at either end and all else fitted again, the curve must have moved as far as the parabola of the cost says;
where it has moved less, that end moves out. Another minimum that the noise cannot tell from the lowest lies
within the interval. A standard error is the half width of the interval over its coverage factor: the linear
one where model and noise are straight enough, a larger one else.

A parameter is determined where

- it is not at a bound,
- rows like these would determine it on a curve of the usual shape (`usual_shape`): the half width of its
  interval there lies within the bounds and is at most half of what is natural for it: B, C and D themselves,
  1.25 - E, half the range of slip angle for Sh, max|y| for Sv. Asked at the estimate instead, the answer
  would depend on the error: what is shown would be what happens to look sharp, and cover 70 to 85 %,
- its own interval's half width is not beyond what is natural for it.

Only the model, the places of the rows and the size of the noise are asked, never the residuals: less noise
determines more. Rows of a 100 Hz sweep repeat themselves: `colour` says what information that leaves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.estimate import coverage_factor
from toolkit.tires.colour import Noise
from toolkit.tires.kernel import (
    C_HIGH,
    C_LOW,
    D_LIMIT,
    E_HIGH,
    E_LOW,
    E_TOP,
    SPAN_HIGH,
    SPAN_LOW,
    SV_LIMIT,
    Problems,
    theta_of,
)
from toolkit.tires.models.magic_formula import jacobian, slope, slope_jacobian, value
from toolkit.tires.solver import Solution, compress

# Would rows like these determine the parameters of a curve of the usual shape? Asked apart from the error.


C_USUAL = (1.30, 1.85, 2.40)
_E_STARTS = ((-0.5, 0.0, -4.0), (-0.5, 0.0, -4.0), (-2.0, 0.0, -4.0))  # of the shapes
_STEPS = 8
_C = 1  # its place among the parameters


def at_usual_shape(theta: Array, problems: Problems, low: Array, high: Array) -> Array:
    """Return the parameters (curves, 6) nearest each curve with C held at its usual value.

    Parameters
    ----------
    theta : (curves, 6) normalised parameters of the curves, which stand for their data
    problems : places and weights of the rows
    low, high : (curves, 6) bounds
    """
    shape = np.abs(np.log(theta[:, _C, None] / np.array(C_USUAL))).argmin(axis=1)
    aim = value(theta.T[..., None], problems.u)
    start = theta.copy()
    start[:, _C] = np.array(C_USUAL)[shape]
    # The slope at zero is known best: B C is kept.
    start[:, 0] *= theta[:, _C] / start[:, _C]
    start = np.clip(start, low, high)
    residual = _residual(start, aim, problems)
    cost = np.vecdot(residual, residual)
    for E in np.array(_E_STARTS)[shape].T:
        usual = start.copy()
        usual[:, 3] = E
        new = _residual(usual, aim, problems)
        new_cost = np.vecdot(new, new)
        better = new_cost < cost
        start[better], residual[better], cost[better] = usual[better], new[better], new_cost[better]
    return _descend(start, residual, cost, aim, problems, (low, high))


def _descend(
    at: Array, residual: Array, cost: Array, aim: Array, problems: Problems, box: tuple[Array, Array]
) -> Array:
    damping = np.full(len(at), 1e-3)
    for _ in range(_STEPS):
        columns: Array = np.moveaxis(jacobian(at.T[..., None], problems.u), 0, 1) * problems.sw[:, None, :]
        normal = columns @ columns.transpose(0, 2, 1)
        right = np.matvec(columns, residual)
        diagonal = np.einsum("pii->pi", normal)
        diagonal *= (1 + damping)[:, None]
        diagonal += 1e-9 * diagonal.max(axis=1)[:, None] + 1e-300
        normal[:, _C, :] = normal[:, :, _C] = 0.0
        normal[:, _C, _C], right[:, _C] = 1.0, 0.0
        scale = 1.0 / np.sqrt(np.einsum("pii->pi", normal))
        step = np.linalg.solve(normal * (scale[:, :, None] * scale[:, None, :]), (right * scale)[..., None])
        trial = np.clip(at + step[..., 0] * scale, *box)
        new = _residual(trial, aim, problems)
        new_cost = np.vecdot(new, new)
        better = new_cost < cost
        at[better], residual[better], cost[better] = trial[better], new[better], new_cost[better]
        damping = np.where(better, 0.2 * damping, 5.0 * damping)
    return at


_PARABOLA = 0.7  # of the expected rise of the cost: below, an interval would be too narrow to be true
_STRAIGHT = (0.25, 6.0)  # the same at the usual shape, where a parameter may be determined
_LEAST_RISE = 1e-2  # of it: an end goes no further out at once
_INSIDE = 0.98  # normalised: SA = 0 must lie between the rows
_REFITS = 2  # steps by which all else is fitted again where one parameter is held
_REFITS_AT_ZERO = 4  # the same where slope or value at SA = 0 is held, which bends more
_HELD = 10.0  # how much an end that is missed by half a width weighs beside the cost
_WIDE = 0.5  # half width of an interval, of what is natural: beyond, the data say next to nothing
_IDLE = 1.0  # the same at the estimate: beyond, an interval says nothing


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Spread:
    """Per curve, in normalised parameters (B, C, D, E, h, Sv): what the data say about each.

    ``theta`` (curves, 6); ``covariance`` (curves, 6, 6); ``determined`` ``at_bound`` (curves, 6); ``ends``
    (curves, 6, 2) of the intervals of 95 %, NaN where the bounds alone end one; ``error`` (curves, 6);
    ``slope`` ``value`` at SA = 0 with their standard errors, NaN where not determined (curves,); ``dof``
    (curves, 8) degrees of freedom of the errors of the six, of slope and of value.
    """

    theta: Array
    covariance: Array
    determined: NDArray[np.bool_]
    at_bound: NDArray[np.bool_]
    ends: Array
    error: Array
    slope: Array
    slope_se: Array
    value: Array
    value_se: Array
    dof: Array


def spread(solution: Solution, problems: Problems, *, zero: Array, noise: Noise) -> Spread:
    """Return what the data say about the parameters at a minimum.

    Parameters
    ----------
    zero : normalised slip angle of SA = 0 (curves,)
    noise : of the curves, with what autocorrelation leaves of their information
    """
    theta = theta_of(solution.state)
    low, high, width = _box(theta, problems)
    margin = 1e-6 * (high - low)
    at_bound = (theta <= low + margin) | (theta >= high - margin)
    columns = _columns(theta, problems)
    information = columns @ columns.transpose(0, 2, 1) / noise.variance[:, None, None]
    # What the bounds alone say keeps the inverse finite; it is negligible for what the data determine.
    bounds = np.eye(6) / (width * width)[:, :, None]
    # A parameter at its bound stays free here: the others would else look better known than they are.
    plain = _inverse(information + bounds)
    covariance, largest = plain, noise.variance
    if len(noise.coloured):
        covariance, largest = plain.copy(), largest.copy()
        covariance[noise.coloured] = _inverse(noise.information + bounds[noise.coloured])
        largest[noise.coloured] = noise.largest
    at_zero, level = slope(theta.T, zero), value(theta.T, zero)
    gradients = np.stack([slope_jacobian(theta.T, zero).T, jacobian(theta.T, zero).T])
    slope_se, value_se = np.sqrt(np.maximum(np.vecdot(gradients, np.matvec(covariance, gradients)), 0.0))
    dof = np.repeat(noise.dof[:, None], 8, axis=1)
    common = np.array([coverage_factor(float(dof)) for dof in noise.dof])
    factor = np.repeat(common[:, None], 8, axis=1)
    if len(noise.coloured):
        asked = np.concatenate(
            [np.broadcast_to(np.eye(6), (len(theta), 6, 6)), gradients.transpose(1, 0, 2)], 1
        )
        dof[noise.coloured] = noise.dof_of(asked[noise.coloured])
        factor[noise.coloured] = np.vectorize(coverage_factor)(dof[noise.coloured])
    linear = np.sqrt(np.maximum(np.einsum("pii->pi", covariance), 0.0))
    half = factor[:, :6] * linear
    coarse = compress(problems)
    alone = plain / noise.variance[:, None, None]
    rise = _rise(theta, alone, half, coarse, low, high)
    rival = (solution.excess <= (common * common * largest)[:, None])[..., None]
    sides = _sides(half, rise, np.where(rival, solution.rivals - theta[:, None, :], 0.0))
    ends = np.stack([theta - sides[0], theta + sides[1]], axis=-1)
    closed = np.stack([ends[..., 0] > low + margin, ends[..., 1] < high - margin], axis=-1)
    wide = 0.5 * (np.minimum(sides[0], theta - low) + np.minimum(sides[1], high - theta))
    # Student's t of one degree of freedom has no spread that an error could be.
    determined = ~at_bound & (wide <= _IDLE * _natural(theta)) & (dof[:, :6] > 1)
    # Autocorrelation widens an interval at the usual shape by as much as at the estimate.
    colour = linear / np.sqrt(np.maximum(np.einsum("pii->pi", plain), 1e-300))
    usual = at_usual_shape(theta, coarse, low, high)
    there = _columns(usual, coarse)
    width = _box(usual, problems)[2]
    asked = _inverse(
        there @ there.transpose(0, 2, 1) / noise.variance[:, None, None]
        + np.eye(6) / (width * width)[:, :, None]
    )
    reach = factor[:, :6] * colour * np.sqrt(np.maximum(np.einsum("pii->pi", asked), 0.0))
    determined &= (usual - reach >= low) & (usual + reach <= high) & (reach <= _WIDE * _natural(usual))
    bent = _rise(usual, asked / noise.variance[:, None, None], reach, coarse, low, high)
    # B, C and E move together along a ridge that bends; D and the shifts do not.
    straight = ((bent >= _STRAIGHT[0]) & (bent <= _STRAIGHT[1])).all(axis=0)
    determined &= straight | np.array([False, False, True, False, True, True])
    # Rows of one sign leave the shifts to the model, and all else moves with them: of the few intervals that
    # would pass three quarters cover.
    determined &= (np.abs(zero) <= _INSIDE)[:, None]
    closed &= (np.abs(zero) <= _INSIDE)[:, None, None]
    reach = factor[:, 6:] * np.stack([slope_se, value_se], axis=1)
    held = _rise_at_zero(theta, alone, gradients.transpose(1, 0, 2), reach, zero, coarse, low, high)
    at_rivals = np.where(
        rival[..., 0],
        np.stack([
            slope(solution.rivals.transpose(2, 0, 1), zero[:, None]) - at_zero[:, None],
            value(solution.rivals.transpose(2, 0, 1), zero[:, None]) - level[:, None],
        ]),
        0.0,
    )  # fmt: skip
    # One half width serves both sides: the longer one.
    longest = np.maximum(*_sides(reach, held, np.moveaxis(at_rivals, 0, 2)))
    slope_se, value_se = (longest / factor[:, 6:]).T
    # Beyond the data a curve is an extrapolation of the model, whatever its covariance says.
    # Slope and value need rows on both sides: at their end the linear interval covers 85 % and not 95 %.
    slope_ok = (np.abs(zero) <= 0.95) & (factor[:, 6] * slope_se <= _WIDE * np.abs(at_zero))
    value_ok = (np.abs(zero) <= _INSIDE) & (factor[:, 7] * value_se <= _WIDE)
    return Spread(
        theta=theta,
        covariance=covariance,
        determined=determined,
        at_bound=at_bound,
        ends=np.where(closed, ends, np.nan),
        error=np.maximum(wide / factor[:, :6], 0.0),
        slope=at_zero,
        slope_se=np.where(slope_ok, slope_se, np.nan),
        value=level,
        value_se=np.where(value_ok, value_se, np.nan),
        dof=dof,
    )


def curve_columns(solution: Solution, problems: Problems) -> Array:
    """Return the weighted derivatives of every curve by its six parameters (curves, 6, points)."""
    return _columns(theta_of(solution.state), problems)


def _box(theta: Array, problems: Problems) -> tuple[Array, Array, Array]:
    # Bounds of the six normalised parameters, and the standard deviation of "anywhere within them".
    flat = np.ones(len(theta))
    h_low, h_high = problems.low[:, 3], problems.high[:, 3]
    low = np.stack(
        [flat * SPAN_LOW / 2, flat * C_LOW, -D_LIMIT * flat, E_LOW * flat, h_low, -SV_LIMIT * flat], axis=1
    )
    high = np.stack(
        [flat * SPAN_HIGH / 2, flat * C_HIGH, D_LIMIT * flat, E_HIGH * flat, h_high, SV_LIMIT * flat], axis=1
    )
    width = (high - low) / np.sqrt(12.0)
    # B is a scale: its width is one of ratios, ln(50/0.05)/sqrt(12) = 2 times B itself.
    width[:, 0] = theta[:, 0] * np.log(SPAN_HIGH / SPAN_LOW) / np.sqrt(12.0)
    return low, high, width


def _natural(theta: Array) -> Array:
    # What is natural for each parameter (curves, 6).
    natural = np.ones_like(theta)
    natural[:, :3], natural[:, 3] = np.abs(theta[:, :3]), E_TOP - theta[:, 3]
    return natural


def _sides(half: Array, rise: Array, away: Array) -> tuple[Array, Array]:
    # How far intervals reach below and above (curves, 6): as far as the cost rises as it should, and to every
    # other minimum ``away`` (curves, rivals, 6) that the noise cannot tell from the lowest.
    further = np.sqrt(np.maximum(_PARABOLA / np.maximum(rise, _LEAST_RISE), 1.0))
    below = np.maximum(half * further[1], -away.min(axis=1))
    above = np.maximum(half * further[0], away.max(axis=1))
    return below, above


def _rise(theta: Array, inverse: Array, half: Array, problems: Problems, low: Array, high: Array) -> Array:
    # How far the curve has moved, of what the linear propagation says, at both ends of every parameter's
    # interval, all else fitted again: (above and below, curves, 6). Bin means serve for long curves: their
    # rows' places count, not their values, for the curve is held against itself.
    curves = len(theta)
    variances = np.maximum(np.einsum("pii->pi", inverse), 1e-300)
    # Along its own row of the inverse normal matrix a parameter moves with all else where the parabola wants
    # it, and the cost rises by the square of its move over its own entry.
    step = inverse * (half / variances)[:, :, None]
    # Where rounding leaves no interval the cost cannot rise as it should.
    expected = np.where(half > 0, half * half / variances, np.inf)
    moved = np.stack([theta[:, None] + step, theta[:, None] - step])  # (ends, curves, held, 6)
    moved = np.clip(moved, low[:, None], high[:, None]).reshape(-1, 6)
    repeat = np.tile(np.repeat(np.arange(curves), 6), 2)
    held = np.tile(np.arange(6), 2 * curves)
    places = np.arange(len(held))
    part, low, high = problems.take(repeat), low[repeat], high[repeat]
    aim = value(theta.T[..., None], problems.u)[repeat]
    residual = _residual(moved, aim, part)
    cost = np.vecdot(residual, residual)
    for _ in range(_REFITS):
        columns = _columns(moved, part)
        normal = columns @ columns.transpose(0, 2, 1)
        diagonal = np.einsum("pii->pi", normal)
        diagonal[...] += 1e-9 * diagonal.max(axis=1)[:, None] + 1e-300
        right = np.matvec(columns, residual)
        # The held parameter has a row and column of the unit matrix: it stays.
        normal[places, held, :] = normal[places, :, held] = 0.0
        normal[places, held, held] = 1.0
        right[places, held] = 0.0
        trial = np.clip(moved + _solve(normal, right), low, high)
        new = _residual(trial, aim, part)
        new_cost = np.vecdot(new, new)
        better = new_cost < cost
        moved[better], residual[better], cost[better] = trial[better], new[better], new_cost[better]
    rise: Array = cost.reshape(2, curves, 6) / expected
    return rise


def _rise_at_zero(
    theta: Array,
    inverse: Array,
    gradients: Array,
    half: Array,
    zero: Array,
    problems: Problems,
    low: Array,
    high: Array,
) -> Array:
    # The same for slope and value at SA = 0 (above and below, curves, 2), each held at the ends of its
    # interval while all parameters are fitted again: steps of Gauss and Newton, the condition linearised.
    curves = len(theta)
    moved_by = np.matvec(inverse[:, None], gradients)  # (curves, 2, 6)
    variances = np.maximum(np.vecdot(gradients, moved_by), 1e-300)
    step = moved_by * (half / variances)[..., None]
    moved = np.stack([theta[:, None] + step, theta[:, None] - step])
    moved = np.clip(moved, low[:, None], high[:, None]).reshape(-1, 6)
    repeat = np.tile(np.repeat(np.arange(curves), 2), 2)
    of_slope = np.tile(np.array([True, False]), 2 * curves)
    part, low, high, at = problems.take(repeat), low[repeat], high[repeat], zero[repeat]
    aim = value(theta.T[..., None], problems.u)[repeat]

    def quantity(values: Array) -> Array:
        return np.asarray(np.where(of_slope, slope(values.T, at), value(values.T, at)))

    start = quantity(theta[repeat])
    width = np.maximum(np.concatenate([half.ravel(), half.ravel()]), 1e-300)
    side = np.repeat([1.0, -1.0], 2 * curves)
    target = start + side * width
    expected = np.tile((half * half / variances).ravel(), 2)
    expected = np.where(expected > 0, expected, np.inf)
    residual = _residual(moved, aim, part)
    cost, off = np.vecdot(residual, residual), (target - quantity(moved)) / width
    for _ in range(_REFITS_AT_ZERO):
        columns = _columns(moved, part)
        normal = columns @ columns.transpose(0, 2, 1)
        diagonal = np.einsum("pii->pi", normal)
        diagonal[...] += 1e-9 * diagonal.max(axis=1)[:, None] + 1e-300
        a = np.where(of_slope[:, None], slope_jacobian(moved.T, at).T, jacobian(moved.T, at).T)
        free, along = _solve(normal, np.matvec(columns, residual)), _solve(normal, a)
        pull = (off * width - np.vecdot(a, free)) / np.maximum(np.vecdot(a, along), 1e-300)
        trial = np.clip(moved + free + pull[:, None] * along, low, high)
        new = _residual(trial, aim, part)
        new_cost, new_off = np.vecdot(new, new), (target - quantity(trial)) / width
        better = new_cost / expected + _HELD * new_off**2 < cost / expected + _HELD * off**2
        moved[better], residual[better] = trial[better], new[better]
        cost[better], off[better] = new_cost[better], new_off[better]
    # What did not reach the end has risen by the square of its way.
    reached = np.maximum(1 - side * off, 0.1)
    rise: Array = (cost / expected / reached**2).reshape(2, curves, 2)
    return rise


def _columns(theta: Array, problems: Problems) -> Array:
    # The weighted Jacobian (curves, 6, points).
    columns: Array = np.moveaxis(jacobian(theta.T[..., None], problems.u), 0, 1) * problems.sw[:, None, :]
    return columns


def _residual(theta: Array, aim: Array, problems: Problems) -> Array:
    residual: Array = (aim - value(theta.T[..., None], problems.u)) * problems.sw
    return residual


def _solve(matrix: Array, right: Array) -> Array:
    scale = 1.0 / np.sqrt(np.einsum("pii->pi", matrix))
    unit = matrix * (scale[:, :, None] * scale[:, None, :])
    result: Array = np.linalg.solve(unit, (right * scale)[..., None])[..., 0] * scale
    return result


def _inverse(matrix: Array) -> Array:
    scale = 1.0 / np.sqrt(np.einsum("pii->pi", matrix))
    unit = matrix * (scale[:, :, None] * scale[:, None, :])
    result: Array = np.linalg.inv(unit) * (scale[:, :, None] * scale[:, None, :])
    return result
