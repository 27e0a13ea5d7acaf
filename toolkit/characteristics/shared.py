"""What all rows of a test share: the coefficients of one record, the zero of the slip angle.

A characteristic is, to first order, a weighted sum of conditions. The record's coefficients are the same
in every one of them, so their uncertainty goes through the weighted sum of the sensitivities, not through
the conditions one by one: it cancels in a difference of equal readings and adds in a sum. What the record's
session stated (reference standard, indications, drift of the zero, creep) is in their covariance: an error of
the scale stays in conicity and stiffness in proportion to their values, a shift of the zero goes where the
signs of the axes take it (`uncertainty.propagation`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.apply import coefficient_jacobian
from toolkit.calibration.uncertainty.propagation import record_covariance
from toolkit.channels import signs
from toolkit.reduction.tare import zero_shifts
from toolkit.units import si_scale

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.channels import Axes
    from toolkit.characteristics.groups import Group
    from toolkit.reduction.model import Condition

Weighted = Sequence[tuple["Condition", float]]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Shared:
    """What every row of a test has in common.

    ``record`` computed the rows (None where it is not at hand: its share is then zero); ``machine_axes``
    are the axes of its cells; ``tared`` says that a tare was subtracted; ``u_SA_zero`` [rad] is the
    standard uncertainty of the slip angle's zero, the same for both directions of rotation;
    ``u_cell_zero`` that of each cell's zero in the record's units, empty where a tare was subtracted.
    ``covariance`` of each load's coefficients follows from the record and what its session stated.
    """

    record: CalibrationRecord | None
    machine_axes: Axes
    tared: bool
    u_SA_zero: float
    u_cell_zero: tuple[float, ...] = ()
    covariance: Mapping[str, NDArray[np.float64]] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        found = {} if self.record is None else record_covariance(self.record)
        object.__setattr__(self, "covariance", MappingProxyType(found))

    def common_u(self, channel: str, parts: Weighted) -> float:
        """Return the standard uncertainty [SI] of a weighted sum that all rows have in common.

        The record's covariance, and the open zero of the cells where there is no tare.
        """
        return float(np.hypot(self.calibration_u(channel, parts), self.zero_u(channel, parts)))

    def zero_u(self, channel: str, parts: Weighted) -> float:
        """Return the share of the cells' open zeros [SI]: each moves every row, none of them alone."""
        if self.record is None or not parts or not self.u_cell_zero:
            return 0.0
        cells = np.array([condition.indications for condition, _ in parts]).T
        shifts = zero_shifts(self.record, cells, self.u_cell_zero)[channel]
        return float(np.linalg.norm(shifts @ self._weights(channel, parts)))

    def _weights(self, channel: str, parts: Weighted) -> NDArray[np.float64]:
        """Return the weights with the signs from SAE axes back to those of the cells."""
        return np.array(
            [w * signs(self.machine_axes, "SAE", condition.rotation)[channel] for condition, w in parts]
        )

    def calibration_u(self, channel: str, parts: Weighted) -> float:
        """Return the standard uncertainty [SI] that the record gives a weighted sum: fit and statements.

        Parameters
        ----------
        channel : ``FY`` or ``MZ``
        parts : (condition, weight) of the sum, the conditions' values in SAE axes
        """
        if self.record is None or not parts:
            return 0.0
        fit = self.record.load(channel)
        if channel not in self.covariance:
            return 0.0
        names = self.record.indications
        # The conditions hold tared means. A record whose intercept carries the zero of its session loses
        # that term with the tare, and the difference to a tare of zero says so.
        tare = dict.fromkeys(names, 0.0) if self.tared else None
        rows = {
            name: np.array([condition.indications[i] for condition, _ in parts])
            for i, name in enumerate(names)
        }
        total = self._weights(channel, parts) @ coefficient_jacobian(self.record, channel, rows, tare)
        variance = float(total @ self.covariance[channel] @ total)
        return float(np.sqrt(max(variance, 0.0))) * si_scale(fit.unit)


def weights_at_zero(group: Group) -> tuple[tuple[Condition, float], ...]:
    """Return the weights of the line through the two conditions nearest to SA = 0, one on each side.

    They stand for the fitted curve's own weights there; empty where the angles have one sign only.
    """
    return weights_at(group, 0.0)


def weights_at(group: Group, angle: float) -> tuple[tuple[Condition, float], ...]:
    """Return the weights of the line through the conditions on both sides of an angle [rad]; else empty."""
    SA = group.SA
    if len(SA) < 2 or SA[0] > angle or SA[-1] < angle:
        return ()
    right = int(np.clip(np.searchsorted(SA, angle), 1, len(SA) - 1))
    left = right - 1
    share = float(angle - SA[left]) / float(SA[right] - SA[left])
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
