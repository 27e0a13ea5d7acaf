"""Read values off the curves of one direction and load, with every part of their uncertainty.

What is read off a fitted curve is, to first order, a weighted sum of the conditions that it was fitted to:
with J the model's derivatives at the conditions and g those of what is read, the weights are g J^+ (Gauss's
normal equations, solved in the tangent plane). Whatever moves a condition moves the reading by its weight.

**Pull.** By symmetry conicity keeps FY and flips MZ under x -> -x; plysteer flips FY and keeps MZ under a
half turn about z. With F and R the values at SA = 0 in machine-fixed axes (cells in the carriage, the drum
reversed):

    conicity = (F + R)/2   plysteer = (F - R)/2   of FY
    CRAT     = (F - R)/2   PRAT     = (F + R)/2   of MZ

In axes that follow the travel, and where the tire is turned round on the hub in place of the drum, FY of the
reversed run has the other sign and MZ the same, so the same physics reads conicity = (F - R)/2 there. The
source document's own formulas take (F + R)/2 for CRAT and (F - R)/2 for PRAT on machine-fixed values; they
are given apart under its name. PRAT has two definitions there too: MZ at 0 deg, and MZ at FY = 0, which an
error of the steering zero does not move; each is given by symmetry and by the source document's formula.

Which zero cancels follows from the axes. A zero of the slip angle moves FY of both runs by dFY/dSA in axes
that follow the travel: it is whole in plysteer = (F + R)/2 and cancels in conicity = (F - R)/2. A zero of
the cells, fixed in the machine, is turned with the axes of the reversed run: it cancels in plysteer and is
whole in conicity. With the tire turned round on the hub nothing turns the cells: both zeros are whole in
plysteer, and cancel in conicity.

**Stiffness.** In SAE axes FY falls and MZ rises with the slip angle: cornering stiffness is -dFY/dSA and
aligning stiffness +dMZ/dSA, both positive. The secant is biased low against the slope at zero (-6 to -0.3 %
on a passenger tire) because the curve bends.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace

import numpy as np

from toolkit.arrays import Array
from toolkit.characteristics.characteristic import Characteristic, Need
from toolkit.characteristics.groups import CHANNELS, Channel, Direction, DirectionFit
from toolkit.characteristics.scatter import Scatter, weights_of
from toolkit.characteristics.shared_errors import SharedErrors
from toolkit.characteristics.uncertain import Part, Uncertain, merged, weighted
from toolkit.estimate import Estimate
from toolkit.tires.evaluate import estimate_at, slope_at, value_at, zero_crossing
from toolkit.tires.models import model

UNIT = {"FY": "N", "MZ": "N*m"}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Reading:
    # One channel's reading: its value with the u of the curve's own covariance, d reading / d condition, and
    # what the slip angle's zero and scale do to it. Off the curve it has the errors of the curve's form, as
    # they are at the slip angle ``at`` [rad] where it is a value there.
    channel: Channel
    estimate: Estimate
    weights: Array
    angle: tuple[Part, ...]
    off_curve: bool = True
    at: float | None = None


class Reader:
    """Reads one direction; what its conditions share is computed once.

    ``scatter`` is that of the conditions about all curves of the test; without it each curve's own
    covariance stands for it, as for a table whose rows follow one another. ``stepped`` False says that the
    data are no steps of a protocol: a secant is then that of the curve.
    """

    def __init__(
        self,
        direction: Direction,
        *,
        shared: SharedErrors,
        scatter: Scatter | None = None,
        stepped: bool = True,
    ) -> None:
        self.direction, self.shared, self.scatter, self.stepped = direction, shared, scatter, stepped
        self.group = direction.group
        conditions = self.group.conditions
        self._calibration = {c: shared.calibration_rows(c, conditions) for c in CHANNELS}
        self._zero = {c: shared.zero_rows(c, conditions) for c in CHANNELS}
        # A tare of each file is a shift of that file alone.
        zeros = np.zeros(len(conditions))
        self._tares = {"FY": zeros, "MZ": zeros}
        if shared.tared and not shared.u_cell_zero:
            self._tares = {
                "FY": np.array([condition.u_FY_zero for condition in conditions]),
                "MZ": np.array([condition.u_MZ_zero for condition in conditions]),
            }
        self._pseudo: dict[Channel, Array] = {}
        # Several characteristics are made of the values at SA = 0 and of MZ where FY is zero.
        self._at_zero: dict[Channel, Uncertain | None] = {}
        self._residual: list[Uncertain | None] = []

    def on_curves(self, fit: DirectionFit) -> Reader:
        """Return a reader of the same conditions off other curves."""
        other = copy.copy(self)
        other.direction = replace(self.direction, fit=fit)
        other._pseudo, other._at_zero, other._residual = {}, {}, []
        return other

    def covers_zero(self) -> bool:
        """Tell whether slip angles lie on both sides of zero."""
        return self.group.covers_zero()

    def value(self, channel: Channel, SA: float) -> Uncertain | None:
        """Return the curve's value at a slip angle [rad]; None without a curve."""
        if SA == 0.0 and channel in self._at_zero:
            return self._at_zero[channel]
        reading = self._value(channel, SA)
        number = None if reading is None else self._read(reading, f"value at {SA:.9g}")
        if SA == 0.0:
            self._at_zero[channel] = number
        return number

    def _value(self, channel: Channel, SA: float) -> _Reading | None:
        fit = self.direction.curve(channel)
        if fit is None:
            return None
        slope = float(slope_at(fit, SA))
        gradient = model(fit.model).jacobian(fit.values, SA)
        return _Reading(
            channel=channel,
            estimate=estimate_at(fit, SA),
            weights=self._weights(channel, gradient),
            angle=tuple(self.shared.angle_parts(slope, slope * SA)),
            at=SA,
        )

    def slope(self, channel: Channel) -> Uncertain | None:
        """Return the curve's slope at SA = 0 [per rad]; None where the data do not determine it."""
        fit = self.direction.curve(channel)
        if fit is None or "slope_at_zero" in fit.not_determined or fit.slope_at_zero is None:
            return None
        gradient = model(fit.model).slope_jacobian(fit.values, 0.0)
        # The value is that of the curve, whose parameters a search may have moved.
        estimate = replace(fit.slope_at_zero, value=float(slope_at(fit, 0.0)))
        # A zero of the slip angle moves along the curve to where its slope is another one.
        step = 1e-4
        bend = (float(slope_at(fit, step)) - float(slope_at(fit, -step))) / (2 * step)
        angle = tuple(self.shared.angle_parts(bend, estimate.value))
        weights = self._weights(channel, gradient)
        reading = _Reading(channel=channel, estimate=estimate, weights=weights, angle=angle)
        return self._read(reading, "slope at 0")

    def secant(self, channel: Channel) -> Uncertain | None:
        """Return (y(1 deg) - y(-1 deg)) / 2 deg [per rad] from the measured steps.

        A steering zero moves both steps; each value is carried from its measured angle to the step's along
        the fitted curve, so that the secant is that of the definition. Without a curve the measured span
        is used as it is. Repeats of a step count as their mean. Data without steps: off the curve alone.
        """
        if not self.stepped:
            return self._chord(channel)
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
        degree = float(np.radians(1.0))
        if fit is not None:
            steps = np.where(weights > 0, degree, -degree)
            y = y + value_at(fit, steps) - value_at(fit, SA)
            span = 2 * degree
        slope = float(weights @ y) / span
        # What an error of the angle does to the two ends, by the slopes there; by the chord without a curve.
        ends = (slope, slope) if fit is None else slope_at(fit, np.array([degree, -degree])).tolist()
        parts = list(self.shared.angle_parts((ends[0] - ends[1]) / span, (ends[0] + ends[1]) / 2))
        if fit is None or self.scatter is None:
            # The zero of the slip angle cancels in the span; what is left of the angle is its scatter, which
            # the scatter about the curves has in it.
            scatter = np.array([c.sd_SA for c in self.group.conditions])
            u = slope * _norm(weights * scatter) / span
            parts.append(self._own(channel, "slip angle scatter", "secant", u))
        u = _norm(weights * self.group.own_u(channel)) / span
        estimate = Estimate(value=slope, u=u, unit=f"{UNIT[channel]}/rad")
        reading = _Reading(
            channel=channel, estimate=estimate, weights=weights / span, angle=tuple(parts), off_curve=False
        )
        return self._read(reading, "secant")

    def _chord(self, channel: Channel) -> Uncertain | None:
        fit = self.direction.curve(channel)
        degree = float(np.radians(1.0))
        SA = self.group.SA
        if fit is None or SA[0] > -degree or SA[-1] < degree:
            return None
        at = model(fit.model)
        gradient = (at.jacobian(fit.values, degree) - at.jacobian(fit.values, -degree)) / (2 * degree)
        low, high = value_at(fit, np.array([-degree, degree])).tolist()
        lower, upper = slope_at(fit, np.array([-degree, degree])).tolist()
        slope = (high - low) / (2 * degree)
        u = float(np.sqrt(max(float(gradient @ np.asarray(fit.covariance) @ gradient), 0.0)))
        dof = estimate_at(fit, 0.0).dof
        estimate = Estimate(value=slope, u=u, unit=f"{UNIT[channel]}/rad", dof=dof)
        angle = tuple(self.shared.angle_parts((upper - lower) / (2 * degree), (upper + lower) / 2))
        weights = self._weights(channel, gradient)
        return self._read(_Reading(channel=channel, estimate=estimate, weights=weights, angle=angle), "chord")

    def moment_without_force(self) -> Uncertain | None:
        """Return MZ where the direction's own FY is zero: the residual aligning torque.

        An error of FY moves the angle at which it is read, by dMZ/dFY along the curves; a zero of the slip
        angle moves both curves alike and cancels, as does the slip angle of a single block.
        """
        if not self._residual:
            self._residual.append(self._moment_without_force())
        return self._residual[0]

    def _moment_without_force(self) -> Uncertain | None:
        FY = self.direction.curve("FY")
        crossing = None if FY is None or not self.covers_zero() else zero_crossing(FY)
        if FY is None or crossing is None:
            return None
        moment, force = self._value("MZ", crossing.value), self._value("FY", crossing.value)
        fit = self.direction.curve("MZ")
        if moment is None or force is None or fit is None:
            return None
        stiffness = float(slope_at(FY, crossing.value))
        if not stiffness:
            return None
        ratio = float(slope_at(fit, crossing.value)) / stiffness
        return self._read(moment, "MZ without FY", (-ratio, force))

    def _weights(self, channel: Channel, gradient: Array) -> Array:
        """Return d reading / d condition (conditions,)."""
        if channel not in self._pseudo:
            self._pseudo[channel] = weights_of(self.direction, channel)
        return np.asarray(gradient @ self._pseudo[channel])

    def _read(self, first: _Reading, reading: str, *more: tuple[float, _Reading]) -> Uncertain:
        """Return the value of the first reading with all parts of a weighted sum of readings.

        What further readings share with the first, and what one block's errors do to both channels, is
        added with its sign; their values are zero.
        """
        terms = ((1.0, first), *more)
        channel, shared = first.channel, self.shared
        weights = {term.channel: factor * term.weights for factor, term in terms}
        rows = _norm(np.concatenate([w * self.group.own_u(c) for c, w in weights.items()]))
        tares = _norm(np.concatenate([w * self._tares[c] for c, w in weights.items()]))
        form: list[Part] = []
        if self.scatter is not None and all(self.direction.curve(c) is not None for c in weights):
            scatter, dof = self.scatter.of(self.direction, weights)
            pool = f"scatter/{shared.test}"
            form = [
                Part(source="fit", key=f"form/{shared.test}/{e.source}/{e.place}", u=e.share, dof=e.dof,
                     pool=f"form/{shared.test}/{e.source}")
                for e in self.scatter.form(
                    self.direction, weights, None if first.at is None else (channel, first.at)
                )
                if first.off_curve
            ]  # fmt: skip
        else:
            # The fit's residuals hold the scatter of the rows already; where a curve follows its points more
            # closely than their own scatter allows, the scatter stands. Never both.
            u = _norm(np.array([factor * term.estimate.u for factor, term in terms]))
            scatter, dof = float(np.sqrt(max(u**2 - rows**2, 0.0))), first.estimate.dof
            pool = ""
        parts: list[Part] = []
        for c, w in weights.items():
            parts += shared.calibration_parts(c, self._calibration[c] @ w)
            parts += shared.zero_parts(self._zero[c] @ w)
        parts.append(self._own(channel, "tare", reading, tares))
        parts += [replace(part, u=factor * part.u) for factor, term in terms for part in term.angle]
        parts.append(self._own(channel, "repeatability", reading, rows))
        parts.append(replace(self._own(channel, "fit", reading, scatter, dof), pool=pool))
        parts += form
        return Uncertain(value=first.estimate.value, unit=first.estimate.unit, parts=merged(parts))

    def _own(self, channel: str, source: str, reading: str, u: float, dof: float = np.inf) -> Part:
        where = f"{self.shared.test}/{self.group.load_N:.6g}/{self.group.rotation}/{channel}/{reading}"
        return Part(source=source, key=f"{source}/{where}", u=u, dof=dof)


