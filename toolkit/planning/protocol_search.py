"""The least test that meets demands: slip angles and loads, judged by `expectation`.

No slip angle is planned twice. A repeat has in common with the first what the form of the curve misses there
and the way to the common load; how much of the scatter about the curves that is, an earlier test of each
slip angle does not tell. A design of repeats takes all of it for chance: its curves are less sure than it
says, and its own residuals, mostly between repeats, do not show it.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import cast

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.channels import ROTATIONS, Rotation
from toolkit.characteristics.catalogue import by_name
from toolkit.errors import ConfigError
from toolkit.planning.demands import Demand, Reach, is_of, worst
from toolkit.planning.design import Design, Pace, steps_of
from toolkit.planning.exchange import Points, PointSearch
from toolkit.planning.expectation import EarlierTest
from toolkit.planning.screen import Screen, criterion, openness, screen_of
from toolkit.planning.tread import Exposure, Tread
from toolkit.tires.fit import MIN_POINTS

# A curve that a report prints is measured to its peak, or to the end of the range: within this part of it.
_PEAK_SHARE = 0.99
_SAME_RAD = 1e-9
_BEYOND = 1e3  # what a design that goes beyond its limits pays for as much again
_STARTS, _SEED = 8, 25  # of the exchange, beside the best of another size
_NEAR = 8  # designs that are judged by the whole budget: those that the exchange met and that screen best
_FAR = 1.2  # of a limit: a design beyond it stands for all that screen no better
# A printed U has two digits, and is rounded down by at most this part: within it two are the same.
_ALIKE = 1.05


@dataclass(frozen=True, kw_only=True, eq=False)
class Question:
    """What is asked: demands at nominal loads [N]; earlier tests say what a design will reach.

    ``tires`` are those tests, one a tire of the class: a demand is to be met on each of them. ``protocol_U``
    is what the machine's own protocol reaches, by tire, demand and load, and a twentieth more: the limit of
    a demand without one.
    """

    tires: tuple[EarlierTest, ...]
    demands: tuple[Demand, ...]
    loads_N: tuple[float, ...]
    protocol_U: Mapping[tuple[str, Demand, float], float] = field(default_factory=dict)

    @classmethod
    def beside(
        cls,
        protocol: Design,
        *,
        tires: tuple[EarlierTest, ...],
        demands: tuple[Demand, ...],
        loads_N: tuple[float, ...],
    ) -> Question:
        """Return a question that knows what the machine's protocol reaches."""
        bare = cls(tires=tires, demands=demands, loads_N=loads_N)
        bare.refuse_what_no_design_has()
        reached = {
            (reach.tire, reach.demand, reach.load_N): _ALIKE * reach.U for reach in bare.reaches(protocol)
        }
        return dataclasses.replace(bare, protocol_U=reached)

    @property
    def rotations(self) -> tuple[Rotation, ...]:
        """The directions that the demands need: forward alone where none is of both."""
        return rotations_of(self.demands)

    @cached_property
    def candidates_rad(self) -> tuple[float, ...]:
        """The slip angles at which the machine can stand and every earlier test measured [rad]."""
        low = max(earlier.reach_rad[0] for earlier in self.tires)
        high = min(earlier.reach_rad[1] for earlier in self.tires)
        machine = self.tires[0].machine
        slack, steps = machine.protocol.slip_angle_tolerance_rad, steps_of(machine)
        return tuple(step for step in steps if low - slack <= step <= high + slack)

    def reaches(self, design: Design, *, shift: float = 0.0, known: bool = False) -> tuple[Reach, ...]:
        """Return what a design reaches of every demand at every load asked for, on each tire; empty where it
        lacks one.

        ``shift`` and ``known`` are those of `EarlierTest.rows`.
        """
        reaches = []
        for earlier in self.tires:
            rows = earlier.rows(design, self.demands, shift=shift, known=known)
            for demand, load in itertools.product(self.demands, self.loads_N):
                at_load = earlier.curves[load, "forward"].fit.load_N
                mine = [row for row in rows if is_of(row, demand, at_load)]
                limit = self.protocol_U.get((earlier.tire, demand, load), math.inf)
                reach = worst(demand, mine, load, limit)
                if reach is None:
                    return ()
                reaches.append(dataclasses.replace(reach, tire=earlier.tire))
        return tuple(reaches)

    @cached_property
    def _at_peak(self) -> NDArray[np.bool_]:
        """Which candidates measure the peak: (tires, loads and sides, candidates)."""
        angles = np.array(self.candidates_rad)
        rows = []
        for earlier, load in itertools.product(self.tires, self.loads_N):
            force = np.abs(earlier.force(angles, load, "forward"))
            rows += [
                side & (force >= _PEAK_SHARE * force[side].max(initial=0.0))
                for side in (angles < 0, angles > 0)
            ]
        return np.array(rows)

    @cached_property
    def _at_angles(self) -> NDArray[np.bool_]:
        """Which candidates are the slip angle of a demand at one: (demands at slip angles, candidates)."""
        steps = np.array(self.candidates_rad)
        angles = [demand.SA_rad for demand in self.demands if demand.SA_rad is not None]
        return np.asarray(np.abs(steps - np.array(angles)[:, None]) < _SAME_RAD)

    def covers(self, points: Points) -> bool:
        """Tell whether candidates give a curve: enough, none twice, to either peak, all that are demanded."""
        places = list(dict.fromkeys(points))
        if len(places) < max(MIN_POINTS, len(points)):
            return False
        needed = np.concatenate([self._at_peak, self._at_angles])
        return bool(needed[:, places].any(axis=1).all())

    def refuse_what_no_design_has(self) -> None:
        """Refuse a demand at a slip angle where the machine cannot stand or the earlier test has no curve.

        Raises
        ------
        ConfigError
            ``plan-demand``
        """
        refuse_unmeasured(self.demands, self.candidates_rad)


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """A design with what it reaches; ``excess`` by how much it goes beyond time, energy or warmth.

    ``openness`` of the curves between its slip angles, over what is allowed (`screen`); ``understated`` the
    largest u by the scatter that the earlier test shows, over what its own residuals will say; ``demanded``
    is whether anything was asked of it.
    """

    design: Design
    reaches: tuple[Reach, ...]
    minutes: float
    excess: float = 0.0
    openness: float = 0.0
    understated: float = 1.0
    demanded: bool = True

    @property
    def worst(self) -> float:
        """The largest of U over what was demanded; at most 1 where all demands are met."""
        return max((reach.ratio for reach in self.reaches), default=math.inf if self.demanded else 0.0)

    @property
    def feasible(self) -> bool:
        """Whether every demand is met within the limits, every curve known between its slip angles, and no U
        smaller than what is known of the scatter makes it.
        """
        return self.distance <= (0.0, 1.0)

    @property
    def distance(self) -> tuple[float, float]:
        """How far beyond its limits it is, and then beyond what is asked of it: at most 0 and 1 serve."""
        return self.excess, max(self.worst, self.openness, self.understated / _ALIKE)


