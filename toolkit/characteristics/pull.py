"""Pull: conicity, plysteer, CRAT and PRAT from a forward and a reversed run.

By symmetry conicity keeps FY and flips MZ under x -> -x; plysteer flips FY and keeps MZ under a half turn
about z. With F and R the values at SA = 0 in machine-fixed axes (cells in the carriage):

    conicity = (F + R)/2   plysteer = (F - R)/2   of FY
    CRAT     = (F - R)/2   PRAT     = (F + R)/2   of MZ

In axes that follow the travel FY of the reversed run has the other sign and MZ the same, so the same
physics reads conicity = (F - R)/2 there. The source document's own formulas take (F + R)/2 for CRAT and
(F - R)/2 for PRAT on machine-fixed values; they are given apart under its name.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.characteristics.model import DirectionFit, Pull
from toolkit.characteristics.shared import Shared, Weighted, weights_at, weights_at_zero
from toolkit.estimate import Estimate, effective_dof
from toolkit.tires.evaluate import estimate_at, slope_estimate_at, zero_crossing

if TYPE_CHECKING:
    from toolkit.characteristics.groups import Group
    from toolkit.tires.model import CurveFit


@dataclass(frozen=True, slots=True, kw_only=True)
class Direction:
    """One direction's group and curves; None where the direction was not run or not fitted."""

    group: Group
    fit: DirectionFit


def pull(
    load_N: float,
    forward: Direction | None,
    reverse: Direction | None,
    *,
    shared: Shared,
) -> Pull:
    """Return the pull characteristics of one load.

    Parameters
    ----------
    forward, reverse : curves in SAE axes that follow the travel, at one common load
    shared : what both directions have in common. The zero of the slip angle stays whole in plysteer and
        PRAT and cancels in conicity, CRAT and PRAT at FY = 0; a zero of the cells does the opposite.
    """
    CRAT, PRAT = (_half("MZ", forward, reverse, sign, shared=shared) for sign in (-1.0, 1.0))
    ahead, back = _moment_without_force(forward), _moment_without_force(reverse)
    return Pull(
        load_N=load_N,
        conicity=_half("FY", forward, reverse, -1.0, shared=shared),
        plysteer=_half("FY", forward, reverse, 1.0, shared=shared),
        CRAT=CRAT,
        PRAT=PRAT,
        PRAT_at_FY_zero=_residual([ahead, back], shared=shared),
        # MZ is the same in machine-fixed axes and in those that follow the travel: the source document's
        # pair for MZ is this pair with the names exchanged.
        thesis_CRAT=PRAT,
        thesis_PRAT=CRAT,
        residual_forward=_residual([ahead], shared=shared),
        residual_reverse=_residual([back], shared=shared),
    )


def _half(
    channel: str,
    forward: Direction | None,
    reverse: Direction | None,
    sign: float,
    *,
    shared: Shared,
) -> Estimate | None:
    one, other = _curve(forward, channel), _curve(reverse, channel)
    if one is None or other is None or forward is None or reverse is None:
        return None
    F, R = estimate_at(one, 0.0), estimate_at(other, 0.0)
    parts = [(c, w / 2) for c, w in weights_at_zero(forward.group)]
    parts += [(c, sign * w / 2) for c, w in weights_at_zero(reverse.group)]
    common = shared.common_u(channel, parts)
    slope = slope_estimate_at(one, 0.0).value + sign * slope_estimate_at(other, 0.0).value
    zero = abs(slope) / 2 * shared.u_SA_zero
    contributions = [(F.u / 2, F.dof), (R.u / 2, R.dof), (common, np.inf), (zero, np.inf)]
    return Estimate(
        value=(F.value + sign * R.value) / 2,
        u=float(np.sqrt(sum(u * u for u, _ in contributions))),
        unit=F.unit,
        dof=effective_dof(contributions),
    )


def _curve(direction: Direction | None, channel: str) -> CurveFit | None:
    if direction is None or not weights_at_zero(direction.group):
        return None
    return direction.fit.FY if channel == "FY" else direction.fit.MZ


@dataclass(frozen=True, slots=True, kw_only=True)
class _Residual:
    """MZ of one direction where its own FY is zero, by its curves alone.

    ``MZ`` and ``FY`` are the weighted conditions through which a common error moves it: that of MZ itself,
    and that of FY by way of the angle at which FY is zero, dMZ/dFY along the curves.
    """

    value: float
    unit: str
    own: tuple[tuple[float, float], ...]
    MZ: Weighted
    FY: Weighted


def _moment_without_force(direction: Direction | None) -> _Residual | None:
    """Return MZ where the direction's own FY is zero: the residual aligning torque."""
    FY, MZ = _curve(direction, "FY"), _curve(direction, "MZ")
    if FY is None or MZ is None or direction is None:
        return None
    crossing = zero_crossing(FY)
    if crossing is None:
        return None
    moment, slope = estimate_at(MZ, crossing.value), slope_estimate_at(MZ, crossing.value)
    stiff = slope_estimate_at(FY, crossing.value).value
    parts = weights_at(direction.group, crossing.value)
    return _Residual(
        value=moment.value,
        unit=moment.unit,
        own=((moment.u, moment.dof), (abs(slope.value) * crossing.u, crossing.dof)),
        MZ=parts,
        FY=tuple((c, -w * slope.value / stiff) for c, w in parts) if stiff else (),
    )


def _residual(sides: Sequence[_Residual | None], *, shared: Shared) -> Estimate | None:
    """Return the mean of one or two residual torques; errors of FY and of MZ are taken as independent."""
    found = [one for one in sides if one is not None]
    if len(found) < len(sides):
        return None
    n = len(found)
    contributions = [(u / n, dof) for one in found for u, dof in one.own]
    for channel in ("MZ", "FY"):
        parts = [(c, w / n) for one in found for c, w in (one.MZ if channel == "MZ" else one.FY)]
        contributions.append((shared.common_u(channel, parts), np.inf))
    return Estimate(
        value=sum(one.value for one in found) / n,
        u=float(np.sqrt(sum(u * u for u, _ in contributions))),
        unit=found[0].unit,
        dof=effective_dof(contributions),
    )
