"""One forward step: what screening ranks first, fitted jointly and judged on runs that no fit has seen."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from toolkit.diagnosis.fit.among_runs import tells_runs_apart_alone
from toolkit.diagnosis.fit.fit import Fit, fit
from toolkit.diagnosis.fit.folds import Folds, HeldOut, beyond_form, hold_out, matters
from toolkit.diagnosis.fit.problem import Problem
from toolkit.diagnosis.fit.sensor_noise import noise_parts
from toolkit.diagnosis.fit.unknown_past import past_gain
from toolkit.diagnosis.policy import PRIORS, SCREENING, STEP, VERDICT
from toolkit.diagnosis.search.bends import only_bends
from toolkit.diagnosis.search.case_view import CaseView
from toolkit.diagnosis.search.screen import Scored
from toolkit.diagnosis.search.wandering import may_wander, outdoes_wandering
from toolkit.effects.applied import AppliedEffect, EffectKey
from toolkit.errors import FitError


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rival:
    """A candidate fitted jointly in an effect's place: its log-likelihood less that of the chosen one."""

    active: AppliedEffect
    difference: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterInPlace:
    """A parameter of the simulation that does what an effect does, by the recording alone."""

    name: str
    value: float
    sd: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Step:
    """An effect that was found: its evidence, and what else would explain the same."""

    active: AppliedEffect
    p_value: float
    held_out_gain: float
    gain: float
    rivals: tuple[Rival, ...]
    parameter: ParameterInPlace | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Joint:
    """A candidate fitted jointly with what is there; ``score``: log-posterior less its parameters' cost.

    ``past`` is what the score gains where the states of effects before the first rows are free: by both
    together candidates are held against each other.
    """

    scored: Scored
    fit: Fit
    score: float
    past: float = 0.0
    _held_out: list[HeldOut | None] = field(default_factory=list, repr=False)

    @property
    def compared(self) -> float:
        """What is compared between candidates."""
        return self.score + self.past

    def held_out(self, problem: Problem, folds: Folds) -> HeldOut | None:
        """Return it on rows that it has not seen, None where the simulation does not run without some.

        Of one problem and its folds, computed once: it is asked for beside other candidates again.
        """
        if not self._held_out:
            scores = None
            with contextlib.suppress(FitError):
                scores = hold_out(problem, folds, self.fit.active, self.fit)
            self._held_out.append(scores)
        return self._held_out[0]


def step_groups(
    significant: Sequence[Scored], hinted: Sequence[Scored], hidden: frozenset[EffectKey], least: float
) -> list[tuple[Sequence[Scored], float]]:
    """Return candidates in the order of joint fits, with the least share of the error that each must take.

    Those far behind the first cannot win against it; where none of the first can be fitted, they stand for
    themselves, and have to explain most of what is left. A later effect has to be seen beside the first,
    whose own model is never exact. What is only hinted at comes last, and has to explain nearly all.
    """
    last = [(hinted[: STEP.refined], STEP.shown)] if hinted else []
    if not significant:
        return last
    near = min(STEP.far_behind * significant[0].gain, significant[0].gain - STEP.near)
    first = [scored for scored in significant if scored.gain > near][: STEP.refined]
    # What the refit may have absorbed is fitted with the first, however small it looks from there.
    first += [
        scored
        for scored in significant
        if scored.candidate.key in hidden and all(scored is not near_best for near_best in first)
    ]
    behind = [scored for scored in significant if all(scored is not near_best for near_best in first)][
        : STEP.refined
    ]
    return [(first, least), *([(behind, STEP.least_behind)] if behind else []), *last]