class ProtocolSearch:
    """The search for one question at a choice of loads; what was judged is kept for every size."""

    def __init__(
        self,
        question: Question,
        tread: Tread,
        loads_N: tuple[float, ...],
        *,
        minutes: float = math.inf,
        tell: Callable[[str], None] = lambda _text: None,
    ) -> None:
        self.question, self.tread, self.loads_N, self._tell = question, tread, loads_N, tell
        self.candidates = question.candidates_rad
        self.exposure = Exposure(
            energies_J=tread.energies_J(self._full),
            minutes=np.array([tread.minutes(self.design((i,))) for i in range(len(self.candidates))]),
            energy_limit_J=tread.energy_J,
            minutes_limit=minutes,
        )
        self._points = PointSearch(self._criterion, len(self.candidates))
        self._best: dict[int, Points] = {}
        self._judged: dict[Design, Judged] = {}

    @property
    def _full(self) -> Design:
        """The design of every candidate."""
        return self.design(tuple(range(len(self.candidates))))

    @cached_property
    def _screens(self) -> tuple[Screen, ...]:
        """Of each tire: made when a design is asked for, which a time that holds none never does."""
        reaches = self.question.reaches(self._full)
        return tuple(
            screen_of(earlier, self._full, [reach for reach in reaches if reach.tire == earlier.tire])
            for earlier in self.question.tires
        )

    def design(self, points: Points) -> Design:
        """Return the design of slip angles at the search's loads, in all directions that are needed."""
        angles = tuple(self.candidates[i] for i in points)
        return Design(slip_angles_rad=angles, loads_N=self.loads_N, rotations=self.question.rotations)

    def judged(self, design: Design) -> Judged:
        """Return a design with what it reaches; one that was judged before is not judged again."""
        if design not in self._judged:
            judged = self._judge(design)
            if judged.feasible and judged.demanded:
                known = self.question.reaches(design, known=True)
                pairs = zip(known, judged.reaches, strict=True)
                understated = max(
                    (by_known.u / shown.u for by_known, shown in pairs if shown.u > 0), default=1.0
                )
                judged = dataclasses.replace(judged, understated=understated)
            self._judged[design] = judged
        return self._judged[design]

    def _judge(self, design: Design) -> Judged:
        points = [self.candidates.index(angle) for angle in design.slip_angles_rad]
        return Judged(
            design=design, reaches=self.question.reaches(design), minutes=self.tread.minutes(design),
            excess=self.exposure.excess(points),
            openness=openness(self._screens, points),
            demanded=bool(self.question.demands),
        )  # fmt: skip

    def best(self, size: int) -> Judged:
        """Return the best design of a number of recordings in each direction."""
        if size not in self._best:
            self._tell(f"{size} slip angles")
            larger = min((n for n in self._best if n > size), default=None)
            start = self._best[larger] if larger else tuple(range(len(self.candidates)))
            self._points.best((self._points.resized(start, size), *self._drawn(size)))
            self._best[size] = self._nearest(self._points.nearest(size, _NEAR))
        return self.judged(self.design(self._best[size]))

    def _nearest(self, designs: Sequence[Points]) -> Points:
        """Return the first design that serves, or the nearest to it.

        The exchange does not know what a design's own residuals will tell of the scatter.
        """
        distances = []
        for points in designs:
            judged = self.judged(self.design(points))
            if judged.feasible:
                return points
            distances.append(judged.distance)
            if judged.distance > (0.0, _FAR):
                break
        return designs[min(range(len(distances)), key=distances.__getitem__)]

    def _drawn(self, size: int) -> Iterator[Points]:
        """Yield designs of a size drawn at random, the same for the same size."""
        rng = np.random.default_rng([_SEED, size])
        for _ in range(_STARTS):
            yield tuple(rng.choice(len(self.candidates), size=size, replace=False).tolist())

    def least(self, largest: int) -> Judged | None:
        """Return the best design of the fewest slip angles, at most so many, that meets every demand."""
        low, high = MIN_POINTS, largest
        if min(self.tread.energy_J, self.tread.rise_K) < math.inf:
            # Slip angles are not all as gentle: of those that a limit leaves, more are not always better.
            sizes = (self.best(size) for size in range(low, high + 1))
            return next((judged for judged in sizes if judged.feasible), None)
        if high < low or not self.best(high).feasible:
            return None
        while low < high:
            middle = (low + high) // 2
            low, high = (low, middle) if self.best(middle).feasible else (middle + 1, high)
        return self.best(high)

    def nearest(self) -> Judged:
        """Return the design that was nearest to its limits and then to the demands."""
        return min((self.best(size) for size in tuple(self._best)), key=lambda judged: judged.distance)

    def most_within(self, minutes: float) -> int:
        """Return how many slip angles fit into a time."""
        return int(min(minutes / self.exposure.minutes.min() + 1e-9, len(self.candidates)))

    def _criterion(self, designs: Sequence[Points]) -> Array:
        losses = np.full(len(designs), math.inf)
        serves = np.array([self.question.covers(points) for points in designs])
        if serves.any():
            losses[serves] = criterion(self._screens, np.array(designs)[serves])
            losses += [_BEYOND * self.exposure.excess(points) for points in designs]
        return losses


