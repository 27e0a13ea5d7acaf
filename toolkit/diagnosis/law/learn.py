"""Learning the law of what has no name: joint fits of ranked shapes, judged as effects are.

Where structure stays, each law is the simplest of those that the data do not tell from the best one; it has
to hold on rows that no fit has seen, beside nominal parameters that are refitted with it. An event belongs to
one stretch of one run: it explains and does not predict, and no row that it has not seen can judge it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np

from toolkit.diagnosis.fit.among_runs import tells_runs_apart_alone
from toolkit.diagnosis.fit.fit import sizes_off
from toolkit.diagnosis.fit.folds import hold_out, matters, unseen_error
from toolkit.diagnosis.fit.sensor_noise import noise_parts
from toolkit.diagnosis.law.foretelling import taken_for_noise
from toolkit.diagnosis.law.ranking import p_value, ranked, ranked_in_place
from toolkit.diagnosis.law.row_to_row import shown_from_row_to_row
from toolkit.diagnosis.law.terms import joint_terms_of, pulses_of, terms_of
from toolkit.diagnosis.law.trial import (
    Trial,
    curve_trial,
    scales_of,
    trials_of,
    unlocked_tone,
)
from toolkit.diagnosis.law.unseen_runs import laws_on_unseen_runs
from toolkit.diagnosis.policy import LAWS, PRIORS, SCREENING, STEP, STRUCTURE, VERDICT
from toolkit.diagnosis.search.bends import at_bound
from toolkit.diagnosis.search.forward_step import joint_fit
from toolkit.diagnosis.search.noise_floor import is_beyond_noise, may_leave_noise
from toolkit.diagnosis.search.screen import LinearisedFit
from toolkit.diagnosis.search.time_budget import BudgetSpentError, TimeBudget
from toolkit.errors import FitError

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.fit.fit import Fit
    from toolkit.diagnosis.fit.folds import HeldOut
    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.diagnosis.search.search import Search
    from toolkit.diagnosis.search.unexplained import StructureFound
    from toolkit.effects.applied import AppliedEffect


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Law:
    """One law that was learned; of one in several equations the next is its ``counterpart``.

    ``held_out_gain`` is None of an event; ``shares`` are what it takes of each output's mean square above
    the noise, on held-out rows where it predicts; ``confounded`` are the nominal parameters that moved far
    because of it; ``resembles`` the known effects whose responses are most like its own, with their distance
    (`with_resemblances`).
    """

    trial: Trial
    applied: AppliedEffect
    p_value: float
    held_out_gain: float | None
    share: float
    confounded: tuple[str, ...]
    resembles: tuple[tuple[str, float], ...] = ()
    counterpart: Law | None = None

    @property
    def together(self) -> tuple[Law, ...]:
        """The law, and those in other equations that are one with it."""
        return (self, *(() if self.counterpart is None else self.counterpart.together))

    @property
    def predicts(self) -> bool:
        """Tell whether it says something of rows that nobody has recorded."""
        return self.held_out_gain is not None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Laws:
    """The laws of a search's rest: the fit with them, its held-out rows, and whether there was time."""

    listed: tuple[Law, ...]
    fit: Fit
    held_out: HeldOut
    complete: bool = True


def learned(search: Search, *, withdrawn: bool, budget: TimeBudget) -> Laws:
    """Return the laws of what a search left without a name.

    Parameters
    ----------
    withdrawn : the effects that were found are not told: laws begin beside the refitted simulation
    """
    base, held_out = (
        (search.refitted, search.held_refitted) if withdrawn else (search.augmented, search.held_augmented)
    )
    structure = search.structure_before if withdrawn and search.steps else search.structure
    outputs = _outputs(search.problem, base, structure)
    listed: list[Law] = []
    complete = True
    try:
        for turn in range(LAWS.most):
            if not outputs:
                break
            budget.check(f"laws of what has no name: {turn + 1}")
            outcome = _next(search, base, held_out, outputs)
            if outcome is None:
                listed += _unlocked(search.problem, base, outputs, listed)
                break
            law, base, held_out = outcome
            listed += law.together
            if search.problem.shown_sd:  # noise it may be now: what was none has been taken from it
                rest = taken_for_noise(search.problem, search.folds, base, turn)
                outputs = tuple(part.output for part in rest)
    except BudgetSpentError:
        complete = False
    return Laws(listed=tuple(listed), fit=base, held_out=held_out, complete=complete)