def joint_fits(
    problem: Problem,
    base: Fit,
    promising: Sequence[Scored],
    *,
    least: float = -math.inf,
    beside: Sequence[Joint] = (),
) -> tuple[Joint, ...]:
    """Return candidates fitted jointly with what is there, the best first; of equals the likeliest.

    The data do not prefer one of two that are nearly as good: then the likelier is the one that has a size as
    it is usually met, by likelihood times prior. A sensor's zero is a small share of its range, a drift that
    takes half of it is none. What cannot reach the score ``least`` is left out, and not fitted to its end.
    What was fitted before stands ``beside`` them: it may explain the same, though it was not chosen.
    """
    looked_at = {scored.candidate.key for scored in promising}
    joints = [joint for joint in beside if joint.scored.candidate.key not in looked_at]
    for scored in promising:
        added = (*scored.candidate.zero_beside(base.active), scored.active)
        dear = cost(problem, added)
        fitted = joint_fit(problem, base, added, begin=scored.p, least=least + dear)
        if fitted is not None and fitted.log_posterior - dear >= least:
            score = fitted.log_posterior - dear
            joints.append(Joint(scored=scored, fit=fitted, score=score, past=past_gain(problem, fitted)))
    return ranked(problem, joints)


def cost(problem: Problem, added: Sequence[AppliedEffect]) -> float:
    """Return what the parameters of effects cost of the log-likelihood."""
    searched = [parameter for applied in added for parameter in applied.searched]
    return _weight(problem) * sum(not parameter.ends_count for parameter in searched)


def ranked(problem: Problem, joints: Sequence[Joint]) -> tuple[Joint, ...]:
    """Return joint fits in their order, the best first; of equals the likeliest."""
    best = max((joint.compared for joint in joints), default=0.0)

    def order(joint: Joint) -> tuple[bool, float]:
        behind = joint.compared <= best - VERDICT.close
        active = joint.fit.active[-1]
        prior = 0.0 if behind else active.log_prior(CaseView(problem, active.channel, active.source))
        return behind, -joint.compared - prior

    return tuple(sorted(joints, key=order))


def best_step(
    problem: Problem,
    folds: Folds,
    base: Fit,
    held_base: HeldOut,
    joint: Sequence[Joint],
    p_of: Mapping[int, float],
    least: float,
    refitted: HeldOut,
) -> tuple[Fit, HeldOut, Step] | None:
    """Return the joint fit that stands on what it has not seen, None where none does: the first, or a better.

    Parameters
    ----------
    joint : the best first; three of them are tried
    p_of : p-value of every candidate, by the identity of its entry
    least : share of an output's held-out mean square that it must take away
    refitted : the held-out rows without any effect
    """
    form = max((applied.effect.form_error for applied in base.active), default=0.0)
    standing: list[tuple[Joint, HeldOut]] = []
    for trial in joint[: STEP.judged]:
        made = trial.fit
        if standing and made.log_posterior - base.log_posterior < STEP.rival * (
            standing[0][0].fit.log_posterior - base.log_posterior
        ):
            continue
        # What its own fit tells comes first: unseen rows take a fit for each fold.
        if trial.score - base.log_posterior < STEP.least_gain or drifts_faster(problem, base, made):
            continue
        if only_bends(problem, made):
            continue
        if is_of_runs_alone(problem, base, made):
            continue
        if may_wander(problem, made.active[-1]) and not outdoes_wandering(problem, base, made):
            continue
        scores = trial.held_out(problem, folds)
        if scores is None:
            continue
        gain = scores.total - held_base.total
        if gain < STEP.least_gain or not matters(problem, held_base, scores, least):
            continue
        if not beyond_form(problem, refitted, held_base, scores, form):
            continue
        if made.active[-1].effect.needs_signal and not shows_signal(problem, scores, made.active[-1]):
            continue
        standing.append((trial, scores))
        if not leaves_more_than_noise(problem, made):
            break
    if not standing:
        return None
    # What fits beside parameters that nobody believes yields to what takes its place beside believable ones.
    standing = [entry for entry in standing if _is_believable(problem, entry[0].fit)] or standing
    # The first fits best. Where more than noise is left, that is also what the fit made of the rest, and one
    # that foretells unseen rows better goes before it; the better fit then stays in its class.
    best = max(standing, key=lambda entry: entry[1].total)
    trial, scores = best if best[1].total > standing[0][1].total + STEP.least_gain else standing[0]
    if _is_believable(problem, trial.fit):  # nor is it one class with what nobody believes
        least = trial.compared - VERDICT.close
        joint = [each for each in joint if each.compared <= least or _is_believable(problem, each.fit)]
    step = Step(
        active=trial.fit.active[-1],
        p_value=p_of[id(trial.scored)],
        held_out_gain=scores.total - held_base.total,
        gain=trial.fit.log_posterior - base.log_posterior,
        rivals=rivals(problem, trial, joint),
    )
    return trial.fit, scores, step


