"""Cornering and aligning stiffness: the +-1 deg secant (thesis, SAE) and the slope of the curve.

In SAE axes FY falls and MZ rises with the slip angle: cornering stiffness is -dFY/dSA and aligning
stiffness +dMZ/dSA, both positive. The secant is biased low against the slope at zero (-6 to -0.3 % on a
passenger tire) because the curve bends.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from toolkit.characteristics.model import DirectionFit, Stiffness
from toolkit.characteristics.shared import Shared, slope_weights
from toolkit.estimate import Estimate, effective_dof
from toolkit.tires.evaluate import slope_estimate_at, value_at

if TYPE_CHECKING:
    from toolkit.characteristics.groups import Group
    from toolkit.tires.model import CurveFit

_SIGN = {"FY": -1.0, "MZ": 1.0}
_UNIT = {"FY": "N/rad", "MZ": "N*m/rad"}


def stiffness(group: Group, fit: DirectionFit, *, shared: Shared) -> Stiffness:
    """Return both stiffnesses of one load and direction, by secant and by slope [N/rad, N·m/rad]."""
    return Stiffness(
        load_N=group.load_N,
        rotation=group.rotation,
        secant_cornering=_secant(group, fit.FY, "FY", shared=shared),
        secant_aligning=_secant(group, fit.MZ, "MZ", shared=shared),
        slope_cornering=_slope(group, fit.FY, "FY", shared=shared),
        slope_aligning=_slope(group, fit.MZ, "MZ", shared=shared),
    )


def _secant(group: Group, fit: CurveFit | None, channel: str, *, shared: Shared) -> Estimate | None:
    """Return (y(1 deg) - y(-1 deg)) / 2 deg from the measured steps.

    A steering zero moves both steps; each value is carried from its measured angle to the step's along
    the fitted curve, so that the secant is that of the definition. Without a curve the measured span is
    used as it is.
    """
    plus, minus = group.step(1.0), group.step(-1.0)
    if plus is None or minus is None or plus.SA <= minus.SA:
        return None
    is_force = channel == "FY"
    values = np.array([c.FY_common if is_force else c.MZ_common for c in (plus, minus)])
    own = np.array([c.u_FY_common if is_force else c.u_MZ_common for c in (plus, minus)])
    angles = np.array([plus.SA, minus.SA])
    if fit is not None:
        steps = np.radians([1.0, -1.0])
        values = values + value_at(fit, steps) - value_at(fit, angles)
        angles = steps
    span = float(angles[0] - angles[1])
    slope = float(values[0] - values[1]) / span
    common = shared.common_u(channel, ((plus, 1 / span), (minus, -1 / span)))
    # The zero of the slip angle cancels in the span; what is left of the angle is its scatter.
    scatter = slope * np.hypot(plus.sd_SA, minus.sd_SA)
    u = float(np.sqrt(own @ own + scatter**2)) / span
    return Estimate(value=_SIGN[channel] * slope, u=float(np.hypot(u, common)), unit=_UNIT[channel])


def _slope(group: Group, fit: CurveFit | None, channel: str, *, shared: Shared) -> Estimate | None:
    if fit is None or "slope_at_zero" in fit.not_determined or fit.slope_at_zero is None:
        return None
    one = slope_estimate_at(fit, 0.0)
    common = shared.common_u(channel, slope_weights(group))
    return Estimate(
        value=_SIGN[channel] * one.value,
        u=float(np.hypot(one.u, common)),
        unit=_UNIT[channel],
        dof=effective_dof([(one.u, one.dof), (common, np.inf)]) if one.u or common else one.dof,
    )
