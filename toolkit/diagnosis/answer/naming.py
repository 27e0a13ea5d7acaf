"""Whether effects that were found are named, or only imitate what stays without a name."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.answer.answer import cut_short
from toolkit.diagnosis.answer.held_out_errors import held_out_errors, shown_noise
from toolkit.diagnosis.answer.next_measurements import implausible
from toolkit.diagnosis.fit.sensor_noise import spread
from toolkit.diagnosis.fit.structure import RUNS
from toolkit.diagnosis.law.rivals import least_share, parameters_of, take_as_much
from toolkit.diagnosis.policy import LAWS, SCREENING, VERDICT
from toolkit.diagnosis.search.bends import is_outsized
from toolkit.diagnosis.search.search import Search
from toolkit.diagnosis.search.superfluous import takes_nearly_all

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.diagnosis.law.learn import Laws


def kept_beside_laws(search: Search, laws: Laws) -> Search:
    """Return a search whose effects are named although more stays: laws in their place take no more of it.

    They were withdrawn for the rest, which something else was to explain with them. Where the best law of all
    takes no more than they do, with no fewer parameters, it is their own formula or imitates them.
    """
    if not search.steps or imitates(search) or not outweighed(search) or not laws.complete:
        return search
    predicting = any(law.predicts for law in laws.listed)
    if not predicting or parameters_of(laws.fit) < parameters_of(search.augmented):
        return search
    least = least_share(search.augmented, laws.fit)
    if not take_as_much(
        search.problem, search.held_refitted, search.held_augmented, laws.held_out, least=least
    ):
        return search
    return replace(search, kept=True)


def mostly_unknown(search: Search) -> bool:
    """Tell whether what stays after the named effects outweighs them: they then only imitate it."""
    return imitates(search) or (not search.kept and outweighed(search))


def imitates(search: Search) -> bool:
    """Tell whether effects have sizes, or leave parameters, that nobody believes, or take hardly anything.

    Effects beside which the parameters of the simulation are what nobody believes them to be are not what
    was left out, unless they take nearly all of it. Nor is a cell's law beside an unexplained rest, with a
    size that no cell has.
    """
    if not search.steps:
        return False
    if implausible(search) and not _takes_nearly_all(search):
        return True
    shows = _taken(search) or _takes_more_than_is_left(search)
    if (not shows and _is_smooth(search)) or _is_within_accuracy(search):
        return True
    # A rest that no test tells from anything (its gain is none) is no evidence that a size imitates it.
    told = any(structure.gain > 0 for structure in search.structure) and not cut_short(search.skipped)
    return told and any(is_outsized(search.problem, step.active) for step in search.steps)


def outweighed(search: Search) -> bool:
    """Tell whether what stays outweighs what effects explain.

    By what they take of the held-out mean square that is above the noise; where none is, by the
    log-likelihood. A rest that is no noise is above it, and outweighs effects of which it is several times as
    much. Nothing outweighs those that take more of an output's unseen rows than they leave there, nor a rest
    of which a search that was cut short has not seen what it is.
    """
    if not search.structure or (search.steps and cut_short(search.skipped)):
        return False
    if _takes_more_than_is_left(search):
        return False
    shown = _taken(search)
    if any(removed >= VERDICT.taken * above for removed, above in shown) and not _are_minor(search):
        return False
    if all(step.active.effect.from_digits for step in search.steps):
        return not search.steps  # read off the digits: it does not imitate anything
    unexplained = max(
        (structure.gain / 2 for structure in search.structure if not structure.rest), default=0.0
    )
    explained = sum(step.gain for step in search.steps)
    return bool(shown) or explained < VERDICT.mostly * (explained + unexplained)


def _are_minor(search: Search) -> bool:
    """Tell whether effects leave several times what they take, in every output that shows a mismatch.

    Of unseen rows, above what is shown to be noise: what they leave may be none.
    """
    parts = []
    for output in held_out_errors(search, unknown=False):
        noise, before, after = (
            each**2 for each in (shown_noise(search, output), output.refitted_rmse, output.augmented_rmse)
        )
        if before > VERDICT.shown * noise:
            parts.append(after - noise > LAWS.outdoes * (before - after))
    return bool(parts) and all(parts)


def _is_smooth(search: Search) -> bool:
    """Tell whether a smooth discrepancy without a name explains more than the effects, parameters counted.

    A simulation is never exact: what it misses by a part in a thousand is smooth, and some effect imitates a
    share of it. Asked of effects that show in no output above the noise; a larger one has a law of its own.
    """
    if all(step.active.effect.from_digits for step in search.steps):
        return False
    cost = 0.5 * math.log(max(search.problem.values, 1.0))  # of a parameter (BIC)
    named = sum(step.gain - cost * len(step.active.searched) for step in search.steps)
    nameless = (
        structure.gain / 2 - cost * structure.columns
        for structure in search.structure_before
        if structure.columns and not structure.rest
    )
    return max(nameless, default=-math.inf) > named + VERDICT.close


def _is_within_accuracy(search: Search) -> bool:
    """Tell whether effects move every output by less than a simulation is off without any.

    Another integrator or a tire's formula misses its plant by as much, and some effect takes a share of that.
    One that takes most of what is above the noise is what was left out, however small: within the runs, or of
    their zeros more than it would of zeros that move by chance.
    """
    if all(step.active.effect.from_digits for step in search.steps):
        return False
    problem = search.problem
    if _takes_nearly_all(search) and _foretells_zeros(search):
        return False
    for name, kept in problem.kept.items():
        # about every run's own mean: zeros that move are no effect's to take
        before, after, floor = (
            _within_runs(problem, name, error)
            for error in (
                problem.observed[name] - search.held_refitted.simulated[name],
                problem.observed[name] - search.held_augmented.simulated[name],
                search.augmented.residual[name],
            )
        )
        shown = before > VERDICT.shown * floor
        if shown and before - after > VERDICT.taken * (before - floor):
            return False
        moved = (search.held_augmented.simulated[name] - search.held_refitted.simulated[name])[kept]
        if len(moved) and math.sqrt(float(np.mean(moved**2))) > VERDICT.accuracy * spread(problem, name):
            return False
    return True


def _foretells_zeros(search: Search) -> bool:
    """Tell whether effects take more of the runs' zeros, on unseen rows, than of as many that move by chance.

    Zeros that move are one independent value a run: of three a constant takes nine tenths in one case of
    twenty, and the best of all that were tried in most. The share that q parameters take of k such values is
    a beta variable with q and k - q degrees of freedom (the F test, one-sided).
    """
    from scipy.stats import beta

    problem, shares = search.problem, []
    for name, kept in problem.kept.items():
        before, after = (
            sum(
                float((problem.observed[name] - held.simulated[name])[rows][kept[rows]].mean()) ** 2
                for rows in problem.slices
                if kept[rows].any()
            )
            for held in (search.held_refitted, search.held_augmented)
        )
        shares.append((before - after) / max(before, 1e-300))
    taken = sum(max(len(step.active.searched), 1) for step in search.steps)
    free = len(problem.runs) - taken
    tests = max(len(search.scored), 1)
    return free > 0 and tests * float(beta.sf(max(shares), taken / 2, free / 2)) < SCREENING.alpha


def _taken(search: Search) -> list[tuple[float, float]]:
    """Return what effects take of each output's held-out mean square, and what of it is above the noise.

    Outputs that show nothing but noise do not count: of nothing, nothing is two thirds. Where the runs have
    zeros of their own, these are no effect's to take, and every run counts about its own mean.
    """
    problem, shown = search.problem, []
    for output in held_out_errors(search, unknown=False):
        name = output.channel
        before, after, floor = output.refitted_rmse**2, output.augmented_rmse**2, output.noise_floor**2
        if any(each.output == name and each.variables == RUNS for each in search.structure):
            errors = (
                problem.observed[name] - search.held_refitted.simulated[name],
                problem.observed[name] - search.held_augmented.simulated[name],
                search.augmented.residual[name],
            )
            before, after, floor = (_within_runs(problem, name, error) for error in errors)
        if before > VERDICT.shown * floor:
            shown.append((before - after, before - floor))
    return shown


def _takes_more_than_is_left(search: Search) -> bool:
    """Tell whether effects take more of an output's unseen rows than they leave there.

    A coloured noise weighs slow errors little, however large they are. About every run's own mean: whatever
    is left out has one, and some zero takes it. Of an output that only drifts, of its rates or of itself:
    over few rows rates are the sensor's noise.
    """
    problem, held = search.problem, (search.held_refitted, search.held_augmented)
    for name in problem.names:
        errors = [problem.observed[name] - each.simulated[name] for each in held]
        judged = [_within_runs, *([_about_means] if name in problem.rates else ())]
        for before, after in ([of(problem, name, error) for error in errors] for of in judged):
            if before - after > after:
                return True
    return False


def _takes_nearly_all(search: Search) -> bool:
    """Tell whether effects take nearly all that is above the sensor's own noise on unseen rows.

    What foretells all else is not withdrawn for a parameter that is far off beside it: its prior is as likely
    wrong, and the answer gives the parameter with its shift.
    """
    return takes_nearly_all(search.problem, search.held_refitted, search.held_augmented, search.augmented)


def _within_runs(problem: Problem, name: str, error: Array) -> float:
    """Return the mean square of an error about its mean in every run; rates have no zero that moves."""
    if name in problem.rates:
        return float(np.mean(problem.judged(name, error) ** 2))
    return _about_means(problem, name, error)


def _about_means(problem: Problem, name: str, error: Array) -> float:
    counted = problem.kept[name]
    parts = [error[rows][counted[rows]] for rows in problem.slices if counted[rows].any()]
    return float(np.mean(np.concatenate([part - part.mean() for part in parts]) ** 2))
