"""What an effect may ask of a case: the narrow view by which it scales, starts and bounds its parameters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from toolkit.arrays import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionSizes:
    """Sizes of the motion that a force-like term enters, in the units of its equation.

    ``force``, ``speed`` and ``place`` are what terms are scaled by; ``fastest`` and ``farthest`` the largest
    magnitudes of speed and position, ``level`` the largest value that may run over. ``has_position`` tells
    whether the equation has the position itself; where it has only its rate, ``place`` is of the integral.
    ``feeds`` is the one other state whose rate depends on this one, None where there is none or there are
    several.
    """

    force: float
    speed: float
    place: float
    fastest: float
    farthest: float
    level: float
    has_position: bool
    feeds: str | None = None


class Surroundings(Protocol):
    """A case as an effect at one place sees it; nothing here is a simulated value."""

    @property
    def channel(self) -> str | None:
        """Channel or state of the place, None where the effect acts on the whole machine."""
        ...

    @property
    def source(self) -> str | None:
        """The other channel of the place, None where there is none."""
        ...

    @property
    def drivers(self) -> frozenset[str]:
        """Channels that were recorded beside the outputs."""
        ...

    @property
    def outputs(self) -> frozenset[str]:
        """Channels that are judged."""
        ...

    @property
    def cells(self) -> frozenset[str]:
        """Load cells from which loads are computed."""
        ...

    @property
    def nominal_load_N(self) -> float | None:
        """Nominal load that the simulation itself states [N], None where it states none."""
        ...

    @property
    def rows(self) -> int:
        """Rows of all runs."""
        ...

    @property
    def row_time(self) -> float:
        """Usual time from row to row [s]."""
        ...

    @property
    def minutes(self) -> float:
        """Duration of all runs together [min]."""
        ...

    @property
    def integrates(self) -> bool:
        """The simulation integrates its own equation of motion."""
        ...

    @property
    def motion(self) -> MotionSizes:
        """Sizes of the motion that the place belongs to."""
        ...

    @property
    def way(self) -> tuple[float, float]:
        """Longest way of a run over the position, the usual one from row to row; zero if nothing moves."""
        ...

    def origin(self, name: str | None) -> float | None:
        """Return the first recorded value of a channel whose scale has a zero by convention, else None."""
        ...

    def spread(self, name: str | None) -> float:
        """Return the largest magnitude of a channel over all runs, 1 where nothing was recorded of it.

        Where the channel has an origin, it is counted from there.
        """
        ...

    def values(self, name: str | None) -> Array:
        """Return the recorded values of a channel over all runs, (n,) without gaps; none where it was not."""
        ...

    def widest(self, name: str | None) -> tuple[float, float] | None:
        """Return the ends of a channel in the run where its range is widest, None where it has none.

        Where the channel has an origin, they are counted from there.
        """
        ...

    def recorded_range(self, *names: str) -> float:
        """Return the range of the first of these channels that was recorded, 1 where none was."""
        ...

    def unit(self) -> str | None:
        """Return the unit of the place's channel, None where it is not known."""
        ...

    def conditions(self, key: str) -> frozenset[str]:
        """Return the values that a condition has in the runs."""
        ...


Scale = Callable[[Surroundings], float]


def of_channel(case: Surroundings) -> float:
    """Return the spread of the channel."""
    return case.spread(case.channel)


def per_channel(case: Surroundings) -> float:
    """Return one over the spread of the channel."""
    return 1 / case.spread(case.channel)


def of_force(case: Surroundings) -> float:
    """Return the size of the force in the equation of motion."""
    return case.motion.force


def of_position(case: Surroundings) -> float:
    """Return the spread of the position."""
    return case.motion.place
