"""From readings of curves to characteristics: pull by symmetry, stiffness by secant and slope.

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

from typing import TYPE_CHECKING

from toolkit.characteristics.characteristic import Characteristic, Need
from toolkit.characteristics.uncertain import Uncertain, weighted

if TYPE_CHECKING:
    from toolkit.characteristics.groups import Direction
    from toolkit.characteristics.reading import Reader


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
    from toolkit.tires.evaluate import zero_crossing

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
