"""The parameter of a simulation that does what an effect does: between the two only its prior decides.

A gain of a sensor is a factor of the equation, and a wrong declaration of the one looks like the other. Where
one parameter, its prior not believed, explains a recording as well as an effect, it is of the effect's class.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.fit.fit import Fit, fit, log_prior
from toolkit.diagnosis.policy import LAWS, PRIORS, VERDICT
from toolkit.diagnosis.search.forward_step import ParameterInPlace
from toolkit.diagnosis.search.own_terms import shared_responses
from toolkit.diagnosis.search.superfluous import without
from toolkit.diagnosis.search.time_budget import BudgetSpentError
from toolkit.errors import FitError

if TYPE_CHECKING:
    from toolkit.diagnosis.fit.problem import Problem
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
    shared = shared_responses(problem, base, active)
    best = int(np.argmax(shared))
    return best if 1 - shared[best] < LAWS.alike else None


def _likelihood(problem: Problem, made: Fit) -> float:
    return made.log_posterior - log_prior(problem, made.p)
