"""The conditions of one direction and one nominal load, in the order of the slip angle, and their curves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from toolkit.arrays import Array
from toolkit.channels import ROTATIONS, Rotation
from toolkit.characteristics.sweep_fit import SweepFit
from toolkit.reduction.model import Condition, ReducedTest
from toolkit.tires.model import CurveFit

Channel = Literal["FY", "MZ"]
CHANNELS: tuple[Channel, Channel] = ("FY", "MZ")

# Loads that the protocol does not know are one group while they lie within this part of each other.
_SAME_LOAD = 0.10


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """``load_N`` is the load that all conditions of the group share."""

    load_N: float
    rotation: Rotation
    conditions: tuple[Condition, ...]

    @property
    def SA(self) -> Array:
        """Measured slip angles [rad], ascending."""
        return np.array([c.SA for c in self.conditions])

    def values(self, channel: str) -> Array:
        """FY [N] or MZ [N·m] at the common load."""
        return np.array([c.FY_common if channel == "FY" else c.MZ_common for c in self.conditions])

    def own_u(self, channel: str) -> Array:
        """Standard uncertainty of each condition's own value: rows, and the way to the common load."""
        return np.array([c.u_FY_common if channel == "FY" else c.u_MZ_common for c in self.conditions])

    def covers_zero(self) -> bool:
        """Tell whether slip angles lie on both sides of zero."""
        SA = self.SA
        return len(SA) > 1 and bool(SA[0] <= 0.0 <= SA[-1])

    def step(self, degrees: float) -> tuple[int, ...]:
        """Return the places of the conditions of a slip angle step of the protocol [deg]; repeats too."""
        step = np.radians(degrees)
        return tuple(
            place
            for place, condition in enumerate(self.conditions)
            if condition.step_SA is not None and abs(condition.step_SA - step) < 1e-9
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class DirectionFit:
    """The fitted curves of one direction of rotation at one load."""

    rotation: Rotation
    load_N: float
    FY: CurveFit | None
    MZ: CurveFit | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Direction:
    """One direction's conditions and curves at one load; a curve is None where it could not be fitted.

    ``sweeps`` are the recordings in time near that load.
    """

    group: Group
    fit: DirectionFit
    sweeps: tuple[SweepFit, ...] = ()

    def curve(self, channel: Channel) -> CurveFit | None:
        """Return the fitted curve of a channel."""
        return self.fit.FY if channel == "FY" else self.fit.MZ


def directions_of(
    reduced: ReducedTest, fits: Sequence[DirectionFit], sweeps: Sequence[SweepFit] = ()
) -> tuple[Direction, ...]:
    """Return the directions of a test with their curves, lightest load first, forward before reverse."""
    groups = group(reduced)
    return tuple(
        Direction(group=part, fit=fit, sweeps=sweeps_at(part, groups, sweeps))
        for part, fit in zip(groups, fits, strict=True)
    )


def sweeps_at(part: Group, groups: Sequence[Group], sweeps: Sequence[SweepFit]) -> tuple[SweepFit, ...]:
    """Return the sweeps of a group: of its direction, and nearer to its load than to any other."""
    loads = [other.load_N for other in groups if other.rotation == part.rotation]
    return tuple(
        sweep
        for sweep in sweeps
        if sweep.rotation == part.rotation
        and abs(sweep.load_N - part.load_N) <= _SAME_LOAD * part.load_N
        and min(loads, key=lambda load: abs(load - sweep.load_N)) == part.load_N
    )


def group(reduced: ReducedTest) -> tuple[Group, ...]:
    """Return the groups of a test: ascending load, forward before reverse."""
    loads: list[list[Condition]] = []
    for condition in sorted(reduced.used(), key=lambda c: c.FZ_common):
        if loads and _same_load(loads[-1][-1], condition):
            loads[-1].append(condition)
        else:
            loads.append([condition])
    return tuple(
        Group(
            load_N=float(np.mean([c.FZ_common for c in load])),
            rotation=rotation,
            conditions=tuple(sorted((c for c in load if c.rotation == rotation), key=lambda c: c.SA)),
        )
        for load in loads
        for rotation in ROTATIONS
        if any(c.rotation == rotation for c in load)
    )


def _same_load(lighter: Condition, heavier: Condition) -> bool:
    if lighter.step_FZ is not None or heavier.step_FZ is not None:
        return lighter.step_FZ == heavier.step_FZ
    return heavier.FZ_common - lighter.FZ_common <= _SAME_LOAD * heavier.FZ_common