def _is_believable(problem: Problem, made: Fit) -> bool:
    """Tell whether no parameter of the simulation is far off its prior."""
    return bool(np.all(np.abs(problem.off_priors(made.p)) <= PRIORS.far))


def is_of_runs_alone(problem: Problem, before: Fit, after: Fit) -> bool:
    """Tell whether effects of some runs take only what any runs' zeros and gains differ by."""
    present = {applied.key for applied in before.active}
    added = [applied for applied in after.active if applied.key not in present]
    confined = sum(applied.runs is not None for applied in added)
    if not confined:
        return False
    counting = {
        name: [rows.start + np.flatnonzero(kept[rows]) for rows in problem.slices if kept[rows].any()]
        for name, kept in problem.kept.items()
        if kept.any()
    }
    return all(
        tells_runs_apart_alone(
            [
                (before.simulated[name][at], before.residual[name][at], after.residual[name][at])
                for at in places
            ],
            cost=max(sum(len(applied.searched) for applied in added), 1),
            tests=len(problem.runs) ** confined,
            alpha=SCREENING.alpha,
            of_some=True,
        )
        for name, places in counting.items()
    )


def drifts_faster(problem: Problem, before: Fit, after: Fit) -> bool:
    """Tell whether a fit with more in it leaves larger rates of an output that only drifts.

    Its rows are weighed as those of a coloured noise, by how they follow from the rows before: what makes
    them likelier and the motion worse explains the noise.
    """
    left = (
        [np.mean(problem.judged(name, made.residual[name]) ** 2) for name in problem.rates]
        for made in (before, after)
    )
    return any(more > less for less, more in zip(*left, strict=True))


def leaves_more_than_noise(problem: Problem, made: Fit) -> bool:
    """Tell whether an output's rest has more in it than what its quickest changes show as the sensor's."""
    parts = [noise_parts(problem, made, name) for name in problem.names if problem.kept[name].any()]
    return any(each.process_sd > each.sensor_sd for each in parts)


def shows_signal(problem: Problem, held_out: HeldOut, effect: AppliedEffect) -> bool:
    """Tell whether an output has the simulated signal in it, and is not only made small by a factor."""
    names = [str(effect.channel)]
    if effect.channel in {driver.name for driver in problem.case.drivers}:
        # A factor may make an input vanish, of which some output tells; a sign does not.
        names = [] if effect.effect.discrete else list(problem.names)
    view = CaseView(problem, effect.channel)

    def has_signal(name: str) -> bool:
        rows = problem.kept[name]
        simulated = held_out.simulated[name][rows]
        residual = problem.observed[name][rows] - simulated
        simulated = simulated - (view.origin(name) or 0.0)
        return float(np.mean(residual**2)) < STEP.signal**2 * float(np.mean(simulated**2))

    return not names or any(has_signal(name) if name in problem.names else True for name in names)


def rivals(problem: Problem, chosen: Joint, joint: Sequence[Joint]) -> tuple[Rival, ...]:
    """Return what else was fitted in the place of the chosen one."""
    weight = _weight(problem)
    return tuple(
        Rival(
            active=rival.fit.active[-1],
            difference=rival.compared
            - chosen.compared
            + weight * (_shapes(rival.scored.active) - _shapes(chosen.scored.active)),
        )
        for rival in joint
        if rival is not chosen and not rival.scored.active.effect.nuisance
    )


