"""Recordings finer than they tell: rows averaged where a simulation moves and the recording does not.

A velocity that was differentiated, or a slip angle with the noise of its sensor, drives a simulation with
what never happened. Of quick changes that is most. A coloured noise weighs quick changes most, and the
parameters then go to where the simulation stands still: the dilution by errors in the inputs, made worse by
whitening. Means over some rows keep the slow changes, in which simulation and recording move together.

How much of a slope is left is told by the coherence of both, run by run: a lag, a wrong sign or a wrong gain
does not lower it, noise of an input does. A limit or another bend does as well: the recording is held against
what it is on average where the simulation is alike, too.

Low coherence is also what missing physics looks like. Noise of an input is shown at the input itself: it is
in its differences from row to row all the time, and not at steps alone; and without it the simulation no
longer moves by what the recording does not follow.

Source: Bendat and Piersol, Random Data, 4th ed. (2010), 6.1 (noise at the input lowers coherence and slope
alike) and 9.2 (the bias of coherence, one over the number of windows); Fuller, Measurement Error Models
(1987), 1.1 (the reliability ratio of a slope).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.fit.noise import layout
from toolkit.diagnosis.fit.sensor_noise import QUICK, robust_sd
from toolkit.diagnosis.policy import AVERAGES, NOISE, ROWS
from toolkit.diagnosis.simulators.averaged import usual_step, windows
from toolkit.findings import Finding
from toolkit.units import unit

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.case.case import Case, Run
    from toolkit.diagnosis.fit.problem import Problem, Stacked

_LEVELS = 32
"""Levels of the simulation at which the recording's mean is taken: between two a bend leaves little."""


@dataclass(frozen=True, slots=True)
class Octave:
    """Simulation and recording of one output in an octave, over all runs.

    Powers in the output's unit squared: ``shared`` what the simulation moves with the recording, ``foreign``
    what it moves by itself, ``recorded`` that of the recording. ``gain`` and ``dilution`` are the first two
    over what the recording moves without the simulation, the weights of the octave in a slope.
    """

    shared: float
    foreign: float
    recorded: float
    gain: float
    dilution: float

    @property
    def is_quiet(self) -> bool:
        """Tell whether a low-pass of the simulation would win nothing here."""
        least = max(AVERAGES.beside_recorded * self.recorded, AVERAGES.beside_shared * self.shared)
        return self.foreign <= least


def rows_averaged(problem: Problem, simulated: Stacked) -> int:
    """Return over how many rows of the quickest run means are to be taken; 1 where every row tells something.

    Means are taken where the simulation as declared moves by itself, over as few rows as leave of a slope
    nearly what any means would; never of a case without inputs, which cannot have noise.

    Parameters
    ----------
    simulated : outputs of the simulation as declared, over all runs
    """
    case = problem.case
    if not (problem.model.capability.averages and case.has_time and noisy_inputs(case)):
        return 1
    if not all(map(_is_regular, case.runs)):
        return 1
    if any(_turns(run, channel.name, channel.unit) for run in case.runs for channel in case.drivers):
        return 1
    octaves = _all_octaves(problem, simulated)
    most = 0
    while sum(len(windows(case, run, 2 ** (most + 1)).rows) for run in long_runs(case, 2 ** (most + 1))) >= (
        AVERAGES.fewest
    ):
        most += 1
    return int(2 ** max(_first(each, most) for each in octaves.values()))


def noisy_inputs(case: Case) -> frozenset[str]:
    """Return inputs and covariates that may carry noise: differences from row to row are as large everywhere.

    The third differences of what is put in by steps are large at the steps alone; of noise their median tells
    as much as their mean square.
    """
    noisy = set()
    for driver in case.drivers:
        columns = [run.columns[driver.name] for run in case.runs if driver.name in run.columns]
        quick = [np.diff(column[np.isfinite(column)], QUICK) for column in columns]
        differences = np.concatenate(quick or [np.zeros(0)])
        size = math.sqrt(float(np.mean(differences**2))) if len(differences) else 0.0
        if size > 0 and robust_sd(differences) > AVERAGES.everywhere * size:
            noisy.add(driver.name)
    return frozenset(noisy)


