"""The run that parts members of a class: a search over what can be changed of the runs that were made.

Factors of a run (`run_changes`) are changed one by one (`exchange`), each to the alternative in which the
members' predictions are furthest apart.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from toolkit.diagnosis.case.case import Run
from toolkit.diagnosis.fit.problem import Problem
from toolkit.diagnosis.policy import VERDICT
from toolkit.planning.drives import Drive
from toolkit.planning.exchange import Alternatives, exchanged, is_less
from toolkit.planning.members import (
    Member,
    Predicted,
    completed,
    denser,
    evidence_a_second,
    expected_log_evidence,
    predict,
)
from toolkit.planning.run_changes import (
    RATES,
    Change,
    Level,
    RunLimits,
    changed,
    conditions,
    densities,
    lengths,
    movable,
)

_SIZES = (0.0, 0.5, 1.0, 2.0, 4.0)
_LEVELS: tuple[Level, ...] = ("low", "high")
_CYCLES = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
_STEPS = (2, 3, 5, 9)  # levels of a course
_ROWS = 3  # of a recording, for a move of a course
_ROUNDS = 2
_CERTAIN = 2 * VERDICT.close
_MOST_TIMES = 2**24  # beyond which no number is told
MOST_RECORDINGS = 1000
"""Recordings of one run that a plan asks for: of more it says how long they would take, and plans none."""
_ENOUGH = (1 - 1e-6) * _CERTAIN  # what lacks less is certain, and as good as any other


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NextRun:
    """A run with what it parts, made so many ``times``, one after the other.

    ``pairs`` are (true member, other, expected log-evidence); ``power`` the chance that the
    true one is named.
    """

    change: Change
    run: Run
    pairs: tuple[tuple[str, str, float], ...]
    predicted: tuple[Predicted, ...]
    power: float
    times: int = 1

    @property
    def seconds(self) -> float:
        """How long it takes, all of its recordings."""
        return self.times * float(self.run.t[-1] - self.run.t[0])

    @property
    def together(self) -> tuple[tuple[str, str], ...]:
        """Pairs that stay: whichever of both is true, the other is not expected to fall behind it."""
        apart = {(true, rival): gain for true, rival, gain in self.pairs}
        return tuple((a, b) for a, b in apart if a < b and min(apart[a, b], apart[b, a]) <= VERDICT.close)

    @property
    def parts(self) -> bool:
        """Tell whether it parts any pair."""
        return 2 * len(self.together) < len(self.pairs)


@dataclass(slots=True, kw_only=True, eq=False)
class RunSearch:
    """The search of one class.

    ``until`` is asked whether there is time left; ``learn`` is told runs before they are simulated;
    ``farthest`` is the most log-evidence a second that any row of any run tells, whatever is fitted.
    """

    problem: Problem
    members: tuple[Member, ...]
    limits: RunLimits
    until: Callable[[], bool] = lambda: True
    learn: Callable[[Sequence[Run]], None] = lambda _runs: None
    judged: dict[Run, float] = field(default_factory=dict)
    runs: dict[Change, Run | None] = field(default_factory=dict)
    dense: dict[Run, tuple[Run, Run]] = field(default_factory=dict)
    farthest: float = 0.0
    _alike: dict[Any, Run] = field(default_factory=dict)

    def best(self) -> Change:
        """Return the change of a recording that parts the members furthest."""
        recorded = Change(run=self.problem.runs[0].name)
        # Of several inputs beyond their limits none can be changed alone.
        courses = tuple((name, Drive(cycles=1.0)) for name in self._names)
        driven = dataclasses.replace(recorded, drives=courses)
        start = next((change for change in (recorded, driven) if self._run(change) is not None), recorded)
        factors = range(len(self.factors(start)))
        return exchanged(start, self._alternatives, lambda: factors, sweeps=_ROUNDS)

    def _alternatives(self, change: Change, factor: int) -> Alternatives[Change]:
        changes = (change, *self.factors(change)[factor])
        present = self._run(change)
        if present is not None and self.judged.get(present, 0.0) >= _ENOUGH:
            changes = (change,)  # nothing can be won
        runs = [self._run(new) for new in changes]
        fresh = [run for run in dict.fromkeys(runs) if run is not None and run not in self.judged]
        if self.until() or not self.judged:
            self._learn(fresh)
        self._judge_all(fresh)
        losses = np.array([math.inf if run is None else -self.judged.get(run, -math.inf) for run in runs])
        return Alternatives(losses=losses, present=0, design=lambda place: changes[place])

    def _judge_all(self, runs: Iterable[Run]) -> None:
        """Judge runs by the expected log-evidence of all pairs, each up to certainty; -inf where none can be.

        What rows leave open, and whether derivatives hold, only lowers it: the most promising runs are asked
        for it first, and those that are no better without than the best are not asked.
        """
        rough: dict[Run, tuple[float, tuple[Predicted, ...]]] = {}
        for run in runs:
            if (self.judged or rough) and not self.until():
                break
            predictions = self._predictions(run)
            worth = -math.inf if predictions is None else self._worth(run, predictions)
            if predictions is None or worth < _ENOUGH:
                rough[run] = worth, predictions or ()
                continue
            self.judged[run] = self._worth_completed(run, predictions)
            if self.judged[run] >= _ENOUGH:
                return  # of runs that are certain the first counts
        best = max(self.judged.values(), default=-math.inf)
        for run, (worth, predictions) in sorted(rough.items(), key=lambda entry: -entry[1][0]):
            if is_less(-worth, -best):
                if self.judged and not self.until():
                    break
                worth = self._worth_completed(run, predictions)
            self.judged[run] = worth
            best = max(best, worth)

    def _run(self, change: Change) -> Run | None:
        """Return the changed run; of changes that come to the same inputs the first one's."""
        if change not in self.runs:
            run = changed(self.problem, change, self.limits)
            if run is not None:
                columns = ((name, column.tobytes()) for name, column in run.columns.items())
                told = repr((sorted(run.conditions.items()), sorted(run.declared.items())))
                run = self._alike.setdefault((told, run.t.tobytes(), *columns), run)
            self.runs[change] = run
            if run is not None and run not in self.dense and self.problem.case.has_time and run.rows > 2:
                self.dense[run] = denser(run, [channel.name for channel in self.problem.case.drivers])
        return self.runs[change]

    def _learn(self, runs: Iterable[Run | None]) -> None:
        known = [run for run in runs if run is not None]
        self.learn([*known, *(dense for run in known for dense in self.dense.get(run, ()))])

    def _worth_completed(self, run: Run, rough: Sequence[Predicted]) -> float:
        predictions = self._completed(run, rough)
        return -math.inf if predictions is None else self._worth(run, predictions)

    def _worth(self, run: Run, predictions: Sequence[Predicted]) -> float:
        apart = [gain for _, _, gain in self._pairs(run, predictions)]
        # Beyond certainty nothing is won: a run that parts further pairs is better than one that parts one
        # pair further. Of runs that are as good, the first counts, which is the nearest to the recording:
        # what is far from it the members' fits say nothing of.
        worth = [_CERTAIN * (1 - math.exp(-max(gain, 0.0) / _CERTAIN)) for gain in apart]
        return min(float(np.mean(worth)), _ENOUGH)

    def _predictions(self, run: Run) -> tuple[Predicted, ...] | None:
        return _all_known(predict(self.problem, member, run) for member in self.members)

    def _completed(self, run: Run, predictions: Sequence[Predicted]) -> tuple[Predicted, ...] | None:
        dense = self.dense.get(run, ())
        return _all_known(
            completed(self.problem, member, run, predicted, dense)
            for member, predicted in zip(self.members, predictions, strict=True)
        )

    def _pairs(
        self, run: Run, predictions: Sequence[Predicted], times: float = 1.0
    ) -> tuple[tuple[str, str, float], ...]:
        named = list(zip(self.members, predictions, strict=True))
        for (a, true), (b, rival) in itertools.combinations(named, 2):
            self.farthest = max(self.farthest, evidence_a_second(run, (a, b), true, rival))
        return tuple(
            (a.label, b.label, expected_log_evidence(run, (a, b), true, rival, times=times))
            for a, true in named
            for b, rival in named
            if a is not b
        )

    @property
    def _names(self) -> tuple[str, ...]:
        return tuple(name for name, source in movable(self.problem, self.limits) if source is None)

    def factors(self, change: Change) -> list[tuple[Change, ...]]:
        """Return what each factor of a change may be instead: the recording first."""
        recorded = {run.name: run for run in self.problem.runs}
        dense = {name: densities(run, self.limits) for name, run in recorded.items()}
        factors = [
            tuple(
                self._resized(dataclasses.replace(change, run=name, rows=min(change.rows, dense[name][-1])))
                for name in recorded
            ),
            tuple(self._resized(dataclasses.replace(change, rows=times)) for times in dense[change.run]),
        ]
        for key, values in conditions(self.problem).items():
            rest = tuple(entry for entry in change.conditions if entry[0] != key)
            turned = (dataclasses.replace(change, conditions=(*rest, (key, value))) for value in values)
            factors.append((dataclasses.replace(change, conditions=rest), *turned))
        for name in self._names:
            factors += self._courses(change, name)
        names = [name for name in self._names if name not in dict(change.drives)]
        rates = RATES if names else (change.rate,)
        of_courses = tuple(entry for entry in change.sizes if entry[0] not in names)
        # Faster, and where a rate of change is limited, as much less far.
        factors.append(tuple(dataclasses.replace(change, rate=rate) for rate in rates))
        factors.append(
            tuple(
                dataclasses.replace(change, rate=rate, sizes=(*of_courses, *((n, 1 / rate) for n in names)))
                for rate in rates
            )
        )
        for name in self._names:
            sizes = tuple(entry for entry in change.sizes if entry[0] != name)
            factors.append(
                tuple(dataclasses.replace(change, sizes=(*sizes, (name, size))) for size in _SIZES)
            )
            others = tuple(entry for entry in change.mirrored if entry != name)
            # A course goes to either side by itself.
            signs = (others, (*others, name)) if name in names else (others,)
            factors.append(tuple(dataclasses.replace(change, mirrored=turned) for turned in signs))
            flat = tuple(entry for entry in change.levels if entry[0] != name)
            moved = (dataclasses.replace(change, levels=(*flat, (name, level))) for level in _LEVELS)
            factors.append((dataclasses.replace(change, levels=flat), *moved))
        # The last of all: what parts in less time is tried before.
        possible = lengths(recorded[change.run], change.rows, self.limits)
        factors.append(tuple(_as_long(change, times) for times in possible))
        return factors

    def _resized(self, change: Change) -> Change:
        """Return a change of another recording or other rows, no longer than these may be."""
        run = next(run for run in self.problem.runs if run.name == change.run)
        return _as_long(change, min(change.length, lengths(run, change.rows, self.limits)[-1]))

    def _courses(self, change: Change, name: str) -> list[tuple[Change, ...]]:
        """Return two factors of an input: how often its course goes up and down, and over which levels."""
        others = tuple(entry for entry in change.drives if entry[0] != name)
        present = dict(change.drives).get(name, Drive(cycles=_CYCLES[0] * change.length))
        rows = change.rows * change.length
        rows *= next(run.rows for run in self.problem.runs if run.name == change.run)

        def with_course(**more: Any) -> tuple[Change, ...]:
            course = dataclasses.replace(present, **more)
            if 2 * (course.levels - 1) * course.cycles * _ROWS > rows:
                return ()
            return (dataclasses.replace(change, drives=(*others, (name, course))),)

        paces = [
            with_course(cycles=cycles * change.length, swept=swept)
            for swept in (False, True)
            for cycles in _CYCLES
        ]
        shapes = [with_course(levels=levels, rests=rests) for rests in (True, False) for levels in _STEPS]
        recorded = dataclasses.replace(change, drives=others)
        return [
            (recorded, *itertools.chain.from_iterable(paces)),
            tuple(itertools.chain.from_iterable(shapes)) if name in dict(change.drives) else (change,),
        ]

    def judge(self, change: Change) -> NextRun | None:
        """Return a changed run with what it parts; None where it cannot be simulated."""
        new = change not in self.runs
        run = self._run(change)
        if new and run is not None:
            self._learn([run])
        rough = None if run is None else self._predictions(run)
        predictions = None if run is None or rough is None else self._completed(run, rough)
        if run is None or predictions is None:
            return None
        pairs = self._pairs(run, predictions)
        return NextRun(change=change, run=run, pairs=pairs, predicted=predictions, power=power_of(pairs))

    def repeated(self, chosen: NextRun, *, power: float = 0.0) -> NextRun | None:
        """Return a run made as often as it takes until it parts a pair, with a power at least.

        None where so many times are not enough that nobody makes them.
        """
        low, high = 1, 2
        while not _serves(found := self._made(chosen, high), power):
            low, high = high, 2 * high
            if high > _MOST_TIMES:
                return None
        while high - low > 1:
            middle = (low + high) // 2
            if _serves(tried := self._made(chosen, middle), power):
                high, found = middle, tried
            else:
                low = middle
        return found

    def made_again(self, chosen: NextRun) -> NextRun | None:
        """Return a run that parts no pair, made again and again within the longest time; None for none.

        As often as the time holds, and no oftener than it takes to be sure of the true member.
        """
        most = int(self.limits.longest_s / chosen.seconds * (1 + 1e-9)) if chosen.seconds > 0 else 0
        most = min(most, MOST_RECORDINGS)
        if most < 2 or (least := self.repeated(chosen)) is None or least.times > most:
            return None
        sure = self.repeated(chosen, power=VERDICT.interval)
        return sure if sure is not None and sure.times <= most else self._made(chosen, most)

    def _made(self, chosen: NextRun, times: int) -> NextRun:
        pairs = self._pairs(chosen.run, chosen.predicted, times)
        return dataclasses.replace(chosen, pairs=pairs, power=power_of(pairs), times=times)


