"""Whether what is taken for noise may be: never where it is large, nor where it follows what was recorded.

Structure is tested beside a noise whose colour was estimated from the same residual; a long-memory noise then
foretells a smooth mismatch from its own past, and nothing seems left. Two questions do not depend on that
colour: how large the rest is beside the output itself, and whether smooth functions of what was recorded,
fitted on some runs, foretell it on the others better than they foretell noise of the same colour.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.fit.noise import Differences, Layout, Memory, draws, fit_noise, memory_of
from toolkit.diagnosis.fit.sensor_noise import (
    ChannelNoise,
    judged_noise,
    judged_spread,
    noise_parts,
    shows_sensor,
    spread,
)
from toolkit.diagnosis.fit.structure import RUNS, SmoothDependence, groups
from toolkit.diagnosis.policy import NOISE, ROWS, STRUCTURE, UNSEEN, VERDICT
from toolkit.diagnosis.search.unexplained import StructureFound

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.fit.fit import Fit
    from toolkit.diagnosis.fit.folds import Folds
    from toolkit.diagnosis.fit.problem import Problem


LARGE = "a floor above a tenth of the output's spread"
LONG = "a floor that wanders as long as the recording"
SMOOTH = "a floor far above its sensor's noise"


def hidden_in_noise(problem: Problem, folds: Folds, base: Fit, seed: int) -> tuple[StructureFound, ...]:
    """Return what a fit has taken for noise and is none, or cannot be shown to be any."""
    found: list[StructureFound] = []
    listed = groups(problem, base)
    for at, name in enumerate(problem.names):
        parts = noise_parts(problem, base, name)
        if not problem.kept[name].any() or parts.is_sensor:
            continue
        judged = judged_noise(problem, base, name)
        if _is_large(problem, base, name, judged):
            ratio = judged.total_sd / (NOISE.largest * judged_spread(problem, name))
            gain = 2 * problem.layout(name).n * math.log(ratio) / base.noise[name].correlation_rows
            found.append(_untested(name, LARGE, gain))
        if parts.process_sd > parts.sensor_sd:
            own = [group for group in listed if group.output == name and group.variables != RUNS]
            follows = _followed(problem, folds, base, name, own, seed + at)
            found += [] if follows is None else [follows]
            if _is_untestable(problem, base, name, parts):
                found.append(_untested(name, LONG, 0.0))
        if all(each.output != name for each in found) and (
            name in problem.memory or _is_smooth_over_inputs(problem, name, parts)
        ):
            found.append(_untested(name, SMOOTH, 0.0))
    return tuple(found)


def _is_untestable(problem: Problem, base: Fit, name: str, parts: ChannelNoise) -> bool:
    """Tell whether a rest has too few independent values to be told from anything, and matters.

    Without a state nothing wanders but the sensor, and one that takes as long as the whole recording is no
    noise: the simulation is off, if by more than any is. What an equation lacks shows integrated, as an arc
    as long as a run, however many runs there are: a plant may wander so by itself, but nothing shows that it
    does where the arcs are far above the sensor's noise. A noise that remembers its last value alone is no
    arc: that takes the sensor's noise on top of it, and so a memory of several values.
    """
    motion, size = problem.model.capability.motion, spread(problem, name)
    rows, noise, least = problem.layout(name).n, base.noise[name], VERDICT.accuracy * size
    if motion is not None and motion.integrates:
        if len(noise.reflection) > 1:
            rows = min(rows, int(np.median([problem.kept[name][run].sum() for run in problem.slices])))
            least = max(least, NOISE.mismatch * parts.sensor_sd)
        else:
            least = NOISE.largest * size
    return rows <= ROWS.fewest * noise.correlation_rows and parts.total_sd > least


def _is_smooth_over_inputs(problem: Problem, name: str, parts: ChannelNoise) -> bool:
    """Tell whether readings without a time leave what their neighbours agree about, and it matters."""
    matters = parts.total_sd > VERDICT.accuracy * spread(problem, name)
    return not problem.case.has_time and matters and parts.process_sd > NOISE.mismatch * parts.sensor_sd


def _untested(name: str, reason: str, gain: float) -> StructureFound:
    return StructureFound(output=name, variables=(), reason=reason, gain=gain, p_value=1.0, rest=True)


def is_beyond_noise(problem: Problem, base: Fit) -> bool:
    """Tell whether some output's rest is so large that no colour makes it noise."""
    return bool(beyond_noise(problem, base))


def beyond_noise(problem: Problem, base: Fit) -> dict[str, ChannelNoise]:
    """Return outputs whose rest is so large that no colour makes it noise, with what was taken for theirs."""
    parts = {name: judged_noise(problem, base, name) for name in problem.names if problem.kept[name].any()}
    return {
        name: part
        for name, part in parts.items()
        if not part.is_sensor and _is_large(problem, base, name, part)
    }