def learned_by_size(search: Search, laws: Laws, budget: TimeBudget) -> tuple[Search, Laws]:
    """Return a search without effects and its laws, by the rest's size where these foretell far better.

    Asked where the laws that rows show leave what is no noise. The own noise of an equation is coloured: its
    rest has to be more than any.

    Parameters
    ----------
    search : one that names nothing
    """
    by_size, problem = search.by_size, search.problem
    motion = problem.model.capability.motion
    if by_size is None or not laws.complete:
        return search, laws
    if motion is not None and motion.integrates and not is_beyond_noise(problem, search.refitted):
        return search, laws
    if laws.listed and may_leave_noise(by_size.problem, search.refitted, laws.fit):
        return search, laws
    others = learned(by_size, withdrawn=False, budget=budget)
    by_rows, left = (unseen_error(problem, each.held_out) for each in (laws, others))
    better = left < by_rows + math.log(STEP.least_behind if laws.listed else 1 - LAWS.share)
    return (by_size, others) if others.listed and better else (search, laws)


def _unlocked(problem: Problem, base: Fit, outputs: Sequence[str], before: Sequence[Law]) -> list[Law]:
    """Return tones that hold no phase from run to run: they explain, and no fit has them in it."""
    toned = {law.applied.channel for law in before if law.trial.form == "tone"}
    trials = [unlocked_tone(problem, base, output) for output in outputs if output not in toned]
    return [
        Law(
            trial=trial, applied=trial.applied, p_value=STRUCTURE.line, held_out_gain=None,
            share=trial.gain, confounded=(),
        )
        for trial in trials
        if trial is not None
    ]  # fmt: skip


def _outputs(problem: Problem, base: Fit, structure: Sequence[StructureFound]) -> tuple[str, ...]:
    """Return the outputs that ask for a law: all of them where a parameter has absorbed what was left out.

    Of an equation runs that differ ask as well: an input that came once moves its run as long as it rings.
    So does a rest that is known to be no noise, and in an equation one that is more than the sensor's noise:
    what rings is coloured.
    """
    strained = any(abs(off) > PRIORS.far for off in problem.off_priors(base.p))
    motion = problem.model.capability.motion
    solved = motion is not None and motion.integrates
    affected = {part.output for part in structure if solved or part.is_lawful or part.is_too_large}
    return tuple(
        name
        for name in problem.names
        if strained
        or name in affected
        or name in problem.memory
        or (solved and _wanders(problem, base, name))
    )


def _wanders(problem: Problem, base: Fit, name: str) -> bool:
    """Tell whether an output's rest is more than its sensor's noise: its colour may be physics left out."""
    if not problem.kept[name].any():
        return False
    part = noise_parts(problem, base, name)
    return part.process_sd > part.sensor_sd and not part.is_sensor


