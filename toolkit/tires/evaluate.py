"""Read a fitted curve: values, slopes and zero crossings with their standard uncertainty."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from toolkit.arrays import Array
from toolkit.estimate import Estimate
from toolkit.tires.model import CHANNEL_UNIT, CurveFit
from toolkit.tires.models import model

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
