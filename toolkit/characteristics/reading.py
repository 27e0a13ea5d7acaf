"""Read values off the curves of one direction and load, with every part of their uncertainty.

What is read off a fitted curve is, to first order, a weighted sum of the conditions that it was fitted to:
with J the model's derivatives at the conditions and g those of what is read, the weights are g J^+ (Gauss's
normal equations, solved in the tangent plane). Whatever moves a condition moves the reading by its weight.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from toolkit.characteristics.shared import Shared
from toolkit.characteristics.uncertain import Part, Uncertain, merged, weighted
from toolkit.estimate import Estimate
from toolkit.tires.catalog import model
from toolkit.tires.evaluate import estimate_at, slope_at, slope_estimate_at, value_at, zero_crossing

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.characteristics.groups import Group
    from toolkit.characteristics.model import DirectionFit
    from toolkit.tires.model import CurveFit

Channel = Literal["FY", "MZ"]
CHANNELS: tuple[Channel, Channel] = ("FY", "MZ")
UNIT = {"FY": "N", "MZ": "N*m"}
# Singular values of the scaled derivatives below this part of the largest are directions without data.
_NO_DATA = 1e-8


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Direction:
    """One direction's conditions and curves at one load; a curve is None where it could not be fitted."""

    group: Group
    fit: DirectionFit

    def curve(self, channel: Channel) -> CurveFit | None:
        """Return the fitted curve of a channel."""
        return self.fit.FY if channel == "FY" else self.fit.MZ