def _next(
    search: Search, base: Fit, held_out: HeldOut, outputs: Sequence[str]
) -> tuple[Law, Fit, HeldOut] | None:
    """Return the next law with the fit beside it, None where none stands."""
    problem = search.problem
    weight = 0.5 * math.log(max(problem.values, 1.0))
    screen = LinearisedFit.of(problem, base)
    present = {applied.key for applied in base.active}
    trials = [
        trial
        for trial in (
            *trials_of(problem, base, outputs),
            *scales_of(problem, base),
            *terms_of(problem),
            *pulses_of(problem, base, screen),
        )
        if trial.applied.key not in present
    ]
    joint = [
        trial
        for trial in joint_terms_of(problem, base, screen)
        if not present.intersection(applied.key for applied in trial.together)
    ]
    looked = len(trials) + len(joint)
    # Of a rest that is known to be no noise the question is which law it is, and not whether there is one.
    alpha = SCREENING.alpha if set(outputs) <= set(problem.memory) else LAWS.alpha
    likely = [
        trial for trial in ranked(problem, base, screen, trials, weight) if p_value(trial, looked) < alpha
    ]
    near = [trial for trial in likely if trial.gain > STEP.far_behind * likely[0].gain]
    along = shown_from_row_to_row(problem, base, trials, weight)[: LAWS.along]
    shown = {trial.place for trial, _ in along}
    near = [trial for trial in near if trial.place not in shown][: LAWS.fitted - len(along)]
    # Two equations at once are ranked with no single one: each of them is fitted.
    near += [trial for trial in joint if p_value(trial, looked) < alpha]
    fitted = _fitted(problem, base, [*along, *((trial, None) for trial in near)], weight)
    if fitted:
        _, best_trial, refit = fitted[0]
        tried = {trial.place for _, trial, _ in fitted}
        others = [trial for trial in trials if trial.place not in tried]
        in_place = ranked_in_place(problem, refit, best_trial, others, weight)[: LAWS.in_place]
        fitted = _best_first(
            [*fitted, *_fitted(problem, base, [(trial, refit.p) for trial in in_place], weight)]
        )
    if fitted and (drawn := curve_trial(problem, fitted[0][1])) is not None:
        best = fitted[0][0] - base.log_posterior
        curves = [
            trial
            for trial in ranked(problem, base, screen, [drawn], weight)
            if 0.5 * trial.gain - weight * trial.cost > best
        ]
        fitted += _fitted(problem, base, [(trial, None) for trial in curves], weight)
    # What was met once explains and does not predict: it is asked where nothing that predicts stands.
    for events in (False, True):
        entries = [entry for entry in fitted if (entry[1].form == "event") is events]
        for _, trial, refit in _simplest_first(entries)[: LAWS.judged]:
            law = _judged(search, base, held_out, trial, refit, looked)
            if law is not None:
                return law
    return _by_unseen_runs(search, base, held_out, screen, trials, weight)


def _by_unseen_runs(
    search: Search,
    base: Fit,
    held_out: HeldOut,
    screen: LinearisedFit,
    trials: Sequence[Trial],
    weight: float,
) -> tuple[Law, Fit, HeldOut] | None:
    """Return the simplest of the laws that whole unseen runs show best, None where they show none.

    That there is something to explain is beyond doubt there: the p-value is that of the law's own gain.
    """
    problem = search.problem
    shown = laws_on_unseen_runs(problem, search.folds, base, held_out, screen, trials, weight)
    order = _simplest_first([(each.gain, each.trial, each.fit) for each in shown])
    for gain, trial, refit in order:
        scores = next(each.held_out for each in shown if each.fit is refit)
        if _is_told_from_none(refit, search.screen.trust(refit.noise), len(trial.together)):
            p = min(1.0, math.exp(-min(gain, 700.0)))
            return _law(search, base, held_out, trial, refit, scores, p_value=p), refit, scores
    return None


def _fitted(
    problem: Problem, base: Fit, trials: Sequence[tuple[Trial, tuple[float, ...] | None]], weight: float
) -> list[tuple[float, Trial, Fit]]:
    """Return joint fits with their log-posterior less their parameters' cost, the best first.

    Each begins at the parameters beside it, or where there are none at those of the base. One that can
    neither be among those that are judged nor pass for as good as the best is not ended.
    """
    fitted: list[tuple[float, Trial, Fit]] = []
    for trial, begin in trials:
        scores = sorted(
            score for score, other, _ in fitted if (other.form == "event") is (trial.form == "event")
        )
        least = -math.inf
        if len(scores) >= LAWS.judged:
            least = min(scores[-LAWS.judged], scores[-1] - VERDICT.close) + weight * trial.cost
        refit = joint_fit(problem, base, trial.together, begin=begin, least=least)
        if refit is None or refit.log_posterior < least:
            continue
        if not any(map(at_bound, refit.active[-len(trial.together) :])):
            fitted.append((refit.log_posterior - weight * trial.cost, trial, refit))
    return _best_first(fitted)


def _best_first(fitted: Sequence[tuple[float, Trial, Fit]]) -> list[tuple[float, Trial, Fit]]:
    return sorted(fitted, key=lambda entry: -entry[0])


def _simplest_first(fitted: Sequence[tuple[float, Trial, Fit]]) -> list[tuple[float, Trial, Fit]]:
    """Return fits in order, of those that the data do not tell from the best one the simplest first.

    Of laws that are one on the rows that were recorded the shortest is it.
    """
    best = max((score for score, _, _ in fitted), default=0.0)

    def order(entry: tuple[float, Trial, Fit]) -> tuple[bool, int, float, int]:
        score, trial, _ = entry
        behind = score <= best - VERDICT.close
        return behind, 0 if behind else trial.cost, -round(score, 3), len(trial.applied.effect.name)

    return sorted(fitted, key=order)