def _norm(values: Array) -> float:
    return float(np.linalg.norm(values))


def half_at_zero(declared: Characteristic, forward: Reader, reverse: Reader) -> Uncertain | None:
    """Return half the forward value plus ``sign`` times the reversed one, both at SA = 0."""
    if not (forward.covers_zero() and reverse.covers_zero()):
        return None
    return _half(forward.value(declared.channel, 0.0), reverse.value(declared.channel, 0.0), declared.sign)


def half_without_force(declared: Characteristic, forward: Reader, reverse: Reader) -> Uncertain | None:
    """Return half MZ forward plus ``sign`` times MZ reversed, each at its direction's own FY = 0."""
    return _half(forward.moment_without_force(), reverse.moment_without_force(), declared.sign)


def residual_moment(_what: Characteristic, run: Reader) -> Uncertain | None:
    """Return MZ of one direction at its own FY = 0."""
    return run.moment_without_force()


def secant(declared: Characteristic, run: Reader) -> Uncertain | None:
    """Return ``sign`` times the +-1 deg secant of the channel [per rad]."""
    return _signed(run.secant(declared.channel), declared.sign)


def slope(declared: Characteristic, run: Reader) -> Uncertain | None:
    """Return ``sign`` times the slope of the channel's curve at SA = 0 [per rad]."""
    return _signed(run.slope(declared.channel), declared.sign)


