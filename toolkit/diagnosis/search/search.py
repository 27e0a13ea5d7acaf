"""The search: forward steps of joint fits, judged on held-out runs and against the whole search's null."""

from __future__ import annotations

import contextlib
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.fit.along_recording import with_run_starts
from toolkit.diagnosis.fit.drift import judged_by_rates
from toolkit.diagnosis.fit.fit import Fit, fit, noise_of, replace_effects
from toolkit.diagnosis.fit.folds import Folds, HeldOut, folds_of, hold_out, matters, unseen_error
from toolkit.diagnosis.fit.problem import Problem, without_outliers
from toolkit.diagnosis.fit.run_scatter import (
    RunParameter,
    RunScatter,
    held_out_beside_scatter,
    with_run_scatter,
)
from toolkit.diagnosis.policy import BUDGET, STEP, VERDICT
from toolkit.diagnosis.search.candidates import candidates
from toolkit.diagnosis.search.channel_factors import leaves_noise, with_units_judged
from toolkit.diagnosis.search.forward_step import Step, best_step, joint_fits, step_groups
from toolkit.diagnosis.search.in_place import foretold_best
from toolkit.diagnosis.search.lattice import lattice_of
from toolkit.diagnosis.search.noise_floor import hidden_in_noise, may_leave_noise, weighed_as_mismatch
from toolkit.diagnosis.search.own_terms import without_own_terms
from toolkit.diagnosis.search.pairs import best_pair
from toolkit.diagnosis.search.proposals import NONE, proposals
from toolkit.diagnosis.search.proposed_step import beside_rivals, proposed_step
from toolkit.diagnosis.search.screen import LinearisedFit, Scored
from toolkit.diagnosis.search.screen_step import from_declared, look, masked
from toolkit.diagnosis.search.superfluous import pruned, told_from_none, with_a_size, without
from toolkit.diagnosis.search.time_budget import BudgetSpentError, TimeBudget
from toolkit.diagnosis.search.unexplained import StructureFound, remainder
from toolkit.diagnosis.search.unseen_runs import does_harm, shown_on_unseen_runs
from toolkit.diagnosis.search.wrong_units import is_listed, unit_step, wrong_units
from toolkit.effects.applied import ORIGIN, AppliedEffect
from toolkit.errors import FitError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.diagnosis.search.candidates import CandidateEffect

# What of a found effect matters for its size alone: the zero beneath it, the noise that went through it.


def refined(
    problem: Problem, folds: Folds, base: Fit, held_out: HeldOut, listed: Sequence[CandidateEffect]
) -> tuple[Fit, HeldOut]:
    """Return the hypothesis that a search found with what its effects' sizes depend on.

    Under every drift with the temperature a free zero, as a nuisance: the effect counts from the first
    row's temperature, and nobody recorded at which one the channel was zeroed. A dead band whose noise
    comes before it, where the recording is more likely so.

    Parameters
    ----------
    base, held : the hypothesis found, fitted to all rows and by folds
    listed : every candidate of the case
    """
    with_zeros = _better(problem, base, _with_zeros(base, listed), -sys.float_info.max)
    if with_zeros is not base:
        with contextlib.suppress(FitError):
            held_out = hold_out(problem, folds, with_zeros.active, with_zeros)
            base = with_zeros
    # Rows inside a band have no noise, so that a fold's noise, and its score, hang on which rows it has: the
    # noise before a band is for the band's width alone, and the score stays that of the sharp one.
    for applied in base.active:
        base = _better(problem, base, _with_noise(base, applied), STEP.band_noise)
    return base, held_out


def _better(problem: Problem, base: Fit, active: tuple[AppliedEffect, ...] | None, least: float) -> Fit:
    """Return the fit with other effects where it can be made, and gains so much."""
    if active is None:
        return base
    try:
        refitted = fit(problem, active, start=base.p)
    except FitError:
        return base
    return refitted if refitted.log_posterior >= base.log_posterior + least else base


