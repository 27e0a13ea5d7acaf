"""What a test does to the tread: the energy that slides away in it, and how warm it gets.

A wheel that rolls at a slip angle slides with the power |FY| V sin|SA|. Wear goes with the energy of it
(Schallamach and Turner, Wear 3 (1960) 1). The tread is one heat capacity that the power warms and the room
cools, as the virtual machine has it (`simulation.steps.Motion`). A recording goes through its loads at one
slip angle; the pause before it is as long as a tread that begins at the limit takes to cool so far that the
recording ends within it, so that the recordings may be made in any order.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.arrays import Array
from toolkit.planning.design import Design, Pace, pace_of
from toolkit.simulation.steps import Motion

if TYPE_CHECKING:
    from toolkit.machine import Machine
    from toolkit.planning.expectation import EarlierTest


_TREAD = Motion()


def tread_statement() -> str:
    """Return what is assumed of a tread's warmth, for people."""
    return (
        f"sliding warms the tread by {1e3 * _TREAD.tread_heating_K_J:g} K/kJ, and it cools to the room with "
        f"{_TREAD.tread_cooling_s:g} s; a pause begins at the limit"
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tread:
    """The tread of the tires of earlier tests at a speed, and what it may be put to: no limit by default.

    Of several tires the one of the largest force counts, at each condition.
    """

    tires: tuple[EarlierTest, ...]
    pace: Pace
    speed_m_s: float
    energy_J: float = math.inf
    rise_K: float = math.inf

    @classmethod
    def of(
        cls, machine: Machine, tires: tuple[EarlierTest, ...], *, between_files_s: float | None = None
    ) -> Tread:
        """Return the tread without limits at the speed and the pace of a machine's protocol."""
        pace = pace_of(machine, between_files_s=between_files_s)
        speed = machine.protocol.speed_m_s or machine.drum.speed_m_s
        return cls(tires=tires, pace=pace, speed_m_s=speed)

    def powers_W(self, design: Design) -> Array:
        """Return the power that slides away (slip angles, directions, loads)."""
        angles = np.asarray(design.slip_angles_rad)
        forces = [
            [
                np.max([np.abs(earlier.force(angles, load, rotation)) for earlier in self.tires], axis=0)
                for load in design.loads_N
            ]
            for rotation in design.rotations
        ]
        sliding = self.speed_m_s * np.abs(np.sin(angles))
        return np.asarray(np.moveaxis(np.array(forces), 2, 0) * sliding[:, None, None])

    def energies_J(self, design: Design) -> Array:
        """Return the energy that slides away at each slip angle, all loads and directions (slip angles,)."""
        return np.asarray(self.powers_W(design).sum(axis=(1, 2)) * self.pace.condition_s)

    def rises_K(self, design: Design) -> Array:
        """Return how warm a recording makes a cold tread, the warmer direction's (slip angles, loads)."""
        cooled = math.exp(-self.pace.condition_s / _TREAD.tread_cooling_s)
        steady = _TREAD.tread_heating_K_J * _TREAD.tread_cooling_s * self.powers_W(design).max(axis=1)
        rise, rises = np.zeros(len(steady)), []
        for column in steady.T:
            rise = rise * cooled + column * (1 - cooled)
            rises.append(rise)
        return np.stack(rises, axis=1)

    def pauses_s(self, design: Design) -> Array:
        """Return the pause before each recording (slip angles,); inf where a cold tread gets too warm."""
        pace = self.pace
        if math.isinf(self.rise_K):
            return np.full(len(design.slip_angles_rad), pace.between_files_s)
        cooling = _TREAD.tread_cooling_s
        cooled = np.exp(-pace.condition_s / cooling * np.arange(1, len(design.loads_N) + 1))
        start = ((self.rise_K - self.rises_K(design)) / cooled).min(axis=1)
        with np.errstate(divide="ignore"):
            waits = cooling * np.log(self.rise_K / np.maximum(start, 0.0))
        return np.asarray(np.maximum(waits, pace.between_files_s))

    def minutes(self, design: Design) -> float:
        """Return how long a design takes with its pauses [min]."""
        waits = self.pauses_s(design) - self.pace.between_files_s
        return self.pace.minutes(design) + len(design.rotations) * float(waits.sum()) / 60


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Exposure:
    """What each of a list of slip angles adds: ``energies_J`` and ``minutes`` (slip angles,), with limits."""

    energies_J: Array
    minutes: Array
    energy_limit_J: float
    minutes_limit: float

    def excess(self, points: Sequence[int]) -> float:
        """Return by how much a design goes beyond its limits, as a share of each; 0 within them."""
        places = list(points)
        time, energy = float(self.minutes[places].sum()), float(self.energies_J[places].sum())
        if math.isinf(time):
            return float(np.isinf(self.minutes[places]).sum())
        return max(time / self.minutes_limit - 1, 0.0) + max(energy / self.energy_limit_J - 1, 0.0)
