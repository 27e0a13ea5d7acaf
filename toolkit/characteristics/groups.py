"""The conditions of one direction and one nominal load, in the order of the slip angle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.channels import ROTATIONS, Rotation
from toolkit.reduction.model import Condition, ReducedTest

# Loads that the protocol does not know are one group while they lie within this part of each other.
_SAME_LOAD = 0.10


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """``load_N`` is the load that all conditions of the group share."""

    load_N: float
    rotation: Rotation
    conditions: tuple[Condition, ...]

    @property
    def SA(self) -> NDArray[np.float64]:
        """Measured slip angles [rad], ascending."""
        return np.array([c.SA for c in self.conditions])

    def values(self, channel: str) -> NDArray[np.float64]:
        """FY [N] or MZ [N·m] at the common load."""
        return np.array([c.FY_common if channel == "FY" else c.MZ_common for c in self.conditions])

    def own_u(self, channel: str) -> NDArray[np.float64]:
        """Standard uncertainty of each condition's own value: rows, and the way to the common load."""
        return np.array([c.u_FY_common if channel == "FY" else c.u_MZ_common for c in self.conditions])

    def step(self, degrees: float) -> tuple[int, ...]:
        """Return the places of the conditions of a slip angle step of the protocol [deg]; repeats too."""
        wanted = np.radians(degrees)
        return tuple(
            i
            for i, one in enumerate(self.conditions)
            if one.step_SA is not None and abs(one.step_SA - wanted) < 1e-9
        )


def group(reduced: ReducedTest) -> tuple[Group, ...]:
    """Return the groups of a test: ascending load, forward before reverse."""
    used = reduced.used()
    loads: list[list[Condition]] = []
    for one in sorted(used, key=lambda c: c.FZ_common):
        last = loads[-1][-1] if loads else None
        if last is not None and _same(last, one):
            loads[-1].append(one)
        else:
            loads.append([one])
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


def _same(one: Condition, other: Condition) -> bool:
    if one.step_FZ is not None or other.step_FZ is not None:
        return one.step_FZ == other.step_FZ
    return other.FZ_common - one.FZ_common <= _SAME_LOAD * other.FZ_common
