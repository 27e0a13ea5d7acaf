"""Noise of the sensor apart from noise of the process: what no plant can make, and what is left beside it.

A coloured noise takes whatever a simulation leaves out; alone it bounds nothing that physics may explain.
The sensor's own noise shows elsewhere: on its certificate, in the difference of a run and its repeat, in the
quickest differences from row to row, which a plant smooths away, and in the steps of the recorded numbers.
What a residual has beyond it came through the plant, or was left out of the simulation.

Source: Rice, Ann. Statist. 12 (1984) 1215, variance from differences; of third order, a parabola leaves none.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from toolkit.declared import OrNan
from toolkit.diagnosis.fit.noise import fit_noise
from toolkit.diagnosis.policy import NOISE

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.fit.fit import Fit
    from toolkit.diagnosis.fit.problem import Problem

Evidence = Literal["stated", "repeats", "differences", "resolution"]

QUICK = 3
"""Order of the differences from row to row that a sensor's noise is read from."""
_WEIGHT = math.comb(2 * QUICK, QUICK)  # variance of a difference of white noise of variance one
_ROBUST = 1.4826  # standard deviation of a normal distribution over its median absolute deviation


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelNoise:
    """The noise of a channel, divided: the sensor's, the rest of a residual, and what shows the first."""

    sensor_sd: OrNan
    process_sd: OrNan
    how: Evidence

    @property
    def total_sd(self) -> float:
        """Both together."""
        return math.hypot(self.sensor_sd, self.process_sd)

    @property
    def is_sensor(self) -> bool:
        """No more is left than a sensor's noise that is known from elsewhere than this residual."""
        return self.how != "differences" and self.total_sd <= NOISE.as_known * self.sensor_sd


def noise_parts(problem: Problem, fit: Fit, name: str) -> ChannelNoise:
    """Return the two noises of an output beside a fit."""
    counted = problem.kept[name]
    residual = fit.residual[name][counted]
    total = math.sqrt(float(np.mean(residual**2))) if len(residual) else 0.0
    sensor, how = _sensor(problem, fit, name)
    floor = problem.floor[name]
    if sensor < floor or total <= NOISE.as_known * floor:
        sensor, how = floor, "resolution"
    if how in ("differences", "resolution"):
        sensor = min(sensor, total) if total > 0 else sensor
    return ChannelNoise(sensor_sd=sensor, process_sd=math.sqrt(max(total**2 - sensor**2, 0.0)), how=how)


def judged_noise(problem: Problem, fit: Fit, name: str) -> ChannelNoise:
    """Return the noise of what is judged of an output, values or rates [1/s], the sensor's apart."""
    parts = noise_parts(problem, fit, name)
    if name not in problem.rates:
        return parts
    total = float(np.mean(problem.judged(name, fit.residual[name]) ** 2))
    sensor = min(problem.judged_sd(name, parts.sensor_sd), math.sqrt(total))
    return replace(parts, sensor_sd=sensor, process_sd=math.sqrt(max(total - sensor**2, 0.0)))


def judged_spread(problem: Problem, name: str) -> float:
    """Return the standard deviation of what is judged of an output as it was recorded."""
    values = problem.judged(name, problem.observed[name])
    return float(np.std(values)) if len(values) else 0.0


def _sensor(problem: Problem, fit: Fit, name: str) -> tuple[float, Evidence]:
    stated = problem.stated_sd(name)
    if stated is not None:
        return stated, "stated"
    repeated = noise_of_repeats(problem, fit, name)
    if repeated is not None:
        return repeated[0], "repeats"
    return _by_differences(problem, fit, name), "differences"


def noise_of_repeats(problem: Problem, fit: Fit, name: str) -> tuple[float, float, int] | None:
    """Return the noise of runs that repeat another row by row, its zero apart; None without such runs.

    Beside it the independent values that its colour leaves of every row, and of how many rows it is known.
    """
    places = dict(zip((run.name for run in problem.runs), problem.slices, strict=True))
    squares, rows, dof = 0.0, 0, 0.0
    for run in problem.runs:
        first = places.get(run.conditions.get("repeat_of", ""))
        again = places[run.name]
        if first is None or first == again or first.stop - first.start != again.stop - again.start:
            continue
        counting = problem.kept[name][first] & problem.kept[name][again]
        if counting.sum() < NOISE.fewest:
            continue
        # Of the residuals, not of the outputs: the inputs of a repeat are never quite the same.
        apart = (fit.residual[name][first] - fit.residual[name][again])[counting]
        apart -= apart.mean()
        squares += float(np.sum(apart**2)) / 2
        rows += len(apart) - 1
        there = np.zeros(problem.rows, dtype=bool)
        there[again] = counting
        noise = fit_noise(apart, problem.layout(name, there), floor=problem.floor[name])
        dof += (len(apart) - 1) / noise.correlation_rows
    return (math.sqrt(squares / rows), dof / rows, rows) if rows else None


def shows_sensor(problem: Problem, fit: Fit, name: str) -> bool:
    """Tell whether quick differences of a residual are the sensor's, as between two rows little moves.

    Rows in no order of time, or driven anew at each of them, tell what was left out in their differences too.
    """
    quick = quick_sd(problem, fit.simulated[name], name)
    return problem.case.has_time and quick <= NOISE.largest * spread(problem, name)


def _by_differences(problem: Problem, fit: Fit, name: str) -> float:
    return quick_sd(problem, fit.residual[name], name)


def quick_sd(problem: Problem, column: Array, name: str) -> float:
    """Return the standard deviation that the quickest differences of an output's column (rows,) show."""
    where = problem.layout(name)
    values = column[where.index]
    if problem.case.has_order:
        series = [values[segment] for segment in where.segments]
    else:  # neighbours in the inputs, of which none is the other's past
        series = [column[rows][problem.kept[name][rows]] for rows in problem.slices]
    quick = [np.diff(part, QUICK) for part in series if len(part) > QUICK]
    if not quick:
        return math.sqrt(float(np.mean(values**2))) if len(values) else 0.0
    return robust_sd(np.concatenate(quick)) / math.sqrt(_WEIGHT)


def spread(problem: Problem, name: str) -> float:
    """Return the standard deviation of an output as it was recorded."""
    values = problem.observed[name][problem.kept[name]]
    return float(np.std(values)) if len(values) else 0.0


def robust_sd(values: Array) -> float:
    """Return the standard deviation about zero that the median of the sizes tells, of normal values."""
    return _ROBUST * float(np.median(np.abs(values)))