def least_plan(
    question: Question,
    tread: Tread,
    *,
    minutes: float = math.inf,
    beside: float = 0.0,
    tell: Callable[[str], None] = lambda _text: None,
) -> Judged:
    """Return the shortest design that meets every demand, or the nearest to it that the time allows.

    ``minutes`` are those of settled steps; ``beside`` what else the test takes of its time, for the message.

    Further loads beside those that are asked for are tried, nearest first: by its neighbours a block is
    carried to the load that all blocks share. What is returned is not ``feasible`` where no design meets the
    demands within time, and what the tread may be put to.

    Raises
    ------
    ConfigError
        ``plan-infeasible``: the time does not hold the smallest design, or none that leaves no curve open
    """
    met, missed, shortest = None, None, math.inf
    for loads in load_sets(question):
        tell(f"{len(loads)} loads")
        search = ProtocolSearch(question, tread, loads, minutes=minutes, tell=tell)
        shortest = min(shortest, MIN_POINTS * float(search.exposure.minutes.min()))
        points = search.most_within(min(minutes, math.inf if met is None else met.minutes))
        if points < MIN_POINTS:
            continue
        least = search.least(points)
        if least is not None:
            met = least if met is None or least.minutes < met.minutes else met
        elif met is None:
            nearest = search.nearest()
            nearer = missed is None or nearest.distance < missed.distance
            missed = nearest if nearer else missed
    if met is None and missed is None:
        raise _too_short(minutes, shortest, beside)
    if met is None and missed is not None and missed.openness > 1 >= missed.worst and minutes < math.inf:
        longer = least_plan(question, tread, beside=beside, tell=tell)
        if longer.feasible:
            count = len(longer.design.slip_angles_rad)
            raise _too_short(minutes, longer.minutes, beside, count, "the fewest that leave no curve open")
    return met or cast("Judged", missed)