def weighed_as_mismatch(problem: Problem, base: Fit, *, may_be_noise: bool = False) -> Problem:
    """Return a problem whose outputs with a rest that is no noise have its memory, and no others one.

    Each row of such a rest is foretold by the row before, whatever it is, by less than the corner that what
    is right makes in it: a likelihood of single rows prefers what is smooth to what is true. Its size is what
    counts, over as many values as its memory leaves independent. What was no noise is none for being smaller,
    until it is the sensor's or matters to nobody.

    Parameters
    ----------
    may_be_noise : a rest may be noise, too, that is above the sensor's and matters
    """
    if not problem.case.has_order:
        return problem
    memory, known = {}, {*beyond_noise(problem, base), *problem.memory}
    for name in (each for each in problem.names if problem.kept[each].any()):
        parts = judged_noise(problem, base, name)
        matters = parts.total_sd > VERDICT.accuracy * judged_spread(problem, name)
        if not (matters and (may_be_noise or name in known)):
            continue
        if parts.process_sd <= NOISE.mismatch * parts.sensor_sd:
            continue
        judged = Differences(problem.layout(name), problem.rates.get(name, 0))
        where = judged.layout
        noise = fit_noise(judged.of(base.residual[name]), where, floor=problem.floor[name])
        # Runs are independent, whatever stays the same in each of them.
        own = float(np.median([problem.kept[name][rows].sum() for rows in problem.slices]))
        rows = min(memory_of(noise, int(own)), own)
        if where.n >= UNSEEN.runs * rows:  # fewer values show nothing
            memory[name] = Memory(rows=rows, apart=judged.rows)
    return replace(problem, memory=memory)


def may_leave_noise(problem: Problem, refitted: Fit, made: Fit) -> bool:
    """Tell whether effects took nearly all of what was no noise: some colour may make noise of the rest.

    Parameters
    ----------
    problem : with the memory of what was no noise beside the refit
    refitted, made : the fits without effects, and with them
    """
    beyond = beyond_noise(problem, made)
    for name in problem.memory:
        before, after = (
            float(np.mean(problem.judged(name, each.residual[name]) ** 2)) for each in (refitted, made)
        )
        if name in beyond or after > (1 - VERDICT.nearly) * before:
            return False
    return True


def _is_large(problem: Problem, base: Fit, name: str, parts: ChannelNoise) -> bool:
    """Tell whether a rest is above a tenth of the output's spread; of a constant, the spread is its noise.

    Beside effects that were found, what is as white as the sensor's own noise is no structure, however weak
    the signal. Alone it is: of a recording a tenth of which is noise nobody knows what it hides.
    """
    if base.active and parts.process_sd < parts.sensor_sd and shows_sensor(problem, base, name):
        return False
    size = judged_spread(problem, name)
    varies = float(np.std(problem.judged(name, base.simulated[name]))) > NOISE.still * size
    return varies and parts.total_sd > NOISE.largest * size


def _followed(
    problem: Problem, folds: Folds, base: Fit, name: str, listed: list[SmoothDependence], seed: int
) -> StructureFound | None:
    """Return on what a coloured rest depends, None where noise of its colour would seem to as well."""
    where = problem.layout(name)
    residual = base.residual[name][where.index]
    noise = fit_noise(residual, where, floor=problem.floor[name])
    if not listed or not noise.reflection:
        return None
    columns = [group.columns[where.index] for group in listed]
    shares = [float(_foretold(column, residual[:, None], folds, where)[0]) for column in columns]
    best = int(np.argmax(shares))
    if shares[best] < STRUCTURE.foretold:
        return None
    drawn = draws(noise, where, STRUCTURE.foretold_draws, np.random.default_rng(seed))
    if any(_foretold(column, drawn, folds, where).max() >= shares[best] for column in columns):
        return None
    return StructureFound(
        output=name,
        variables=listed[best].variables,
        gain=-where.n * math.log(1 - shares[best]) / noise.correlation_rows,
        p_value=1 / (drawn.shape[1] + 1),
    )


def _foretold(columns: Array, series: Array, folds: Folds, where: Layout) -> Array:
    """Return the share of every series' mean square that columns fitted on the other folds foretell, (k,)."""
    wrong = np.zeros(series.shape[1])
    there = np.zeros(series.shape[1])
    for mask in folds.held:
        held = mask[where.index]
        if not held.any() or held.all():
            continue
        slopes = np.linalg.lstsq(columns[~held], series[~held], rcond=None)[0]
        wrong += np.sum((series[held] - columns[held] @ slopes) ** 2, axis=0)
        there += np.sum(series[held] ** 2, axis=0)
    return np.asarray(1 - wrong / np.maximum(there, 1e-300))
