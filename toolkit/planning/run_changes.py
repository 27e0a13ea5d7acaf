"""What can be changed of a run that was made, within limits, and the inputs that this gives.

A run is a recording of the case with factors changed: how fast its inputs go, how far, which way, which of
them alone moves, a new course of an input (`drives`), a condition such as the way the drum turns or how the
tire stands on its hub. Inputs stay within what was recorded, or within limits that are given. A channel that
is another one's rate of change stays that. A covariate is measured and not set: it goes on as it was
recorded, unless a limit is given, which says that it can be set. Rows may be denser than recorded where it is
said how dense the data acquisition can record them, and a run longer where it is said how long one may be.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np

from toolkit.arrays import Array
from toolkit.diagnosis.simulators.setting import pauses
from toolkit.planning.drives import Drive, Pace, driven, fastest
from toolkit.planning.members import refined, row_step
from toolkit.units import unit

if TYPE_CHECKING:
    from toolkit.diagnosis.case.case import Run
    from toolkit.diagnosis.fit.problem import Problem


Level = Literal["low", "high"]

RATES = (0.25, 0.5, 1.0, 2.0, 4.0)
"""How many times as fast as recorded a run may be."""
_OF_A_RECORDING = ("phase", "date", "order", "repeat_of", "file")  # and of no other run
_IS_RATE = 0.98  # of the variance of a channel that another one's derivative explains
_DOUBLINGS = 4  # of the rows, and of the time: each takes twice as long to simulate
_MOST_ROWS = 64  # for each row of a recording, by both
_SLACK = 1e-9
_BETWEEN_ROWS = 0.01  # of an input's span, by which a straight line from row to row may miss its course
# What else can be done with a tire on a drum, beside the conditions that the recordings have.
_TURNS = {"mounting": ("normal", "turned"), "rotation": ("forward", "reverse")}


@dataclass(frozen=True, slots=True, kw_only=True)
class RunLimits:
    """What the machine allows, by channel in its unit: ``values`` (low, high), ``rates`` a second.

    ``step_s`` is the least time from row to row [s] that the data acquisition can record, ``longest_s`` the
    longest that a run may take. What is not stated is as recorded: the span of values, up to four times the
    rate, the rows and their time.
    """

    values: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    rates: Mapping[str, float] = field(default_factory=dict)
    step_s: float = math.inf
    longest_s: float = 0.0

    def __bool__(self) -> bool:
        """Tell whether anything is stated that a recording may not keep."""
        return bool(self.values or self.rates)


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """What is changed of a recording: nothing by default.

    ``rate`` of the inputs, ``sizes`` of each about its middle, ``mirrored`` those whose sign is turned, rates
    of change with them, ``levels`` of those that are moved to an end of their limits, ``drives`` those that
    have a course of their own between their limits, ``conditions`` that differ. ``rows`` are recorded for
    each row of the recording; the run is ``length`` times as long: inputs that have no course of their own
    then go back and forth.
    """

    run: str
    rows: int = 1
    length: float = 1.0
    rate: float = 1.0
    sizes: tuple[tuple[str, float], ...] = ()
    mirrored: tuple[str, ...] = ()
    levels: tuple[tuple[str, Level], ...] = ()
    drives: tuple[tuple[str, Drive], ...] = ()
    conditions: tuple[tuple[str, str], ...] = ()

    def words(self) -> tuple[str, ...]:
        """Return what an operator has to do, one statement each."""
        statements = [f"drive the inputs of {self.run}"]
        if self.rate != 1.0:
            statements.append(f"{self.rate:g} times as fast")
        if self.length != 1.0:
            statements.append(f"{self.length:.4g} times as long, back and forth")
        at_rest = {name for name, size in self.sizes if size == 0}
        statements += [f"{name} {drive.words()}" for name, drive in self.drives if name not in at_rest]
        for name, size in self.sizes:
            if size != 1.0:
                statements.append(
                    f"{name} held at its middle" if size == 0 else f"{name} {size:g} times as far"
                )
        statements += [
            f"{name} with its sign turned" for name in self.mirrored if name not in dict(self.drives)
        ]
        statements += [f"{name} as {level} as its limits allow" for name, level in self.levels]
        if self.rows > 1:
            statements.append(f"recorded with rows {self.rows} times as dense")
        statements += [f"{key}: {value}" for key, value in self.conditions]
        return tuple(statements)


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


def movable(problem: Problem, limits: RunLimits) -> tuple[tuple[str, str | None], ...]:
    """Return the channels that a run may move, each with the one whose rate of change it is.

    Inputs that go up and down, what they are the rates of change of or have for one, and what has a limit. A
    channel that only grows, such as a shaft's angle, goes on as it was recorded.
    """
    run = max(problem.runs, key=lambda run: run.rows)
    present = [channel for channel in problem.case.drivers if channel.name in run.columns]
    stated = {*limits.values, *limits.rates}
    names = [c.name for c in present if c.name in stated or _goes_back(run.columns[c.name])]
    sources = {name: _source(run, name, names) for name in names}
    settable = {c.name for c in present if c.role == "input" or c.name in stated}
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


def changed(problem: Problem, change: Change, limits: RunLimits) -> Run | None:
    """Return the recording as changed; None where an input leaves what it may reach, or is too fast."""
    recording = refined(next(run for run in problem.runs if run.name == change.run), change.rows)
    run = lengthened(recording, change.length)
    # Faster inputs, and those of a longer run, come again, there and back.
    span = recording.t[-1] - recording.t[0]
    phase = np.mod((run.t - run.t[0]) * change.rate / span, 2.0) if span > 0 else np.zeros(run.rows)
    back = phase > 1.0
    at = run.t[0] + span * np.where(back, 2.0 - phase, phase)
    sizes, levels, drives = dict(change.sizes), dict(change.levels), dict(change.drives)
    columns = dict(run.columns)
    sources = dict(movable(problem, limits))
    for name, depth in sorted(_depths(sources).items(), key=lambda entry: entry[1]):
        column, source, root = run.columns[name], sources[name], _root(name, sources)
        known = reach(problem, name)
        low, high = limits.values.get(name, known)
        if known[1] < low or known[0] > high:
            return None  # the members are known nowhere there
        if root in drives:
            if source is None:
                ends = _ends(low, high, sizes.get(name, 1.0), levels.get(name))
                pace = _pace(problem, name, sources, limits).told_by_rows(
                    row_step(run), _BETWEEN_ROWS * (high - low)
                )
                start = min(max(float(column[0]), low), high)
                column = driven(run.t, drives[name], start, ends, pace)
            else:
                column = _gain(run, source, name) * np.gradient(columns[source], run.t)
        else:
            column = recording.columns[name]
            middle = 0.0 if depth else float(np.median(column))
            turn = np.where(back, -1.0, 1.0) ** depth * change.rate**depth
            column = middle + sizes.get(root, 1.0) * (np.interp(at, recording.t, column) * turn - middle)
            if root in change.mirrored:
                column = -column
            if name in levels:
                column = column + (low - column.min() if levels[name] == "low" else high - column.max())
        columns[name] = column
        slack = _SLACK * max(abs(low), abs(high), 1e-300)
        if column.min() < low - slack or column.max() > high + slack:
            return None
        if name in limits.rates and fastest(run.t, column) > limits.rates[name] * (1 + _SLACK):
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


def densities(run: Run, limits: RunLimits) -> tuple[int, ...]:
    """Return how many rows may be recorded for each row of a recording: 1, 2, 4 and so on."""
    return tuple(
        2**power
        for power in range(_DOUBLINGS + 1)
        if power == 0 or row_step(run) >= 2**power * limits.step_s * (1 - _SLACK)
    )


def lengths(run: Run, rows: int, limits: RunLimits) -> tuple[float, ...]:
    """Return how many times as long as a recording a run may be: 1, 2, 4 and so on, and as long as may be.

    ``rows`` for each of the recording leave fewer doublings.
    """
    span = float(run.t[-1] - run.t[0])
    most = min(limits.longest_s / span if span > 0 else 1.0, 2.0**_DOUBLINGS, _MOST_ROWS / rows)
    doubled = [2.0**power for power in range(_DOUBLINGS + 1) if 2.0**power <= max(most, 1.0) * (1 + _SLACK)]
    return (*doubled, most) if most > doubled[-1] * (1 + _SLACK) else tuple(doubled)


def lengthened(run: Run, times: float) -> Run:
    """Return a run so many times as long: its rows back and forth, and on where a channel only grows.

    So does the time, and so does the angle of a shaft: the recording is turned round about its end.
    """
    if times == 1.0 or run.rows < 2:
        return run
    last = run.rows - 1
    rounds, place = np.divmod(np.arange(round(last * times) + 1), last)
    place = np.where(rounds % 2 == 1, last - place, place)

    def on(column: Array) -> Array:
        if _goes_back(column):
            return np.asarray(column[place])
        begun = rounds + rounds % 2  # of a way back: twice its end less what was
        sign = np.where(rounds % 2 == 1, -1.0, 1.0)
        start, step = column[0], column[-1] - column[0]
        return np.asarray(start + begun * step + sign * (column[place] - start))

    columns = {name: on(column) for name, column in run.columns.items()}
    return dataclasses.replace(run, t=on(run.t), columns=columns)


def _depths(sources: Mapping[str, str | None]) -> dict[str, int]:
    """Return of each channel how many rates of change it is away from what drives it."""
    depths = {}
    for name in sources:
        depth, source = 0, sources[name]
        while source is not None and depth < len(sources):
            depth, source = depth + 1, sources[source]
        depths[name] = depth
    return depths


def _ends(low: float, high: float, size: float, level: Level | None) -> tuple[float, float]:
    """Return the ends of a course: a part of what an input may reach, about its middle or at one end."""
    span = size * (high - low)
    if level is not None:
        return (low, low + span) if level == "low" else (high - span, high)
    return (low + high - span) / 2, (low + high + span) / 2


def _pace(problem: Problem, name: str, sources: Mapping[str, str | None], limits: RunLimits) -> Pace:
    """Return how fast an input may change: as stated, by the limits of its rates, or as it was recorded."""
    runs = [run for run in problem.case.runs if name in run.columns]
    recorded = max(fastest(run.t, run.columns[name]) for run in runs)
    paces = [limits.rates.get(name, RATES[-1] * recorded), math.inf]
    child: str | None = name
    for order in range(2):
        source = child
        child = next((rate for rate, of in sources.items() if of == source), None)
        if child is None or source is None:
            break
        low, high = limits.values.get(child, reach(problem, child))
        gain = max((_gain(run, source, child) for run in runs), default=1.0)
        paces[order] = min(paces[order], max(min(-low, high), 0.0) / gain)
    return Pace(rate=paces[0], acceleration=paces[1])


def _gain(run: Run, source: str, name: str) -> float:
    """Return a channel over the rate of change that it is: 1 where their units fit."""
    rate = np.gradient(run.columns[source], run.t)
    size = float(np.sum(rate**2))
    return float(np.sum(rate * run.columns[name])) / size if size > 0 else 1.0


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


def nearest_limits(problem: Problem, limits: RunLimits) -> tuple[str, RunLimits]:
    """Return the recording that leaves the limits least, and the limits widened as far as it goes.

    The farthest of its inputs counts, in widths of that input's limits, or times its rate.
    """
    excess: dict[str, float] = {}
    widened: dict[str, RunLimits] = {}
    for run in problem.runs:
        values = {
            name: (min(low, float(np.min(run.columns[name]))), max(high, float(np.max(run.columns[name]))))
            for name, (low, high) in limits.values.items()
        }
        rates = {name: max(rate, fastest(run.t, run.columns[name])) for name, rate in limits.rates.items()}
        widened[run.name] = RunLimits(values=values, rates=rates)
        spans = {name: limits.values[name][1] - limits.values[name][0] for name in values}
        excess[run.name] = max(
            *((high - low) / spans[name] for name, (low, high) in values.items()),
            *(rate / limits.rates[name] for name, rate in rates.items()),
            1.0, 1.0,
        )  # fmt: skip
    nearest = min(excess, key=lambda name: excess[name])
    return nearest, widened[nearest]