def _judged(
    search: Search,
    base: Fit,
    held_out: HeldOut,
    trial: Trial,
    refit: Fit,
    looked: int,
) -> tuple[Law, Fit, HeldOut] | None:
    problem = search.problem
    if not _is_told_from_none(refit, search.screen.trust(refit.noise), len(trial.together)):
        return None
    scores = held_out
    if trial.form == "event":
        if _taken(problem, base.residual, refit.residual) < LAWS.share:
            return None
    else:
        try:
            scores = hold_out(problem, search.folds, refit.active, refit)
        except FitError:
            return None
        if scores.total - held_out.total < STEP.least_gain or not matters(
            problem, held_out, scores, LAWS.share
        ):
            return None
        outputs = trial.outputs if search.folds.by_run else ()
        if outputs and all(
            tells_runs_apart_alone(
                _of_runs(problem, name, held_out, scores, trial),
                cost=trial.cost,
                tests=max(looked, 1) * trial.looked,
            )
            for name in outputs
        ):
            return None
    law = _law(search, base, held_out, trial, refit, scores, p_value=p_value(trial, looked))
    return law, refit, scores


def _of_runs(
    problem: Problem, name: str, before: HeldOut, after: HeldOut, trial: Trial
) -> list[tuple[Array, Array, Array]]:
    """Return of every run what sizes of its own are in proportion to, and an output's errors."""
    sizes = [before.simulated[name], *([trial.swayed[name]] if trial.swayed else ())]
    errors = [problem.observed[name] - each.simulated[name] for each in (before, after)]
    counting = [rows.start + np.flatnonzero(problem.kept[name][rows]) for rows in problem.slices]
    return [
        (np.column_stack([size[at] for size in sizes]), errors[0][at], errors[1][at])
        for at in counting
        if len(at)
    ]


def _law(
    search: Search,
    base: Fit,
    held_out: HeldOut,
    trial: Trial,
    refit: Fit,
    scores: HeldOut,
    *,
    p_value: float,
) -> Law:
    """Return a law that stands; an event's shares are those of the rows that it was fitted to."""
    problem, fitted = search.problem, refit.active[-len(trial.together) :]
    moved = [
        parameter.name
        for parameter, before, after in zip(problem.declared, base.p, refit.p, strict=False)
        if parameter.sd and abs(after - before) > LAWS.moved * parameter.sd
    ]
    event = trial.form == "event"
    errors = [
        {name: problem.observed[name] - each.simulated[name] for name in problem.names}
        for each in ((base, refit) if event else (held_out, scores))
    ]
    share, gained = _taken(problem, *errors), None if event else scores.total - held_out.total
    law: Law | None = None
    for part, applied in zip(reversed(trial.parts), reversed(fitted), strict=True):
        law = Law(
            trial=part, applied=applied, p_value=p_value, held_out_gain=gained, share=share,
            confounded=tuple(moved), counterpart=law,
        )  # fmt: skip
    return cast("Law", law)


def _is_told_from_none(refit: Fit, trust: float, count: int = 1) -> bool:
    """Tell whether the sizes of each of a fit's last effects are none only outside of their joint interval.

    Parameters
    ----------
    trust : in the covariance of the fit, as in the intervals that are printed
    """
    from scipy.stats import chi2

    sizes = [sizes_off(refit, applied) for applied in refit.active[-count:] if applied.searched]
    return all(own and away * trust > float(chi2.ppf(VERDICT.interval, len(own))) for away, own in sizes)


def _taken(problem: Problem, before: dict[str, np.ndarray], after: dict[str, np.ndarray]) -> float:
    """Return the largest share of an output's mean square that is gone."""
    squares = {
        name: [float(np.mean(problem.judged(name, error[name]) ** 2)) for error in (before, after)]
        for name, kept in problem.kept.items()
        if kept.any()
    }
    shares = [1 - left / max(there, 1e-300) for there, left in squares.values()]
    return max(shares, default=0.0)