def refuse_unmeasured(demands: Sequence[Demand], steps_rad: Sequence[float]) -> None:
    """Refuse a demand at a slip angle that is none of the steps [rad] of a test.

    Raises
    ------
    ConfigError
        ``plan-demand``, with the steps
    """
    absent = [
        demand.label
        for demand in demands
        if demand.SA_rad is not None and not any(_same(step, demand.SA_rad) for step in steps_rad)
    ]
    if absent:
        steps = ", ".join(f"{math.degrees(angle):.4g}" for angle in steps_rad)
        raise ConfigError(
            "a demand is at a slip angle that no planned test measures", where="--u",
            got=", ".join(absent), expected=f"one of {steps} deg",
            next_step="name one of those; nothing was written", rule="plan-demand",
        )  # fmt: skip


def _same(step_rad: float, angle_rad: float) -> bool:
    return abs(step_rad - angle_rad) < _SAME_RAD


def refuse_too_short(demands: Sequence[Demand], loads_N: Sequence[float], pace: Pace, minutes: float) -> None:
    """Refuse a time that does not hold the smallest design, before anything is known of a tire.

    Raises
    ------
    ConfigError
        ``plan-infeasible``, with the least time
    """
    smallest = Design(
        slip_angles_rad=(0.0,) * MIN_POINTS, loads_N=tuple(loads_N), rotations=rotations_of(demands)
    )
    if pace.minutes(smallest) > minutes:
        raise _too_short(minutes, pace.minutes(smallest), 0.0)


def _too_short(
    minutes: float,
    shortest: float,
    beside: float,
    points: int = MIN_POINTS,
    why: str = "the fewest of a curve",
) -> ConfigError:
    return ConfigError(
        "no test fits into the time", where="--minutes", got=f"{minutes + beside:g} min",
        expected=f"{math.ceil(10 * (shortest + beside)) / 10:g} min at least: {points} slip angles, "
        f"{why}{', and the sweeps' * (beside > 0)}",
        next_step="allow more time, or ask for fewer loads", rule="plan-infeasible",
    )  # fmt: skip


def rotations_of(demands: Sequence[Demand]) -> tuple[Rotation, ...]:
    """Return the directions that demands need: forward alone where none is of both."""
    both = any(by_name()[demand.characteristic].scope == "load" for demand in demands)
    return ROTATIONS if both else ROTATIONS[:1]


def shared_loads(tires: Sequence[EarlierTest]) -> tuple[float, ...]:
    """Return the nominal loads that every earlier test measured [N]."""
    return tuple(load for load in tires[0].loads_N if all(load in other.loads_N for other in tires))


def load_sets(question: Question) -> tuple[tuple[float, ...], ...]:
    """Return the loads that are asked for, then with one more each time, the nearest first."""
    asked = question.loads_N
    remaining = sorted(
        (load for load in shared_loads(question.tires) if load not in asked),
        key=lambda load: min(abs(load - wished) for wished in asked),
    )
    return tuple(tuple(sorted((*asked, *remaining[:count]))) for count in range(len(remaining) + 1))
