"""What all rows of a test share: the coefficients of one record, the zero of the slip angle.

A characteristic is, to first order, a weighted sum of conditions. The record's coefficients are the same
in every one of them, so their uncertainty goes through the weighted sum of the sensitivities, not through
the conditions one by one: it cancels in a difference of equal readings and adds in a sum.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.apply import coefficient_jacobian
from toolkit.channels import signs
from toolkit.units import si_scale

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.channels import Axes
    from toolkit.calibration.record import CalibrationRecord
    from toolkit.characteristics.groups import Group
    from toolkit.reduction.model import Condition

Weighted = Sequence[tuple["Condition", float]]


def calibration_u(
    record: CalibrationRecord | None, channel: str, parts: Weighted, *, machine_axes: Axes
) -> float:
    """Return the standard uncertainty [SI] that the record's covariance gives a weighted sum.

    Parameters
    ----------
    record : the record that computed the rows; None or one without a covariance contributes zero
    channel : ``FY`` or ``MZ``
    parts : (condition, weight) of the sum, the conditions' values in SAE axes
    machine_axes : the axes of the cells, whose signs the sensitivities have
    """
    if record is None or not parts:
        return 0.0
    fit = next(one for one in record.loads if one.load == channel)
    covariance = np.asarray(fit.covariance, dtype=np.float64)
    if covariance.size == 0:
        return 0.0
    total = np.zeros(len(fit.terms))
    for condition, weight in parts:
        sign = signs(machine_axes, "SAE", condition.rotation)[channel]
        row = {name: np.array([v]) for name, v in zip(record.indications, condition.indications, strict=True)}
        total += weight * sign * coefficient_jacobian(record, channel, row, None)[0]
    variance = float(total @ covariance @ total)
    return float(np.sqrt(max(variance, 0.0))) * si_scale(fit.unit)


def weights_at_zero(group: Group) -> tuple[tuple[Condition, float], ...]:
    """Return the weights of the line through the two conditions nearest to SA = 0, one on each side.

    They stand for the fitted curve's own weights there; empty where the angles have one sign only.
    """
    SA = group.SA
    if len(SA) < 2 or SA[0] > 0 or SA[-1] < 0:
        return ()
    right = int(np.clip(np.searchsorted(SA, 0.0), 1, len(SA) - 1))
    left = right - 1
    share = -float(SA[left]) / float(SA[right] - SA[left])
    return ((group.conditions[left], 1 - share), (group.conditions[right], share))


def line_at_zero(group: Group, channel: str) -> float | None:
    """Return the value at SA = 0 of the line through the nearest conditions: a check on the curve."""
    parts = weights_at_zero(group)
    if not parts:
        return None
    return sum(w * (c.FY_common if channel == "FY" else c.MZ_common) for c, w in parts)


def slope_weights(group: Group) -> tuple[tuple[Condition, float], ...]:
    """Return the weights of the least-squares slope through the conditions within 2 deg of SA = 0."""
    near = [c for c in group.conditions if abs(c.SA) <= np.radians(2.0)]
    if len(near) < 2:
        return ()
    SA: NDArray[np.float64] = np.array([c.SA for c in near])
    rest = SA - SA.mean()
    return tuple(zip(near, (rest / (rest @ rest)).tolist(), strict=True))
