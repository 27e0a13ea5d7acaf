"""Effects that the simulation has: a parameter of it does what they do, and nothing of them is missing."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.fit.fit import fit, jacobian
from toolkit.diagnosis.fit.folds import hold_out
from toolkit.diagnosis.fit.noise import whiten
from toolkit.diagnosis.policy import PRIORS, VERDICT
from toolkit.diagnosis.search.superfluous import without
from toolkit.diagnosis.simulators.parameter_units import unit_of
from toolkit.diagnosis.simulators.setting import dimension
from toolkit.errors import FitError

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.fit.fit import Fit
    from toolkit.diagnosis.fit.folds import Folds, HeldOut
    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.diagnosis.search.forward_step import Step
    from toolkit.effects.applied import AppliedEffect


def without_own_terms(
    problem: Problem, folds: Folds, refitted: Fit, base: Fit, held_base: HeldOut, steps: list[Step]
) -> tuple[Fit, HeldOut, list[Step]]:
    """Return a hypothesis without effects that the simulation has, whose form alone is another there.

    A parameter of an effect's dimension, if it has one, that does what it does, and that the refit leaves
    where its prior believes it, is that effect: nothing is missing. What its form leaves is another matter.
    """
    for step in steps:
        applied = next(each for each in base.active if each.key == step.active.key)
        remaining = without(base.active, applied)
        sizes = [each for each in applied.searched if each.off is not None]
        if len(sizes) != 1 or applied.runs is not None or not problem.declared:
            continue
        try:
            shared = shared_responses(problem, base, remaining)
            at = int(np.argmax(shared))
            own = dimension(unit_of(problem.case, problem.model, applied, sizes[0].name))
            # A ratio is as much a gain's as a share's, and tells nothing.
            alike = own != dimension("1") and own == dimension(problem.free[at].unit)
            alike = alike and shared[at] > VERDICT.own
            if not alike or abs(problem.off_priors(refitted.p)[at]) > PRIORS.far:
                continue
            bare = fit(problem, remaining, start=base.p)
            scores = hold_out(problem, folds, bare.active, bare)
        except FitError:  # the simulation needs it
            continue
        listed = [each for each in steps if each is not step]
        return without_own_terms(problem, folds, refitted, bare, scores, listed)
    return base, held_base, steps


def shared_responses(problem: Problem, base: Fit, active: tuple[AppliedEffect, ...]) -> Array:
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