def moved_by_inputs(problem: Problem, simulated: Stacked, smooth: Stacked, rows: int) -> bool:
    """Tell whether what is averaged away goes from the simulation with the noise of its inputs.

    Parameters
    ----------
    simulated, smooth : outputs as declared over all runs, with inputs as recorded, and without their noise
    """
    for name, octaves in _all_octaves(problem, simulated).items():
        away = simulated[name] - smooth[name]
        foreign = sum(octave.foreign for octave in octaves[: round(math.log2(rows))] if not octave.is_quiet)
        if foreign > 0 and float(np.nansum(away**2)) > AVERAGES.of_inputs * foreign:
            return True
    return False


def _first(octaves: Sequence[Octave], most: int) -> int:
    """Return the first octave that is kept, 0 where all are."""
    ratios = []
    for k in range(min(most + 1, len(octaves))):
        gain = sum(octave.gain for octave in octaves[k:])
        dilution = sum(octave.dilution for octave in octaves[k:] if not octave.is_quiet)
        ratios.append(gain / max(gain + dilution, 1e-300))
    enough = AVERAGES.slope * max(ratios, default=0.0)
    steady = [k for k, ratio in enumerate(ratios) if ratio >= enough]
    first = next((k for k in steady if octaves[k].is_quiet), steady[-1] if steady else 0)
    return 0 if all(octave.is_quiet for octave in octaves[:first]) else first


def long_runs(case: Case, rows: int) -> tuple[Run, ...]:
    """Return the runs that have more than a few means over some rows."""
    return tuple(run for run in case.runs if len(windows(case, run, rows).rows) > ROWS.fewest)


def of_kept_rows(problem: Problem, rows: int) -> Case:
    """Return the case of its long runs, with outputs where they count.

    A value far off would be in all means around it.
    """
    places = dict(zip((run.name for run in problem.runs), problem.slices, strict=True))
    runs = []
    for run in long_runs(problem.case, rows):
        columns = dict(run.columns)
        for name in set(columns) & set(problem.kept) if run.name in places else ():
            columns[name] = np.where(problem.kept[name][places[run.name]], columns[name], np.nan)
        runs.append(dataclasses.replace(run, columns=columns))
    return dataclasses.replace(problem.case, runs=tuple(runs))


def is_smooth(
    problem: Problem,
    simulated: Mapping[str, Array],
    smooth: Mapping[str, Array],
    rows: int,
) -> bool:
    """Tell whether smooth inputs give the means of the simulation as declared, beside its mismatch.

    They do not where the simulation bends within a mean, or takes its inputs for numbers of something.

    Parameters
    ----------
    simulated, smooth : outputs as declared over all runs, with inputs as recorded, and with smooth ones
    """
    for name in problem.names:
        missed, mismatch = [], []
        for run, place in zip(problem.runs, problem.slices, strict=True):
            mean = windows(problem.case, run, rows).mean
            missed.append(mean(smooth[name][place] - simulated[name][place]))
            mismatch.append(mean(problem.observed[name][place] - simulated[name][place]))
        most = AVERAGES.missed**2 * np.nansum(np.concatenate(mismatch) ** 2)
        there = np.isfinite(np.concatenate(mismatch))
        if np.sum(np.concatenate(missed)[there] ** 2) > most:
            return False
    return True


def averages_findings(case: Case, rows: int) -> tuple[Finding, ...]:
    """Return the notes that rows of a case were averaged, and why, and which runs were too short for it."""
    step, kept = min(usual_step(run) for run in case.runs), long_runs(case, rows)
    lines = [
        (
            case.path.name,
            f"rows were averaged by {rows}, over {rows * step:.3g} s: quicker changes of the simulation "
            "are not in the recording, as where inputs are recorded with noise",
        ),
        *((run.name, "too short for these means: it was left out") for run in case.runs if run not in kept),
    ]
    return tuple(
        Finding(rule="case-averaged", where=where, level="note", message=message) for where, message in lines
    )


