"""The design of a test: its conditions, and how long the machine takes for them."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from toolkit.channels import Rotation
from toolkit.machine import Machine
from toolkit.simulation.steps import Motion
from toolkit.simulation.tire import TireTruth, revolution_time_s

_ACTUATOR_S = 2.5  # from one load to the next, as the virtual machine waits on average
_ORDERS = 400


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """Every slip angle [rad] at every load [N] in every direction; a step that stands twice is repeated.

    Slip angles are in SAE axes, as those of the earlier tests.
    """

    slip_angles_rad: tuple[float, ...]
    loads_N: tuple[float, ...]
    rotations: tuple[Rotation, ...]

    @property
    def rows(self) -> int:
        """How many conditions a reduced test of it has."""
        return self.recordings * len(self.loads_N)

    @property
    def recordings(self) -> int:
        """How many files are recorded, one a slip angle and direction."""
        return len(self.slip_angles_rad) * len(self.rotations)


@dataclass(frozen=True, slots=True, kw_only=True)
class Pace:
    """How fast the machine works: seconds of a condition, and from one recording to the next."""

    condition_s: float
    between_files_s: float

    def minutes(self, design: Design) -> float:
        """Return how long a design takes [min]."""
        return (design.rows * self.condition_s + design.recordings * self.between_files_s) / 60


def pace_of(machine: Machine, *, between_files_s: float | None = None) -> Pace:
    """Return the pace of a machine by its protocol's revolutions, at the drum's speed.

    The radius of the tire is that of the published one, 0.316 m; ``between_files_s`` by default that of the
    virtual machine's motion.
    """
    protocol, drum = machine.protocol, machine.drum
    speed = protocol.speed_m_s or drum.speed_m_s
    tire_s = revolution_time_s(TireTruth(), speed)
    # A flat belt has no revolutions: the tire's are counted there.
    by_tire = protocol.revolutions_of == "tire"
    turn = tire_s if by_tire or drum.circumference_m is None else drum.circumference_m / speed
    turns = protocol.settle_revolutions + protocol.average_revolutions
    pause = Motion().between_files_s if between_files_s is None else between_files_s
    return Pace(condition_s=turns * turn + _ACTUATOR_S, between_files_s=pause)


def standard(machine: Machine, rotations: tuple[Rotation, ...]) -> Design:
    """Return the design of the machine's own protocol, its slip angles in SAE axes."""
    protocol = machine.protocol
    return Design(
        slip_angles_rad=tuple(machine.SA_to_SAE * a + 0.0 for a in protocol.slip_angles_rad)
        * protocol.repeats,
        loads_N=tuple(protocol.loads_N),
        rotations=protocol.rotations or rotations,
    )


def steps_of(machine: Machine) -> tuple[float, ...]:
    """Return the slip angles [rad], in SAE axes, at which a machine can stand.

    They are the multiples of the smallest step of its protocol, in the protocol's range.

    >>> from toolkit.machine import load_machine
    >>> steps = steps_of(load_machine("m15"))
    >>> len(steps), round(math.degrees(steps[0]), 6)
    (21, -10.0)
    """
    angles = sorted({machine.SA_to_SAE * angle for angle in machine.protocol.slip_angles_rad})
    gaps = [b - a for a, b in itertools.pairwise(angles)]
    step = min(gaps, default=math.radians(1.0))
    low, high = math.ceil(angles[0] / step - 1e-6), math.floor(angles[-1] / step + 1e-6)
    # As files write them: a whole number of hundredths of a degree is that number.
    return tuple(math.radians(round(math.degrees(n * step), 6)) for n in range(low, high + 1))


def ordered(slip_angles_rad: tuple[float, ...], *, seed: int) -> tuple[float, ...]:
    """Return slip angles in an order in which neither they nor their sizes follow the time.

    A drift of the machine or the tire's warmth then widens the scatter and bends no curve. Of many orders
    the one whose largest rank correlation with the time is smallest.
    """
    angles = np.array(sorted(slip_angles_rad, key=lambda a: (abs(a), a)))
    rng = np.random.default_rng(seed)
    time = np.arange(len(angles)) - (len(angles) - 1) / 2
    best, least = angles, math.inf
    for _ in range(_ORDERS):
        order = rng.permutation(len(angles))
        worst = max(_correlation(angles[order], time), _correlation(np.abs(angles[order]), time))
        if worst < least - 1e-12:
            best, least = angles[order], worst
    return tuple(float(a) for a in best)


def _correlation(values: np.ndarray, time: np.ndarray) -> float:
    ranks = np.searchsorted(np.sort(values), values).astype(float)
    ranks -= ranks.mean()
    size = math.sqrt(float(ranks @ ranks) * float(time @ time))
    return abs(float(ranks @ time)) / size if size else 0.0
