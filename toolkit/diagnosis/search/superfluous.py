"""Effects without which nothing is lost: beside others, beside their own interval, beside what wanders."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.fit.fit import fit, replace_effects, sizes_off
from toolkit.diagnosis.fit.folds import beyond_form, hold_out, unseen_error
from toolkit.diagnosis.fit.sensor_noise import noise_parts
from toolkit.diagnosis.policy import STEP, VERDICT
from toolkit.diagnosis.search.bends import is_outsized
from toolkit.diagnosis.search.forward_step import Rival, score_in_place
from toolkit.diagnosis.search.in_place import best_in_place
from toolkit.diagnosis.search.time_budget import BudgetSpentError
from toolkit.diagnosis.search.wandering import may_wander, outdoes_wandering
from toolkit.errors import FitError

if TYPE_CHECKING:
    from toolkit.diagnosis.fit.fit import Fit
    from toolkit.diagnosis.fit.folds import Folds, HeldOut
    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.diagnosis.search.candidates import CandidateEffect
    from toolkit.diagnosis.search.forward_step import Step
    from toolkit.effects.applied import AppliedEffect, EffectKey


def without(active: Sequence[AppliedEffect], effect: AppliedEffect) -> tuple[AppliedEffect, ...]:
    """Return effects without one of them; a drift with the temperature goes with its zero."""

    def goes(applied: AppliedEffect) -> bool:
        its_zero = effect.effect.frees_zero and applied.effect.is_zero
        return applied.key == effect.key or (its_zero and applied.key[1:] == (effect.channel, None, None))

    return tuple(applied for applied in active if not goes(applied))


def pruned(
    problem: Problem,
    folds: Folds,
    base: Fit,
    held_base: HeldOut,
    refitted: HeldOut,
    steps: list[Step],
    listed: Sequence[CandidateEffect] = (),
) -> tuple[Fit, HeldOut, list[Step]]:
    """Drop effects that the others make superfluous: of which too little is left to say beside them.

    Their held-out score is as good without, or what it takes is no more than the others' own forms are off. A
    law of a cell with a size that no cell has is superfluous where the others take nearly all without it.
    Of two either of which does without the other, that one goes without which unseen rows are foretold best:
    by their score, and where it hardly differs by the error of the simulation itself, for the score of a rest
    that is nearly all wandering weighs slow errors little. What stays for both has its rivals anew.

    Parameters
    ----------
    refitted : the held-out rows without any effect
    listed : candidates that may stand in the place of what stays
    """
    shorter: dict[EffectKey, tuple[Fit, HeldOut]] = {}
    superfluous: list[HeldOut] = []
    for step in steps if len(base.active) > 1 else ():
        remaining = without(base.active, step.active)
        # A step that is read off the recorded digits changes no score, and is there all the same.
        if not remaining or step.active.effect.from_digits:
            continue
        try:
            fewer = fit(problem, remaining, start=base.p)
            scores = hold_out(problem, folds, fewer.active, fewer)
        except FitError:  # what is left cannot be simulated: the effect is needed
            continue
        shorter[step.active.key] = fewer, scores
        form = max((applied.effect.form_error for applied in remaining), default=0.0)
        if (
            held_base.total - scores.total < STEP.least_gain
            or not beyond_form(problem, refitted, scores, held_base, form)
            or (is_outsized(problem, step.active) and takes_nearly_all(problem, refitted, scores, fewer))
        ):
            superfluous.append(scores)
    if not superfluous:
        return base, held_base, steps
    best = max(scores.total for scores in superfluous)
    alike = [entry for entry in shorter.values() if best - STEP.least_gain < entry[1].total <= best]
    base, held_base = min(alike, key=lambda entry: unseen_error(problem, entry[1]))
    fits = {applied.key: applied for applied in base.active}
    steps = [
        replace(
            step,
            rivals=_rivals(problem, base, fits[step.active.key], step, shorter.get(step.active.key), listed),
        )
        for step in steps
        if step.active.key in fits
    ]
    return pruned(problem, folds, base, held_base, refitted, steps, listed)


def takes_nearly_all(problem: Problem, refitted: HeldOut, held_out: HeldOut, made: Fit) -> bool:
    """Tell whether effects take nearly all that is above the sensor's own noise on unseen rows.

    Parameters
    ----------
    refitted : the held-out rows without any effect
    held_out, made : the rows beside the effects, and their fit
    """
    shares = []
    for name in (each for each in problem.names if problem.kept[each].any()):
        before, after = (
            float(np.mean(problem.judged(name, problem.observed[name] - unseen.simulated[name]) ** 2))
            for unseen in (refitted, held_out)
        )
        left = float(np.mean(problem.judged(name, made.residual[name]) ** 2))
        sensor = min(problem.judged_sd(name, noise_parts(problem, made, name).sensor_sd) ** 2, left)
        if before > VERDICT.shown * sensor:
            shares.append((before - after) / (before - sensor))
    return bool(shares) and min(shares) > VERDICT.nearly


def _rivals(
    problem: Problem,
    base: Fit,
    applied: AppliedEffect,
    step: Step,
    instead: tuple[Fit, HeldOut] | None,
    listed: Sequence[CandidateEffect],
) -> tuple[Rival, ...]:
    """Return what does as well in the place of an effect, now that it stands for another too.

    Parameters
    ----------
    instead : the fit in which the other stands for the effect
    """
    own = score_in_place(problem, base, applied)
    _, chosen, others = best_in_place(problem, base, applied, listed)
    best = next((-rival.difference for rival in others if rival.active.key == applied.key), 0.0)
    rivals = {rival.active.key: rival for rival in step.rivals}
    rivals |= {rival.active.key: replace(rival, difference=rival.difference + best) for rival in others} | {
        chosen.key: Rival(active=chosen, difference=best)
    }
    if instead is not None:
        present, (made, _) = {each.key for each in base.active}, instead
        for other in made.active:  # a drift with the temperature has its zero beside it
            if other.key not in present and not other.effect.nuisance:
                difference = score_in_place(problem, made, other) - own
                rivals[other.key] = Rival(active=other, difference=difference)
    return tuple(rival for key, rival in rivals.items() if key != applied.key)


def with_a_size(problem: Problem, base: Fit, steps: list[Step]) -> tuple[Fit, list[Step]]:
    """Return a hypothesis without effects that a later one left nothing to do."""
    for step in steps:
        remaining = without(base.active, step.active)
        try:
            bare = problem.simulate(base.p, remaining)
        except (FitError, BudgetSpentError):  # the simulation needs it, or there is no time to look
            continue
        moved = {name: column - bare[name] for name, column in base.simulated.items()}
        if all(
            float(np.abs(change[problem.kept[name]]).max(initial=0.0))
            < STEP.visible * base.noise[name].marginal_sd
            for name, change in moved.items()
        ):
            keys = {applied.key for applied in remaining}
            remaining_steps = [step for step in steps if step.active.key in keys]
            return with_a_size(problem, replace_effects(problem, base, remaining), remaining_steps)
    return base, steps


def told_from_none(
    problem: Problem, folds: Folds, base: Fit, held_base: HeldOut, steps: list[Step], *, trust: float
) -> tuple[Fit, HeldOut, list[Step]]:
    """Return a hypothesis without effects whose sizes, all together, may be none.

    The curvature of a fit says where to ask, and the fit without it decides: where friction holds, slides or
    stops, an interval of the curvature reaches to zero for an effect without which nothing is foretold. Then
    the likelihood's own chord from there to none is the sizes' standard deviation (profile likelihood). A
    constant in an equation has to be more than the mean of a plant that wanders, by whatever step it came.

    Parameters
    ----------
    trust : share of a gain that a series so short keeps, by which intervals are wider
    """
    from scipy.stats import chi2

    for applied in base.active:
        away, own = sizes_off(base, applied)
        reach = float(chi2.ppf(VERDICT.interval, len(own))) / trust if own else 0.0
        listed = [step for step in steps if step.active.key != applied.key]
        wanders = may_wander(problem, applied)
        if not (wanders or away < reach) or len(listed) == len(steps):
            continue
        try:
            bare = fit(problem, without(base.active, applied), start=base.p)
        except FitError:  # the simulation needs it
            continue
        lost = base.log_posterior - bare.log_posterior
        wanders = wanders and not outdoes_wandering(problem, bare, base)
        if not (wanders or away < reach):
            continue
        if not wanders and lost > reach / 2:  # the likelihood ratio of their interval
            scale = np.ones(len(base.covariance))
            scale[own] = math.sqrt(away / (2 * lost))
            base = replace(base, covariance=base.covariance * np.outer(scale, scale))
            continue
        try:
            scores = hold_out(problem, folds, bare.active, bare)
        except FitError:  # so does a part of it
            continue
        return told_from_none(problem, folds, bare, scores, listed, trust=trust)
    return base, held_base, steps