def _all_octaves(problem: Problem, simulated: Stacked) -> dict[str, list[Octave]]:
    return {name: _octaves(problem, name, simulated[name]) for name in problem.names}


def _octaves(problem: Problem, name: str, simulated: Array) -> list[Octave]:
    """Return an output's octaves below half the quickest run's rate, the quickest first."""
    from scipy.signal import csd, welch

    sums: dict[int, Array] = {}
    bent = _usual(problem, name, simulated)
    quickest = min(usual_step(run) for run in problem.case.runs)
    for run, place in zip(problem.runs, problem.slices, strict=True):
        step = usual_step(run)
        where = layout([run.t], [problem.kept[name][place]])
        for segment in where.segments:
            at = where.index[segment]
            length = min(AVERAGES.window, len(at) // AVERAGES.windows)
            if length < AVERAGES.shortest:
                continue
            y = problem.observed[name][place][at]
            frequencies, recorded = welch(y, 1 / step, nperseg=length)
            chance = 1 / (2 * len(at) // length - 1)
            followed = []
            for s in (simulated[place][at], bent[place][at]):
                moved = welch(s, 1 / step, nperseg=length)[1]
                both = np.abs(csd(s, y, 1 / step, nperseg=length)[1]) ** 2
                coherence = both / np.maximum(moved * recorded, 1e-300)
                followed.append((moved, np.clip((coherence - chance) / (1 - chance), 0, 1)))
            apart = [float(np.sum((1 - alike) * recorded)) for _, alike in followed]
            moved, alike = followed[apart[1] < AVERAGES.bent * apart[0]]
            weight = 1 / np.maximum(np.maximum(1 - alike, chance) * recorded, 1e-300)
            shared, foreign = alike * moved, (1 - alike) * moved
            powers = np.stack([shared, foreign, recorded, shared * weight, foreign * weight])
            octaves = np.floor(-np.log2(np.maximum(2 * quickest * frequencies, 1e-12)) + 1e-9).astype(int)
            for k in np.unique(octaves[1:]):
                total = len(at) * frequencies[1] * powers[:, octaves == k].sum(axis=1)
                sums[k] = sums.get(k, 0) + total
    return [Octave(*map(float, sums.get(k, np.zeros(5)))) for k in range(max(sums, default=-1) + 1)]


def _usual(problem: Problem, name: str, simulated: Array) -> Array:
    """Return what an output is on average where the simulation is alike (rows,): whatever bend is missing."""
    kept = problem.kept[name] & np.isfinite(simulated)
    order = np.flatnonzero(kept)[np.argsort(simulated[kept], kind="stable")]
    parts = np.array_split(order, max(min(math.isqrt(len(order)), _LEVELS), 1))
    levels, means = (
        np.array([float(np.mean(column[part])) for part in parts if len(part)])
        for column in (simulated, problem.observed[name])
    )
    return np.interp(simulated, levels, means) if len(levels) else np.zeros(len(simulated))


def _is_regular(run: Run) -> bool:
    """Tell whether a run's rows are equally far apart, gaps aside."""
    steps = np.diff(run.t)
    if not len(steps):
        return True
    usual = float(np.median(steps))
    off = np.abs(steps[steps < NOISE.gap * usual] - usual)
    return usual > 0 and bool(np.mean(off > AVERAGES.jitter * usual) < AVERAGES.jittering)


def _turns(run: Run, name: str, text: str) -> bool:
    """Tell whether a channel is an angle that wraps: a mean across its jump is no angle."""
    column = run.columns.get(name)
    if column is None or unit(text).dimension != "angle" or run.rows < 2:
        return False
    return float(np.nanmax(np.abs(np.diff(column)))) * unit(text).factor > math.pi