def _with_zeros(base: Fit, listed: Sequence[CandidateEffect]) -> tuple[AppliedEffect, ...] | None:
    present = {applied.key for applied in base.active}
    zeros = [zero for each in listed if each.key in present for zero in each.zero_beside(base.active)]
    return (*base.active, *zeros) if zeros else None


def _with_noise(base: Fit, effect: AppliedEffect) -> tuple[AppliedEffect, ...] | None:
    noise, key = base.noise.get(str(effect.channel)), effect.effect.noise_key
    if key is None or noise is None:
        return None
    return tuple(
        replace(applied, values={**applied.values, key: noise.marginal_sd})
        if applied.key == effect.key
        else applied
        for applied in base.active
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Search:
    """What a search has found, with the fits that show it.

    ``undecided`` are the effects that the last look of all showed, confirmed by unseen rows or not;
    ``disagreed`` is the parameter that its runs disagree about; ``kept`` tells that its effects are named,
    whatever else stays; ``by_size`` is one of a rest that is no noise, which found no effect.
    """

    problem: Problem
    folds: Folds
    nominal: Fit
    refitted: Fit
    augmented: Fit
    steps: tuple[Step, ...]
    structure: tuple[StructureFound, ...]
    structure_before: tuple[StructureFound, ...]
    held_refitted: HeldOut
    held_augmented: HeldOut
    screen: LinearisedFit
    scored: tuple[Scored, ...]
    skipped: tuple[str, ...]
    scatter: tuple[RunScatter, ...] = ()
    undecided: frozenset[str] = frozenset()
    disagreed: RunParameter | None = None
    kept: bool = False
    by_size: Search | None = None

    def variance(self, at: int) -> float:
        """Return the variance of a parameter of the augmented fit, by its place among them.

        What a short series leaves open of its noise's colour widens it as it shortens a gain.
        """
        fit = self.augmented
        return float(fit.covariance[at, at]) / self.screen.trust(fit.noise)


def search(problem: Problem, *, seed: int, budget: TimeBudget) -> Search:
    """Search for what a simulation leaves out.

    Rows are weighed by a noise of the rest's colour first: what leaves noise is found so, however small. In a
    rest that no colour makes noise each row foretells the next, and what is right makes corners in it. Where
    what was found leaves such a rest, it is weighed by its size, and that stands if it leaves less than
    half with no more effects.

    Parameters
    ----------
    problem : runs, outputs, nominal parameters
    seed : of the null's draws; from the case's hash, so that an answer repeats
    budget : a spent one ends the search with what it has
    """
    nominal = _as_declared(problem)
    budget.check("refit of the nominal parameters")
    refitted = fit(problem)
    problem = without_outliers(problem, refitted.residual)
    refitted = fit(problem, start=refitted.p)
    problem = judged_by_rates(problem, refitted)
    if problem.rates:
        refitted = fit(problem, start=refitted.p)
    budget.check("where the runs start")
    problem = with_run_starts(problem, refitted)
    if problem.starts:
        nominal = replace(nominal, p=(*nominal.p, *(0.0 for _ in problem.starts)))
        refitted = fit(problem, start=problem.begun(refitted.p))
    folds = folds_of(problem, refitted)
    found = _searched(problem, folds, nominal, refitted, seed, budget)
    weighed = weighed_as_mismatch(problem, refitted)
    if found.skipped or (found.steps and may_leave_noise(weighed, refitted, found.augmented)):
        return found
    if not weighed.memory:
        weighed = weighed_as_mismatch(problem, refitted, may_be_noise=True)
    if not weighed.memory:
        return found
    by_size = _searched(weighed, folds, nominal, fit(weighed, start=refitted.p), seed, budget)
    if by_size.steps:
        by_rows, left = (unseen_error(problem, each.held_augmented) for each in (found, by_size))
        halves = left < by_rows + math.log(1 - STEP.least_behind)
        simpler = halves and len(by_size.steps) <= len(found.steps)
        return by_size if simpler or not found.steps else found
    return replace(found, by_size=by_size)


def _searched(
    problem: Problem, folds: Folds, nominal: Fit, refitted: Fit, seed: int, budget: TimeBudget
) -> Search:
    """Return what steps from a refit lead to."""
    wrong = wrong_units(problem, (nominal, refitted))
    listed = candidates(problem)
    if wrong and not is_listed(wrong[0], listed):
        listed = (*(candidate for candidate in wrong if candidate.discrete), *listed)
    skipped: list[str] = []
    steps: list[Step] = []
    base = refitted
    held_base = held_refitted = hold_out(problem, folds, (), refitted)
    screen = LinearisedFit.of(problem, base)
    scored: tuple[Scored, ...] = ()
    undecided = frozenset[str]()
    before: tuple[StructureFound, ...] = ()
    structure: tuple[StructureFound, ...] = ()
    proposed = NONE
    try:
        for turn in range(STEP.most_effects + 1):
            base, steps = with_a_size(problem, base, steps)
            if steps and (problem.memory or problem.starts):
                problem = weighed_as_mismatch(problem, base) if problem.memory else problem
                problem = with_run_starts(problem, base) if problem.starts else problem
                refitted = fit(problem, start=problem.begun(refitted.p))
                base = fit(problem, base.active, start=problem.begun(base.p))
                held_refitted = hold_out(problem, folds, (), refitted)
                held_base = hold_out(problem, folds, base.active, base)
            share = STEP.later if turn else STEP.first
            # Beside a rest that is no noise, what leaves more than it takes imitates it.
            if turn and problem.memory:
                share = STEP.least_behind

            def fitting(scored: Sequence[Scored], turn: int = turn) -> None:
                names = ", ".join(dict.fromkeys(trial.candidate.name for trial in scored))
                budget.check(f"step {turn + 1}: joint fits of {names}")

            led, sought = None, tuple(listed)
            if turn < STEP.most_effects:
                budget.check(f"step {turn + 1}: the equation along the recording")
                proposed = proposals(problem, base)
                led = proposed_step(
                    problem, folds, base, held_base, proposed,
                    least=share, refitted=held_refitted, listed=listed, tell=fitting,
                )  # fmt: skip
                if led is not None and led.outcome is not None:
                    sought = tuple(candidate for candidate in listed if proposed.is_worth(candidate))
            budget.check(f"step {turn + 1}: screening {len(sought)} candidates")
            view = look(problem, base, sought, turn=turn, seed=seed + turn)
            harmed = does_harm(problem, nominal.simulated, held_refitted)
            view = from_declared(problem, base, view, of_all=harmed)
            screen, scored = view.screen, view.scored
            undecided = frozenset(trial.candidate.name for trial in view.significant)
            budget.check(f"step {turn + 1}: structure of the residual")
            structure = remainder(problem, screen, base, seed + 100 + turn)
            structure += hidden_in_noise(problem, folds, base, seed + 200 + turn)
            if turn == 0:
                before = structure
            if turn == STEP.most_effects:
                break
            unit = None
            if turn == 0 and wrong:
                budget.check(f"step {turn + 1}: wrong units")
                unit = unit_step(problem, folds, base, held_base, wrong)
                if unit is not None and leaves_noise(problem, unit[0]):
                    base, held_base, step = unit
                    steps.append(step)
                    continue
            if unit is None and led is not None and led.outcome is not None:
                base, held_base, more = beside_rivals(
                    problem, folds, base, held_base, led, led.outcome, view,
                    least=share, refitted=held_refitted, tell=fitting,
                )  # fmt: skip
                steps += [step for step in more if not _is_nuisance(step, steps)]
                continue
            budget.check(f"step {turn + 1}: unseen runs")
            outcome = shown_on_unseen_runs(problem, folds, base, held_base, view)
            hidden = masked(problem, base, view.candidates) if view.significant else frozenset()
            hinted: Sequence[Scored] = view.hinted if folds.by_run and len(problem.runs) >= STEP.runs else ()
            significant, hinted, paired = (
                [trial for trial in ranking if proposed.is_worth(trial.candidate)]
                for ranking in (view.significant, hinted, scored)
            )
            groups = step_groups(significant, hinted, hidden, share) if outcome is None else []
            for promising, least in groups:
                fitting(promising)
                joint = joint_fits(problem, base, promising, beside=() if led is None else led.joint)
                p_of = proposed.p_of | view.p_of
                outcome = best_step(problem, folds, base, held_base, joint, p_of, least, held_refitted)
                if outcome is not None:
                    break
            # A factor takes most of any steep bend: where more than noise stays beside it, it is one of many.
            if unit is not None and (outcome is None or outcome[1].total < unit[1].total):
                outcome = unit
            if outcome is not None:
                base, held_base, step = outcome
                if not _is_nuisance(step, steps):
                    steps.append(step)
                continue
            # Of a residual without structure no two effects explain what no single one does. By size none are
            # asked that rows have not shown.
            if not structure or problem.memory or turn + 2 > STEP.most_effects:
                break
            both = None
            try:
                check = partial(budget.check, f"step {turn + 1}: pairs of candidates", reserve=BUDGET.laws)
                both = best_pair(problem, folds, base, held_base, screen, paired, share, check)
            except BudgetSpentError as error:  # what came before, and laws, need no pair
                skipped.append(str(error))
            if both is None:
                break
            base, held_base, pair = both
            for step in sorted(pair, key=lambda step: step.active.effect.is_zero):
                if not _is_nuisance(step, steps):
                    steps.append(step)
        base, held_base, steps = with_units_judged(
            problem, folds, base, held_base, steps, structured=bool(structure)
        )
        base, held_base = refined(problem, folds, base, held_base, listed)
        base, held_base, steps = _stepped(problem, base, held_base, steps)
        if len(steps) > 1:
            budget.check("swaps")
            base, held_base, steps = pruned(problem, folds, base, held_base, held_refitted, steps, listed)
            budget.check("swaps")
            base, held_base, steps = foretold_best(problem, folds, base, held_base, steps)
    except BudgetSpentError as error:
        skipped.append(str(error))
    base, steps = with_a_size(problem, base, steps)
    if not steps:
        structure += proposed.unconfirmed(problem)
    with contextlib.suppress(BudgetSpentError):
        named, (base, held_base, steps) = (
            steps,
            told_from_none(problem, folds, base, held_base, steps, trust=screen.trust(base.noise)),
        )
        base, held_base, steps = without_own_terms(problem, folds, refitted, base, held_base, steps)
        structure = structure if steps or not named else before
    scatter: tuple[RunScatter, ...] = ()
    if steps:
        with contextlib.suppress(BudgetSpentError):
            before_scatter = len(steps)
            base, held_base, steps, scatter = _beside_scatter(problem, folds, base, held_base, steps)
            if len(steps) < before_scatter:  # beside what went, what stays was another effect
                base, held_base, steps = told_from_none(
                    problem, folds, base, held_base, steps, trust=screen.trust(base.noise)
                )
    # Every effect with its values of the last joint fit, not of the step that found it.
    values = {applied.key: applied for applied in base.active}
    steps = [replace(step, active=values[step.active.key]) for step in steps]
    return Search(
        problem=problem,
        folds=folds,
        nominal=nominal,
        refitted=refitted,
        augmented=base,
        steps=tuple(steps),
        structure=structure,
        structure_before=before,
        held_refitted=held_refitted,
        held_augmented=held_base,
        screen=screen,
        scored=scored,
        skipped=tuple(skipped),
        scatter=scatter,
        undecided=undecided,
    )


def _is_nuisance(step: Step, steps: Sequence[Step]) -> bool:
    """Tell whether a step is no physics: input noise, or the point from which a drift or a loop starts."""
    effect = step.active.effect
    if effect.nuisance:
        return True
    if not effect.is_zero:
        return False
    beside = [
        step_before.active for step_before in steps if step_before.active.channel == step.active.channel
    ]
    offset = abs(step.active.values[effect.names[0]])
    return any(
        active.effect.zero_beside is not None and offset <= active.effect.zero_beside(active.values)
        for active in beside
    )


def _stepped(
    problem: Problem, base: Fit, held_base: HeldOut, steps: list[Step]
) -> tuple[Fit, HeldOut, list[Step]]:
    """Add the outputs whose recorded values stand on a coarse lattice."""
    for candidate in candidates(problem):
        name = str(candidate.active.channel)
        if not candidate.active.effect.from_digits or name not in problem.observed:
            continue
        counted = problem.kept[name]
        sd = float(np.std(base.residual[name][counted]))
        lattice = lattice_of(problem.observed[name][np.isfinite(problem.observed[name])], sd)
        if lattice is None:
            continue
        width = candidate.active.effect.names[0]
        origin = {key: value for key, value in candidate.starts[0].values.items() if key == ORIGIN}
        sizes = {width: lattice.step, f"_half_{width}": lattice.half_width}
        active = replace(candidate.active, values=sizes | origin)
        gain = lattice.log_score_gain
        step = Step(
            active=active, p_value=math.exp(-min(gain, 700.0)), held_out_gain=gain, gain=gain, rivals=()
        )
        steps = [*steps, step]
        with_steps = replace_effects(problem, base, (*base.active, active))
        held_out = HeldOut(
            scores=held_base.scores,
            simulated={
                **held_base.simulated,
                name: _rounded(held_base.simulated[name], lattice.step, origin.get(ORIGIN, 0.0)),
            },
            fits=held_base.fits,
        )
        if matters(problem, held_base, held_out, STEP.first):
            held_base = held_out
        base = with_steps
    return base, held_base, steps


def _rounded(values: NDArray[np.float64], step: float, origin: float) -> NDArray[np.float64]:
    return np.asarray(step * np.round((values - origin) / step) + origin)


def _beside_scatter(
    problem: Problem, folds: Folds, base: Fit, held_base: HeldOut, steps: list[Step]
) -> tuple[Fit, HeldOut, list[Step], tuple[RunScatter, ...]]:
    """Return a hypothesis beside zeros and gains that move from run to run.

    An effect of one size of which they leave nothing certain goes: a common zero of runs that each have
    another.
    """
    from scipy.stats import norm

    reach = float(norm.ppf((1 + VERDICT.interval) / 2))
    scattered, scatter = with_run_scatter(problem, base)
    at = len(problem.free)
    for applied in scattered.active if scatter else ():
        own, at = at, at + len(applied.searched)
        sizes = [(i, each) for i, each in enumerate(applied.searched) if each.off is not None]
        listed = [step for step in steps if step.active.key != applied.key]
        if len(sizes) != 1 or applied.runs is not None or len(listed) == len(steps):
            continue
        (i, size) = sizes[0]
        sd = math.sqrt(max(float(scattered.covariance[own + i, own + i]), 0.0))
        if abs(applied.values[size.name] - (size.off or 0.0)) >= reach * sd:
            continue
        try:
            bare = fit(problem, without(base.active, applied), start=base.p)
            scores = hold_out(problem, folds, bare.active, bare)
        except FitError:  # the simulation needs it
            continue
        if not listed:
            return bare, scores, [], scatter
        return _beside_scatter(problem, folds, bare, scores, listed)
    if not scatter:
        return scattered, held_base, steps, scatter
    beside = held_out_beside_scatter(problem, held_base)
    # One step of least squares leads to the values beside a scatter. Of runs that differ by a third of their
    # size it may lead astray: then unseen rows, which it was to serve, are the worse for it.
    if matters(problem, beside, held_base, STEP.later):
        return base, held_base, steps, ()
    return scattered, beside, steps, scatter


def _as_declared(problem: Problem) -> Fit:
    """Return the simulation as declared, its residual and noise, nothing fitted."""
    p = tuple(parameter.value for parameter in problem.free)
    simulated = problem.simulate(p, ())
    residual = {name: problem.observed[name] - simulated[name] for name in simulated}
    layouts = {name: problem.layout(name) for name in problem.names}
    return Fit(
        p=p,
        active=(),
        residual=residual,
        simulated=simulated,
        noise=noise_of(problem, residual, layouts),
        log_posterior=0.0,
        covariance=np.zeros((len(p), len(p))),
        rows=None,
    )