def score_in_place(problem: Problem, made: Fit, active: AppliedEffect) -> float:
    """Return by what effects are compared in one place: the log-posterior less the cost of their sizes.

    Parameters that only shape an effect make it no less able to imitate another; what came before the first
    rows is free.
    """
    return made.log_posterior + past_gain(problem, made) - _cost_in_place(problem, active)


def least_in_place(problem: Problem, score: float, active: AppliedEffect) -> float:
    """Return the log-posterior with which an effect comes so near to a score that the two are one class.

    Of one that remembers, a fit does not show what a free past would add.
    """
    if active.effect.remembers:
        return -math.inf
    return score - VERDICT.close + _cost_in_place(problem, active)


def _cost_in_place(problem: Problem, active: AppliedEffect) -> float:
    return cost(problem, (active,)) - _weight(problem) * _shapes(active)


def _weight(problem: Problem) -> float:
    """Return what a parameter costs of the log-likelihood (BIC)."""
    return 0.5 * math.log(max(problem.values, 1.0))


def joint_fit(
    problem: Problem,
    base: Fit,
    added: Sequence[AppliedEffect],
    *,
    plain: bool | None = None,
    begin: tuple[float, ...] | None = None,
    least: float = -math.inf,
) -> Fit | None:
    """Return the joint fit with effects more, None where the simulation runs with no part of them.

    Screening is linear: the size to which it leads may be beyond what a simulation can run with, where the
    true one is not. An effect that changes an answer's shape begins at the declared parameters as well, where
    a refit without it has moved them: they may have gone where it no longer helps. So does any whose fit ends
    with a parameter that nobody believes: what is of one form with a part of the simulation may have changed
    places with it, a filter's lag with the plant's own. Where it was seen with parameters of its own, it
    begins at these (``begin``). A fit whose log-posterior cannot reach ``least`` is not ended.
    """
    starts = [base.p if begin is None else begin]
    moved = float(np.abs(problem.off_priors(base.p)).max(initial=0.0))
    if begin is None and moved > PRIORS.moved and any(effect.effect.misleads for effect in added):
        starts.append(tuple(parameter.value for parameter in problem.free))
    fits = [_fitted(problem, base, added, start, plain, least) for start in starts]
    best = max((fitted for fitted in fits if fitted), key=lambda fitted: fitted.log_posterior, default=None)
    declared = tuple(parameter.value for parameter in problem.free)
    if best is None or declared in starts or not np.any(np.abs(problem.off_priors(best.p)) > PRIORS.far):
        return best
    small = tuple(_shared(effect, 0.25) for effect in added)
    again = _fitted(problem, base, small, declared, plain, max(least, best.log_posterior))
    return best if again is None or again.log_posterior < best.log_posterior else again


def _fitted(
    problem: Problem,
    base: Fit,
    added: Sequence[AppliedEffect],
    start: tuple[float, ...],
    plain: bool | None,
    least: float,
) -> Fit | None:
    for share in (1.0, 0.5, 0.25, 0.125) if any(effect.searched for effect in added) else (1.0,):
        try:
            active = (*base.active, *(_shared(effect, share) for effect in added))
            return fit(problem, active, start=start, plain=plain, least=least)
        except FitError:
            continue
    return None


def _shared(effect: AppliedEffect, share: float) -> AppliedEffect:
    """Return an effect with a share of its size."""
    values = dict(effect.values)
    for parameter in effect.searched:
        if parameter.off is not None and math.isfinite(parameter.off):
            values[parameter.name] = parameter.off + share * (effect.values[parameter.name] - parameter.off)
    return replace(effect, values=values)


def _shapes(effect: AppliedEffect) -> int:
    """Return how many parameters only shape an effect: they make it no less able to imitate another."""
    return sum(parameter.off is None and not parameter.ends_count for parameter in effect.searched)
