"""The search: forward steps of joint fits, judged on held-out runs and against the whole search's null."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.fit.fit import Fit, fit, noise_of, replace_effects
from toolkit.diagnosis.fit.folds import Folds, HeldOut, folds_of, hold_out, matters
from toolkit.diagnosis.fit.nuisance import INPUT_NOISE
from toolkit.diagnosis.fit.problem import Problem, without_outliers
from toolkit.diagnosis.policy import STEP
from toolkit.diagnosis.search.candidates import candidates
from toolkit.diagnosis.search.forward_step import Step, best_step, joint_fits, place, step_groups
from toolkit.diagnosis.search.lattice import lattice_of
from toolkit.diagnosis.search.nuisance_refit import refined, without
from toolkit.diagnosis.search.screen import LinearisedFit, Scored
from toolkit.diagnosis.search.screen_step import look, masked
from toolkit.diagnosis.search.time_budget import BudgetSpentError, TimeBudget
from toolkit.diagnosis.search.unexplained import StructureFound, remainder
from toolkit.errors import FitError

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Search:
    """What a search has found, with the fits that show it."""

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

    def variance(self, at: int) -> float:
        """Return the variance of a parameter of the augmented fit, by its place among them.

        What a short series leaves open of its noise's colour widens it as it shortens a gain.
        """
        made = self.augmented
        return float(made.covariance[at, at]) / self.screen.trust(made.noise)


def search(problem: Problem, *, seed: int, budget: TimeBudget) -> Search:
    """Search for what a simulation leaves out.

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
    folds = folds_of(problem, refitted)
    listed = candidates(problem)
    skipped: list[str] = []
    steps: list[Step] = []
    base = refitted
    held_base = held_refitted = hold_out(problem, folds, (), refitted)
    screen = LinearisedFit.of(problem, base)
    scored: tuple[Scored, ...] = ()
    before: tuple[StructureFound, ...] = ()
    structure: tuple[StructureFound, ...] = ()
    try:
        for turn in range(STEP.most_effects + 1):
            budget.check(f"step {turn + 1}: screening {len(listed)} candidates")
            seen = look(problem, base, listed, turn=turn, seed=seed + turn)
            screen, scored = seen.screen, seen.scored
            budget.check(f"step {turn + 1}: structure of the residual")
            structure = remainder(problem, screen, base, seed + 100 + turn)
            if turn == 0:
                before = structure
            if turn == STEP.most_effects:
                break
            found = None
            hidden = masked(problem, base, seen.left) if seen.significant else frozenset()
            for promising, least in step_groups(seen.significant, hidden, STEP.later if turn else STEP.first):
                told = ", ".join(dict.fromkeys(one.candidate.name for one in promising))
                budget.check(f"step {turn + 1}: joint fits of {told}")
                joint = joint_fits(problem, base, promising)
                found = best_step(problem, folds, base, held_base, joint, seen.p_of, least, held_refitted)
                if found is not None:
                    break
            if found is None:
                break
            base, held_base, step = found
            if not _is_nuisance(step, steps):
                steps.append(step)
        base, held_base = refined(problem, folds, base, held_base, listed)
        base, held_base, steps = _stepped(problem, base, held_base, steps)
        if len(steps) > 1:
            budget.check("swaps")
            base, held_base, steps = _pruned(problem, folds, base, held_base, steps)
    except BudgetSpentError as error:
        skipped.append(str(error))
    base, steps = _with_a_size(problem, base, steps)
    # Every effect with its values of the last joint fit, not of the step that found it.
    values = {place(one): one for one in base.active}
    steps = [replace(one, active=values[place(one.active)]) for one in steps]
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
    )


def _is_nuisance(step: Step, steps: Sequence[Step]) -> bool:
    """Tell whether a step is no physics: input noise, or the point from which a drift or a loop starts."""
    if step.active.effect.name == INPUT_NOISE.name:
        return True
    if step.active.effect.name != "zero_offset":
        return False
    beside = [one.active for one in steps if one.active.channel == step.active.channel]
    offset = abs(step.active.values["offset"])
    return any(
        one.effect.name in ("thermal_drift", "zero_drift")
        # Where in its loop a channel stands at first depends on what came before the recording.
        or (one.effect.name == "hysteresis" and offset <= STEP.loop_offset * one.values["width"])
        for one in beside
    )


def _stepped(
    problem: Problem, base: Fit, held_base: HeldOut, steps: list[Step]
) -> tuple[Fit, HeldOut, list[Step]]:
    """Add the outputs whose recorded values stand on a coarse lattice."""
    for candidate in candidates(problem):
        name = str(candidate.active.channel)
        if candidate.name != "quantisation" or name not in problem.observed:
            continue
        kept = problem.kept[name]
        sd = float(np.std(base.residual[name][kept]))
        found = lattice_of(problem.observed[name][np.isfinite(problem.observed[name])], sd)
        if found is None:
            continue
        active = replace(candidate.active, values={"step": found.step, "_half_step": found.half_width})
        gain = found.log_score_gain
        made = Step(
            active=active, p_value=math.exp(-min(gain, 700.0)), held_out_gain=gain, gain=gain, rivals=()
        )
        steps = [*steps, made]
        with_steps = replace_effects(problem, base, (*base.active, active))
        held = HeldOut(
            scores=held_base.scores,
            simulated={**held_base.simulated, name: _rounded(held_base.simulated[name], found.step)},
            fits=held_base.fits,
        )
        if matters(problem, held_base, held, STEP.first):
            held_base = held
        base = with_steps
    return base, held_base, steps


def _rounded(values: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    return np.asarray(step * np.round(values / step))


def _pruned(
    problem: Problem, folds: Folds, base: Fit, held_base: HeldOut, steps: list[Step]
) -> tuple[Fit, HeldOut, list[Step]]:
    """Drop effects that the later ones made superfluous: without them the held-out score is as good."""
    for i in range(len(steps) - 1):
        if len(base.active) < 2:
            break
        rest = without(base.active, steps[i].active)
        try:
            made = fit(problem, rest, start=base.p)
            held = hold_out(problem, folds, made.active, made)
        except FitError:  # what is left cannot be simulated: the effect is needed
            continue
        if held_base.total - held.total < STEP.least_gain:
            base, held_base = made, held
            kept = {place(one) for one in rest}
            steps = [one for one in steps if place(one.active) in kept]
            return _pruned(problem, folds, base, held_base, steps)
    return base, held_base, steps


def _with_a_size(problem: Problem, base: Fit, steps: list[Step]) -> tuple[Fit, list[Step]]:
    """Return a hypothesis without effects that a later one left nothing to do."""
    for step in steps:
        rest = without(base.active, step.active)
        try:
            bare = problem.simulate(base.p, rest)
        except (FitError, BudgetSpentError):  # the simulation needs it, or there is no time to look
            continue
        moved = {name: one - bare[name] for name, one in base.simulated.items()}
        if all(
            float(np.abs(one[problem.kept[name]]).max(initial=0.0))
            < STEP.visible * base.noise[name].marginal_sd
            for name, one in moved.items()
        ):
            kept = {place(one) for one in rest}
            left = [one for one in steps if place(one.active) in kept]
            return _with_a_size(problem, replace_effects(problem, base, rest), left)
    return base, steps


def _as_declared(problem: Problem) -> Fit:
    """Return the simulation as declared, its residual and noise, nothing fitted."""
    p = tuple(one.value for one in problem.free)
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
