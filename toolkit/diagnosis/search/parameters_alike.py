"""The parameter of a simulation that does what an effect does: between the two only its prior decides.

A gain of a sensor is a factor of the equation, and a wrong declaration of the one looks like the other. Where
one parameter, its prior not believed, explains a recording as well as an effect, it is of the effect's class.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.fit.fit import Fit, fit, jacobian, log_prior
from toolkit.diagnosis.fit.folds import hold_out
from toolkit.diagnosis.fit.noise import whiten
from toolkit.diagnosis.policy import LAWS, PRIORS, VERDICT
from toolkit.diagnosis.search.forward_step import ParameterInPlace
from toolkit.diagnosis.search.superfluous import without
from toolkit.diagnosis.search.time_budget import BudgetSpentError
from toolkit.diagnosis.simulators.parameter_units import unit_of
from toolkit.diagnosis.simulators.setting import dimension
from toolkit.errors import FitError

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.fit.folds import Folds, HeldOut
    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.diagnosis.search.forward_step import Step
    from toolkit.diagnosis.search.search import Search
    from toolkit.effects.applied import AppliedEffect


def with_parameters_alike(search: Search) -> Search:
    """Return a search whose steps have the parameter that explains as much in the effect's place."""
    steps = []
    for step in search.steps:
        try:
            found = _alike(search.problem, search.augmented, step.active)
        except (FitError, BudgetSpentError):  # not without the effect, or no time is left to look
            found = None
        steps.append(replace(step, parameter=found))
    return replace(search, steps=tuple(steps))


def without_own_terms(
    problem: Problem, folds: Folds, refitted: Fit, base: Fit, held_base: HeldOut, steps: list[Step]
) -> tuple[Fit, HeldOut, list[Step]]:
    """Return a hypothesis without effects that the simulation has, whose form alone is another there.

    A parameter of an effect's dimension that does what it does, and that the refit leaves where its prior
    believes it, is that effect: nothing is missing. What its form leaves is another matter.
    """
    for step in steps:
        applied = next(each for each in base.active if each.key == step.active.key)
        remaining = without(base.active, applied)
        sizes = [each for each in applied.searched if each.off is not None]
        if len(sizes) != 1 or applied.runs is not None or not problem.declared:
            continue
        try:
            shared = _shared(problem, base, remaining)
            at = int(np.argmax(shared))
            own = unit_of(problem.case, problem.model, applied, sizes[0].name)
            alike = dimension(own) == dimension(problem.free[at].unit) and shared[at] > VERDICT.own
            if not alike or abs(problem.off_priors(refitted.p)[at]) > PRIORS.far:
                continue
            bare = fit(problem, remaining, start=base.p)
            scores = hold_out(problem, folds, bare.active, bare)
        except FitError:  # the simulation needs it
            continue
        listed = [each for each in steps if each is not step]
        return without_own_terms(problem, folds, refitted, bare, scores, listed)
    return base, held_base, steps


def _alike(problem: Problem, base: Fit, applied: AppliedEffect) -> ParameterInPlace | None:
    active = without(base.active, applied)
    if not applied.searched or not problem.declared:
        return None
    at = _nearest(problem, base, active)
    if at is None:
        return None
    free = [
        replace(each, sd=PRIORS.wider * (each.sd or 0.0)) if i == at else each
        for i, each in enumerate(problem.free)
    ]
    released = replace(problem, free=tuple(free))
    made = fit(released, active, start=base.p, plain=base.plain)
    if _likelihood(released, made) < _likelihood(problem, base) - VERDICT.close:
        return None
    if abs(problem.off_priors(made.p)[at]) < PRIORS.far:
        return None
    sd = float(np.sqrt(max(made.covariance[at, at], 0.0)))
    return ParameterInPlace(name=problem.free[at].name, value=made.p[at], sd=sd)


def _nearest(problem: Problem, base: Fit, active: tuple[AppliedEffect, ...]) -> int | None:
    """Return the place of the parameter whose response is most like an effect's; None where none is."""
    shared = _shared(problem, base, active)
    best = int(np.argmax(shared))
    return best if 1 - shared[best] < LAWS.alike else None


def _shared(problem: Problem, base: Fit, active: tuple[AppliedEffect, ...]) -> Array:
    """Return the share of what an effect does that each declared parameter does, (declared,).

    Parameters
    ----------
    active : the effects of the fit but for the one
    """
    bare = problem.simulate(base.p, active)
    columns, _ = jacobian(problem, replace(base, active=active))
    layouts = {name: problem.layout(name) for name in problem.names}
    moved, answers = (
        np.concatenate([whiten(each[name][at.index], at, base.noise[name]) for name, at in layouts.items()])
        for each in (
            {name: (base.simulated[name] - bare[name])[:, None] for name in problem.names},
            {name: columns[name][:, : len(problem.declared)] for name in problem.names},
        )
    )
    sizes = np.sum(moved**2) * np.sum(answers**2, axis=0)
    return np.asarray((moved[:, 0] @ answers) ** 2 / np.maximum(sizes, 1e-300))


def _likelihood(problem: Problem, made: Fit) -> float:
    return made.log_posterior - log_prior(problem, made.p)