def curve_value(declared: Characteristic, run: Reader, SA: float) -> Uncertain | None:
    """Return the channel's curve at a slip angle [rad]."""
    return run.value(declared.channel, SA)


def _half(forward: Uncertain | None, reverse: Uncertain | None, sign: float) -> Uncertain | None:
    if forward is None or reverse is None:
        return None
    return weighted([(0.5, forward), (sign / 2, reverse)])


def _signed(number: Uncertain | None, sign: float) -> Uncertain | None:
    return None if number is None else number.scaled(sign, number.unit)


def _crosses_zero(direction: Direction) -> bool:
    return direction.fit.FY is not None and zero_crossing(direction.fit.FY) is not None


def _slope_determined(direction: Direction, channel: str) -> bool:
    fit = direction.fit.FY if channel == "FY" else direction.fit.MZ
    return fit is not None and fit.slope_at_zero is not None and "slope_at_zero" not in fit.not_determined


COVERS_ZERO = Need(
    text="no slip angles on both sides of zero", met=lambda direction: direction.group.covers_zero()
)
CURVE_FY = Need(text="no fitted curve of FY", met=lambda direction: direction.fit.FY is not None)
CURVE_MZ = Need(text="no fitted curve of MZ", met=lambda direction: direction.fit.MZ is not None)
ZERO_OF_FY = Need(text="no slip angle at which FY is zero", met=_crosses_zero)
STEPS = Need(
    text="no steps at +1 and -1 deg",
    met=lambda direction: bool(direction.group.step(1.0)) and bool(direction.group.step(-1.0)),
)
SLOPE_FY = Need(
    text="the data do not determine the slope of FY at SA = 0",
    met=lambda direction: _slope_determined(direction, "FY"),
)
SLOPE_MZ = Need(
    text="the data do not determine the slope of MZ at SA = 0",
    met=lambda direction: _slope_determined(direction, "MZ"),
)