class Reader:
    """Reads one direction; what its conditions share is computed once."""

    def __init__(self, direction: Direction, *, shared: Shared) -> None:
        self.direction, self.shared = direction, shared
        self.group = direction.group
        conditions = self.group.conditions
        self._calibration = {c: shared.calibration_rows(c, conditions) for c in CHANNELS}
        self._zero = {c: shared.zero_rows(c, conditions) for c in CHANNELS}
        # A tare of each file is a shift of that file alone.
        own = np.zeros(len(conditions))
        self._tares = {"FY": own, "MZ": own}
        if shared.tared and not shared.u_cell_zero:
            self._tares = {
                "FY": np.array([one.u_FY_zero for one in conditions]),
                "MZ": np.array([one.u_MZ_zero for one in conditions]),
            }
        self._pseudo: dict[Channel, NDArray[np.float64]] = {}

    def covers_zero(self) -> bool:
        """Tell whether slip angles lie on both sides of zero."""
        SA = self.group.SA
        return len(SA) > 1 and bool(SA[0] <= 0.0 <= SA[-1])

    def value(self, channel: Channel, SA: float) -> Uncertain | None:
        """Return the curve's value at a slip angle [rad]; None without a curve."""
        fit = self.direction.curve(channel)
        if fit is None:
            return None
        slope = float(slope_at(fit, SA))
        gradient = model(fit.model).jacobian(fit.values, SA)
        return self._read(
            channel,
            estimate_at(fit, SA),
            self._weights(channel, fit, gradient),
            f"value at {SA:.9g}",
            self.shared.angle_parts(slope, slope * SA),
        )

    def slope(self, channel: Channel) -> Uncertain | None:
        """Return the curve's slope at SA = 0 [per rad]; None where the data do not determine it."""
        fit = self.direction.curve(channel)
        if fit is None or "slope_at_zero" in fit.not_determined or fit.slope_at_zero is None:
            return None
        gradient = model(fit.model).slope_jacobian(fit.values, 0.0)
        one = slope_estimate_at(fit, 0.0)
        # A zero of the slip angle moves along the curve to where its slope is another one.
        step = 1e-4
        bend = (float(slope_at(fit, step)) - float(slope_at(fit, -step))) / (2 * step)
        return self._read(
            channel,
            one,
            self._weights(channel, fit, gradient),
            "slope at 0",
            self.shared.angle_parts(bend, one.value),
        )

    def secant(self, channel: Channel) -> Uncertain | None:
        """Return (y(1 deg) - y(-1 deg)) / 2 deg [per rad] from the measured steps.

        A steering zero moves both steps; each value is carried from its measured angle to the step's along
        the fitted curve, so that the secant is that of the definition. Without a curve the measured span
        is used as it is. Repeats of a step count as their mean.
        """
        sides = (self.group.step(1.0), self.group.step(-1.0))
        if not all(sides):
            return None
        SA, y = self.group.SA, self.group.values(channel)
        weights = np.zeros(len(SA))
        for places, sign in zip(sides, (1.0, -1.0), strict=True):
            weights[list(places)] = sign / len(places)
        span = float(weights @ SA)
        if span <= 0:
            return None
        fit = self.direction.curve(channel)
        one = float(np.radians(1.0))
        if fit is not None:
            steps = np.where(weights > 0, one, -one)
            y = y + value_at(fit, steps) - value_at(fit, SA)
            span = 2 * one
        slope = float(weights @ y) / span
        # What an error of the angle does to the two ends, by the slopes there; by the chord without a curve.
        ends = (slope, slope) if fit is None else slope_at(fit, np.array([one, -one])).tolist()
        # The zero of the slip angle cancels in the span; what is left of the angle is its scatter.
        scatter = np.array([c.sd_SA for c in self.group.conditions])
        parts = [
            *self.shared.angle_parts((ends[0] - ends[1]) / span, (ends[0] + ends[1]) / 2),
            self._own(channel, "slip angle scatter", "secant", slope * _norm(weights * scatter) / span),
        ]
        u = _norm(weights * self.group.own_u(channel)) / span
        estimate = Estimate(value=slope, u=u, unit=f"{UNIT[channel]}/rad")
        return self._read(channel, estimate, weights / span, "secant", parts)

    def chord(self, channel: Channel) -> Uncertain | None:
        """Return the +-1 deg secant [per rad] off the curve alone, for data without steps of a protocol."""
        fit = self.direction.curve(channel)
        one = float(np.radians(1.0))
        SA = self.group.SA
        if fit is None or SA[0] > -one or SA[-1] < one:
            return None
        at = model(fit.model)
        gradient = (at.jacobian(fit.values, one) - at.jacobian(fit.values, -one)) / (2 * one)
        low, high = value_at(fit, np.array([-one, one])).tolist()
        left, right = slope_at(fit, np.array([-one, one])).tolist()
        slope = (high - low) / (2 * one)
        u = float(np.sqrt(max(float(gradient @ np.asarray(fit.covariance) @ gradient), 0.0)))
        dof = estimate_at(fit, 0.0).dof
        estimate = Estimate(value=slope, u=u, unit=f"{UNIT[channel]}/rad", dof=dof)
        parts = self.shared.angle_parts((right - left) / (2 * one), (right + left) / 2)
        return self._read(channel, estimate, self._weights(channel, fit, gradient), "chord", parts)

    def moment_without_force(self) -> Uncertain | None:
        """Return MZ where the direction's own FY is zero: the residual aligning torque.

        An error of FY moves the angle at which it is read, by dMZ/dFY along the curves; a zero of the slip
        angle moves both curves alike and cancels.
        """
        FY = self.direction.curve("FY")
        crossing = None if FY is None or not self.covers_zero() else zero_crossing(FY)
        if FY is None or crossing is None:
            return None
        moment, force = self.value("MZ", crossing.value), self.value("FY", crossing.value)
        fit = self.direction.curve("MZ")
        if moment is None or force is None or fit is None:
            return None
        stiffness = float(slope_at(FY, crossing.value))
        if not stiffness:
            return None
        ratio = float(slope_at(fit, crossing.value)) / stiffness
        # Their sum has the value of MZ alone: FY is zero there but for rounding.
        moved = Uncertain(value=0.0, unit=moment.unit, parts=force.parts)
        return weighted([(1.0, moment), (-ratio, moved)])

    def _weights(self, channel: Channel, fit: CurveFit, gradient: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return d reading / d condition (conditions,)."""
        if channel not in self._pseudo:
            jacobian = model(fit.model).jacobian(fit.values, self.group.SA)
            free = np.array([p.name not in fit.at_bound for p in fit.parameters])
            size = np.linalg.norm(jacobian, axis=1) * free
            scale = np.where(size > 0, 1 / np.where(size > 0, size, 1.0), 0.0)
            pseudo = np.linalg.pinv((jacobian * scale[:, None]).T, rcond=_NO_DATA)
            self._pseudo[channel] = scale[:, None] * pseudo
        return np.asarray(gradient @ self._pseudo[channel])

    def _read(
        self,
        channel: Channel,
        estimate: Estimate,
        weights: NDArray[np.float64],
        what: str,
        more: list[Part],
    ) -> Uncertain:
        shared = self.shared
        rows = _norm(weights * self.group.own_u(channel))
        # The fit's residuals hold the scatter of the rows already; where a curve follows its points more
        # closely than their own scatter allows, the scatter stands. Never both.
        rest = float(np.sqrt(max(estimate.u**2 - rows**2, 0.0)))
        return Uncertain(
            value=estimate.value,
            unit=estimate.unit,
            parts=merged([
                *shared.calibration_parts(channel, self._calibration[channel] @ weights),
                *shared.zero_parts(self._zero[channel] @ weights),
                self._own(channel, "tare", what, _norm(weights * self._tares[channel])),
                *more,
                self._own(channel, "repeatability", what, rows),
                self._own(channel, "fit", what, rest, estimate.dof),
            ]),
        )  # fmt: skip

    def _own(self, channel: str, source: str, what: str, u: float, dof: float = np.inf) -> Part:
        where = f"{self.shared.test}/{self.group.load_N:.6g}/{self.group.rotation}/{channel}/{what}"
        return Part(source=source, key=f"{source}/{where}", u=u, dof=dof)


def _norm(values: NDArray[np.float64]) -> float:
    return float(np.linalg.norm(values))
