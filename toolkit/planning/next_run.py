"""The run that parts members of a class: a search over what can be changed of the runs that were made.

A run is a recording of the case with factors changed one by one (`exchange`): how fast its inputs
go, how far, which way, which of them alone moves, a condition such as the way the drum turns or how the tire
stands on its hub. Inputs stay within what was recorded, or within limits that are given. A channel that is
another one's rate of change stays that. A covariate is measured and not set: it goes on as it was recorded,
unless a limit is given, which says that it can be set.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np

from toolkit.diagnosis.policy import VERDICT
from toolkit.diagnosis.simulators.setting import pauses
from toolkit.planning.exchange import Alternatives, exchanged
from toolkit.planning.members import Member, Predicted, expected_log_evidence, predict
from toolkit.units import unit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.diagnosis.case.case import Run
    from toolkit.diagnosis.fit.problem import Problem

    Array = NDArray[np.float64]
    Limits = Mapping[str, tuple[float, float]]

Level = Literal["low", "high"]

_RATES = (0.25, 0.5, 1.0, 2.0, 4.0)
_SIZES = (0.0, 0.5, 1.0, 2.0, 4.0)
_LEVELS: tuple[Level, ...] = ("low", "high")
_OF_A_RECORDING = ("phase", "date", "order", "repeat_of", "file")  # and of no other run
_IS_RATE = 0.98  # of the variance of a channel that another one's derivative explains
_ROUNDS = 2
_CERTAIN = 2 * VERDICT.close
# What else can be done with a tire on a drum, beside the conditions that the recordings have.
_TURNS = {"mounting": ("normal", "turned"), "rotation": ("forward", "reverse")}


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """What is changed of a recording: nothing by default.

    ``rate`` of the inputs, ``sizes`` of each about its middle, ``mirrored`` those whose sign is turned, rates
    of change with them, ``levels`` of those that are moved to an end of their limits, ``conditions`` that
    differ.
    """

    run: str
    rate: float = 1.0
    sizes: tuple[tuple[str, float], ...] = ()
    mirrored: tuple[str, ...] = ()
    levels: tuple[tuple[str, Level], ...] = ()
    conditions: tuple[tuple[str, str], ...] = ()

    def words(self) -> tuple[str, ...]:
        """Return what an operator has to do, one statement each."""
        statements = [f"drive the inputs of {self.run}"]
        if self.rate != 1.0:
            statements.append(f"{self.rate:g} times as fast")
        for name, size in self.sizes:
            if size != 1.0:
                statements.append(
                    f"{name} held at its middle" if size == 0 else f"{name} {size:g} times as far"
                )
        statements += [f"{name} with its sign turned" for name in self.mirrored]
        statements += [f"{name} as {level} as its limits allow" for name, level in self.levels]
        statements += [f"{key}: {value}" for key, value in self.conditions]
        return tuple(statements)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NextRun:
    """A run with what it parts.

    ``pairs`` are (true member, other, expected log-evidence); ``power`` the chance that the
    true one is named.
    """

    change: Change
    run: Run
    pairs: tuple[tuple[str, str, float], ...]
    predicted: tuple[Predicted, ...]
    power: float

    @property
    def together(self) -> tuple[tuple[str, str], ...]:
        """Pairs that stay: whichever of both is true, the other is not expected to fall behind it."""
        apart = {(true, rival): gain for true, rival, gain in self.pairs}
        return tuple((a, b) for a, b in apart if a < b and min(apart[a, b], apart[b, a]) <= VERDICT.close)


@dataclass(slots=True, kw_only=True, eq=False)
class RunSearch:
    """The search of one class.

    ``until`` is asked whether there is time left; ``learn`` is told runs before they are simulated.
    """

    problem: Problem
    members: tuple[Member, ...]
    limits: Limits
    until: Callable[[], bool] = lambda: True
    learn: Callable[[Sequence[Run]], None] = lambda _runs: None
    judged: dict[Change, float] = field(default_factory=dict)
    runs: dict[Change, Run | None] = field(default_factory=dict)

    def best(self) -> Change:
        """Return the change of a recording that parts the members furthest."""
        start = Change(run=self.problem.runs[0].name)
        factors = range(len(self.factors(start)))
        return exchanged(start, self._alternatives, lambda: factors, sweeps=_ROUNDS)

    def _alternatives(self, change: Change, factor: int) -> Alternatives[Change]:
        changes = (change, *self.factors(change)[factor])
        runs = [self._run(new) for new in changes if new not in self.judged]
        if self.until() or not self.judged:
            self.learn([run for run in runs if run is not None])
        losses = np.array([-self.value(alternative) for alternative in changes])
        return Alternatives(losses=losses, present=0, design=lambda place: changes[place])

    def _run(self, change: Change) -> Run | None:
        if change not in self.runs:
            self.runs[change] = changed(self.problem, change, self.limits)
        return self.runs[change]

    def value(self, change: Change) -> float:
        """Return the expected log-evidence of all pairs, each up to certainty; -inf where a run cannot be."""
        if change not in self.judged:
            self.judged[change] = self._value(change) if self.until() or not self.judged else -math.inf
        return self.judged[change]

    def _value(self, change: Change) -> float:
        run = self._run(change)
        predictions = None if run is None else self._predictions(run)
        if run is None or predictions is None:
            return -math.inf
        apart = [gain for _, _, gain in self._pairs(run, predictions)]
        # Beyond certainty nothing is won: a run that parts further pairs is better than one that parts one
        # pair further.
        return float(np.mean([_CERTAIN * (1 - math.exp(-max(gain, 0.0) / _CERTAIN)) for gain in apart]))

    def _predictions(self, run: Run) -> tuple[Predicted, ...] | None:
        predictions = tuple(predict(self.problem, member, run) for member in self.members)
        known = tuple(predicted for predicted in predictions if predicted is not None)
        return known if len(known) == len(predictions) else None

    def _pairs(self, run: Run, predictions: Sequence[Predicted]) -> tuple[tuple[str, str, float], ...]:
        named = list(zip(self.members, predictions, strict=True))
        return tuple(
            (a.label, b.label, expected_log_evidence(run, (a, b), true, rival))
            for a, true in named
            for b, rival in named
            if a is not b
        )

    def factors(self, change: Change) -> list[tuple[Change, ...]]:
        """Return what each factor of a change may be instead: the recording first."""
        names = [name for name, source in movable(self.problem, self.limits) if source is None]
        factors = [
            tuple(dataclasses.replace(change, run=run.name) for run in self.problem.runs),
            # Faster, and where a rate of change is limited, as much less far.
            tuple(dataclasses.replace(change, rate=rate) for rate in _RATES),
            tuple(
                dataclasses.replace(change, rate=rate, sizes=tuple((name, 1 / rate) for name in names))
                for rate in _RATES
            ),
        ]
        for name in names:
            sizes = tuple(entry for entry in change.sizes if entry[0] != name)
            factors.append(
                tuple(dataclasses.replace(change, sizes=(*sizes, (name, size))) for size in _SIZES)
            )
            others = tuple(entry for entry in change.mirrored if entry != name)
            factors.append(
                tuple(dataclasses.replace(change, mirrored=turned) for turned in (others, (*others, name)))
            )
            flat = tuple(entry for entry in change.levels if entry[0] != name)
            moved = (dataclasses.replace(change, levels=(*flat, (name, level))) for level in _LEVELS)
            factors.append((dataclasses.replace(change, levels=flat), *moved))
        for key, values in conditions(self.problem).items():
            rest = tuple(entry for entry in change.conditions if entry[0] != key)
            turned = (dataclasses.replace(change, conditions=(*rest, (key, value))) for value in values)
            factors.append((dataclasses.replace(change, conditions=rest), *turned))
        return factors

    def judge(self, change: Change) -> NextRun | None:
        """Return a changed run with what it parts; None where it cannot be simulated."""
        new = change not in self.runs
        run = self._run(change)
        if new and run is not None:
            self.learn([run])
        predictions = None if run is None else self._predictions(run)
        if run is None or predictions is None:
            return None
        pairs = self._pairs(run, predictions)
        return NextRun(change=change, run=run, pairs=pairs, predicted=predictions, power=power_of(pairs))


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


def conditions(problem: Problem) -> dict[str, tuple[str, ...]]:
    """Return the values that each condition may have: those of the recordings, and turns of tire and drum."""
    values: dict[str, tuple[str, ...]] = {}
    for run in problem.case.runs:
        for key, value in run.conditions.items():
            if key not in _OF_A_RECORDING:
                values[key] = tuple(dict.fromkeys((*values.get(key, ()), value)))
    if problem.case.simulation.kind == "machine":
        values |= _TURNS
    return values


def movable(problem: Problem, limits: Limits) -> tuple[tuple[str, str | None], ...]:
    """Return the channels that a run may move, each with the one whose rate of change it is.

    Inputs that go up and down, what they are the rates of change of or have for one, and what has a limit. A
    channel that only grows, such as a shaft's angle, goes on as it was recorded.
    """
    run = max(problem.runs, key=lambda run: run.rows)
    present = [channel for channel in problem.case.drivers if channel.name in run.columns]
    names = [c.name for c in present if c.name in limits or _goes_back(run.columns[c.name])]
    sources = {name: _source(run, name, names) for name in names}
    settable = {c.name for c in present if c.role == "input" or c.name in limits}
    families = {_root(name, sources) for name in settable.intersection(names)}
    return tuple((name, sources[name]) for name in names if _root(name, sources) in families)


def _goes_back(column: Array) -> bool:
    steps = np.diff(column)
    return bool((steps > 0).any() and (steps < 0).any())


def _source(run: Run, name: str, names: Sequence[str]) -> str | None:
    """Return the channel of which another one is the rate of change; None for none."""
    column = run.columns[name] - run.columns[name].mean()
    for source in names:
        if source == name or run.rows < 3:
            continue
        rate = np.gradient(run.columns[source], run.t)
        rate = rate - rate.mean()
        size = float(np.sum(rate**2) * np.sum(column**2))
        # Of a sine the rate's rate is the sine again, with its sign turned: it is not what drives it.
        follows = float(np.sum(rate * column))
        if size > 0 and follows > 0 and follows**2 / size > _IS_RATE:
            return source
    return None


def changed(problem: Problem, change: Change, limits: Limits) -> Run | None:
    """Return the recording as changed; None where an input leaves what it may reach."""
    run = next(run for run in problem.runs if run.name == change.run)
    # Faster inputs come again within the same time, there and back.
    span = run.t[-1] - run.t[0]
    phase = np.mod((run.t - run.t[0]) * change.rate / span, 2.0) if span > 0 else np.zeros(run.rows)
    back = phase > 1.0
    at = run.t[0] + span * np.where(back, 2.0 - phase, phase)
    sizes, levels, columns = dict(change.sizes), dict(change.levels), dict(run.columns)
    sources = dict(movable(problem, limits))
    for name, source in sources.items():
        column = run.columns[name]
        depth, root = 0, source
        while root is not None and depth < len(sources):
            depth, root = depth + 1, sources[root]
        middle = 0.0 if depth else float(np.median(column))
        moved = np.interp(at, run.t, column)
        turn = np.where(back, -1.0, 1.0) ** depth * change.rate**depth
        size = sizes.get(_root(name, sources), 1.0)
        column = middle + size * (moved * turn - middle)
        if _root(name, sources) in change.mirrored:
            column = -column
        low, high = limits.get(name, reach(problem, name))
        if name in levels:
            column = column + (low - column.min() if levels[name] == "low" else high - column.max())
        columns[name] = column
        slack = 1e-9 * max(abs(low), abs(high), 1e-300)
        if column.min() < low - slack or column.max() > high + slack:
            return None
    later = _later(problem, run)
    for channel in problem.case.channels:
        if channel.role == "time":
            columns[channel.name] = run.columns[channel.name] + later / unit(channel.unit).factor
    unchanged = {key: value for key, value in run.conditions.items() if key not in _OF_A_RECORDING}
    return dataclasses.replace(
        run, name="next.csv", t=run.t + later, columns=columns,
        conditions=unchanged | dict(change.conditions), declared={**run.declared, **dict(change.conditions)},
    )  # fmt: skip


def _later(problem: Problem, run: Run) -> float:
    """Return how much later than a recording the next run is [s]; 0 where each run has a clock of its own.

    After the last one, by the pause that runs had on average.
    """
    runs = problem.case.runs
    between = pauses(runs)
    if between is None or not len(between):
        return 0.0
    return float(runs[-1].t[-1] + np.median(between) - run.t[0])


def _root(name: str, sources: Mapping[str, str | None]) -> str:
    for _ in sources:
        source = sources[name]
        if source is None:
            break
        name = source
    return name


def reach(problem: Problem, name: str) -> tuple[float, float]:
    """Return the smallest and largest recorded value of a channel."""
    columns = [run.columns[name] for run in problem.case.runs if name in run.columns]
    return min(float(np.nanmin(c)) for c in columns), max(float(np.nanmax(c)) for c in columns)


def nearest_limits(problem: Problem, limits: Limits) -> tuple[str, dict[str, tuple[float, float]]]:
    """Return the recording that leaves the limits least, and the limits widened as far as it goes.

    The farthest of its inputs counts, in widths of that input's limits.
    """
    excess: dict[str, float] = {}
    widened: dict[str, dict[str, tuple[float, float]]] = {}
    for run in problem.runs:
        wide = {}
        for name, (low, high) in limits.items():
            column = run.columns[name]
            wide[name] = min(low, float(np.min(column))), max(high, float(np.max(column)))
        widened[run.name] = wide
        excess[run.name] = max(
            (high - low) / (limits[name][1] - limits[name][0]) for name, (low, high) in wide.items()
        )
    nearest = min(excess, key=lambda name: excess[name])
    return nearest, widened[nearest]