def _serves(made: NextRun, power: float) -> bool:
    return made.parts and made.power >= power


def _as_long(change: Change, times: float) -> Change:
    """Return a change so many times as long as the recording, its courses going on as they went."""
    more = times / change.length
    drives = tuple(
        (name, dataclasses.replace(drive, cycles=drive.cycles * more)) for name, drive in change.drives
    )
    return change if more == 1 else dataclasses.replace(change, length=times, drives=drives)


def _all_known(predictions: Iterable[Predicted | None]) -> tuple[Predicted, ...] | None:
    known = []
    for predicted in predictions:
        if predicted is None:
            return None
        known.append(predicted)
    return tuple(known)


def power_of(pairs: Sequence[tuple[str, str, float]]) -> float:
    """Return the chance that a run puts the true member ahead of all others by what a diagnosis asks for.

    A log-likelihood ratio of two Gaussians of mean m has the variance 2 m; of the others the nearest counts,
    and every member is as likely to be the true one.

    >>> round(power_of([("a", "b", 3.0), ("b", "a", 3.0)]), 2), round(power_of([("a", "b", 30.0)]), 4)
    (0.5, 0.9998)
    """
    from scipy.special import ndtr

    chances: dict[str, float] = {}
    for true, _, gain in pairs:
        chance = float(ndtr((gain - VERDICT.close) / math.sqrt(2 * gain))) if gain > 0 else 0.0
        chances[true] = min(chances.get(true, 1.0), chance)
    return sum(chances.values()) / len(chances)
