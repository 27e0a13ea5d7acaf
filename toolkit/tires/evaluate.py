"""Read a fitted curve: values, slopes and zero crossings with their standard uncertainty.

The slope of any model's curve at a slip angle is the limit of its difference quotient. A brush, TMeasy or
LuGre tire has terms in |slip|: its curve has a slope at zero, but the chord over +-h departs from it in
proportion to h, by percents on a stiff tire with little friction. Chords over smaller and smaller h are
therefore extrapolated to h = 0, with all powers of h since |slip| brings the odd ones too (Richardson 1911);
of all extrapolations that is taken which is nearest to those that it came from (Ridders, Advances in
Engineering Software 4 (1982) 75).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from toolkit.arrays import Array
from toolkit.estimate import Estimate
from toolkit.tires.global_model import GlobalModel, Rows
from toolkit.tires.model import CHANNEL_UNIT, CurveFit
from toolkit.tires.models import model
from toolkit.tires.recorded import as_array

_REACH = math.radians(20.0)  # a crossing further out is no property of the tire near zero slip


def value_at(fit: CurveFit, SA: ArrayLike) -> Array:
    """Return the fitted FY [N] or MZ [N·m] at slip angles [rad], of any shape."""
    return model(fit.model).value(fit.values, SA)


def slope_at(fit: CurveFit, SA: ArrayLike) -> Array:
    """Return the fitted slope [N/rad or N·m/rad] at slip angles [rad], of any shape."""
    return model(fit.model).slope(fit.values, SA)


def estimate_at(fit: CurveFit, SA: float) -> Estimate:
    """Return the fitted value at one slip angle [rad] with its standard uncertainty (delta method)."""
    gradient = model(fit.model).jacobian(fit.values, SA)
    return _estimate(fit, float(value_at(fit, SA)), gradient, CHANNEL_UNIT[fit.channel])


def slope_estimate_at(fit: CurveFit, SA: float) -> Estimate:
    """Return the fitted slope at one slip angle [rad] with its standard uncertainty (delta method)."""
    gradient = model(fit.model).slope_jacobian(fit.values, SA)
    return _estimate(fit, float(slope_at(fit, SA)), gradient, f"{CHANNEL_UNIT[fit.channel]}/rad")


def zero_crossing(fit: CurveFit) -> Estimate | None:
    """Return the slip angle [rad] nearest 0 at which the fitted curve is zero.

    None where the curve has no zero within 20 deg. The uncertainty is that of the value there
    over the slope there.
    """
    grid = np.linspace(-_REACH, _REACH, 801)
    y = value_at(fit, grid)
    brackets = np.flatnonzero(np.sign(y[:-1]) * np.sign(y[1:]) <= 0)
    if not len(brackets):
        return None
    at = brackets[np.argmin(np.abs(0.5 * (grid[brackets] + grid[brackets + 1])))]
    low, high = float(grid[at]), float(grid[at + 1])
    SA = 0.5 * (low + high)
    rising = float(y[at + 1]) > float(y[at])
    for _ in range(80):
        force, slope = float(value_at(fit, SA)), float(slope_at(fit, SA))
        if (force > 0) == rising:
            high = SA
        else:
            low = SA
        step = SA - force / slope if slope else math.nan
        # Newton where it stays inside the bracket, else halve: the crossing cannot be lost.
        following = step if low <= step <= high else 0.5 * (low + high)
        if abs(following - SA) < 1e-15:
            SA = following
            break
        SA = following
    slope = float(slope_at(fit, SA))
    if slope == 0:
        return None
    value = estimate_at(fit, SA)
    return Estimate(value=SA, u=value.u / abs(slope), unit="rad", dof=value.dof)


def _estimate(fit: CurveFit, value: float, gradient: Array, unit: str) -> Estimate:
    variance = float(gradient @ np.asarray(fit.covariance) @ gradient)
    at_zero = fit.value_at_zero or fit.slope_at_zero
    return Estimate(
        value=value,
        u=math.sqrt(max(variance, 0.0)),
        unit=unit,
        dof=at_zero.dof if at_zero is not None else float(fit.dof),
    )


_WIDEST = 1e-3  # rad
_PART = 4.0  # each chord is so many times shorter than the one before
_CHORDS = 9  # down to 1.5e-8 rad: shorter than any zero error, and long beside the rounding of a double


def limit_slope(curve: Callable[[Array], Any], at: float = 0.0) -> Array:
    """Return the slope of a curve at a slip angle [rad], (...) for a curve (..., n) of angles (n,).

    A kink of the curve itself, where no slope exists, gives the mean of both sides.

    >>> round(float(limit_slope(lambda s: 2 * s - 50 * s * abs(s))), 9)
    2.0
    """
    half = _WIDEST / _PART ** np.arange(_CHORDS)
    values = as_array(curve(np.concatenate([at + half, at - half])))
    # The angles as they were rounded, so that their distance is exact.
    width = (at + half) - (at - half)
    column = np.moveaxis((values[..., :_CHORDS] - values[..., _CHORDS:]) / width, -1, 0)
    best, spread = column[-1], np.full(column.shape[1:], np.inf)
    for power in range(1, _CHORDS):
        gain = _PART**power
        finer = (gain * column[1:] - column[:-1]) / (gain - 1)
        for before, after, extrapolated in zip(column[:-1], column[1:], finer, strict=True):
            distance = np.maximum(np.abs(extrapolated - before), np.abs(extrapolated - after))
            nearer = distance < spread
            best, spread = np.where(nearer, extrapolated, best), np.where(nearer, distance, spread)
        column = finer
    return as_array(best)


def stiffness(model: GlobalModel, values: Sequence[Any], *, load: float, like: Rows, channel: str) -> Array:
    """Return dY/dSA at SA = 0 [N/rad, N·m/rad] in the model's axes, upright, free rolling, nominal otherwise.

    Parameters
    ----------
    values : parameters as `GlobalModel.forces` takes them, one value or a column (copies, 1) each
    load : [N]
    like : whose nominal load, pressure, speed and radius are taken
    """

    def curve(SA: Array) -> Array:
        with np.errstate(all="ignore"):
            return model.forces(values, like.other(SA, load))[channel]

    return limit_slope(curve)
