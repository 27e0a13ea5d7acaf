"""Which known effects a law is like: by its response over what was recorded, and the best that each can do.

An effect of the catalogue is fitted to what the law adds to the simulation. What is left of it, over what
there was, is the distance: 0 of a law that is the effect in other words, 1 of one that has nothing of it.
Constants of runs count for nothing, and neither does what the parameters of the simulation make up for: a law
may be an effect counted from another zero. Whether the effect stands was asked before, and is not asked here.
"""

from __future__ import annotations

import contextlib
import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.policy import LAWS
from toolkit.diagnosis.search.forward_step import joint_fit
from toolkit.diagnosis.search.time_budget import BudgetSpentError, TimeBudget
from toolkit.errors import FitError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from toolkit.arrays import Array
    from toolkit.diagnosis.fit.fit import Fit
    from toolkit.diagnosis.fit.problem import Problem, Stacked
    from toolkit.diagnosis.law.learn import Laws
    from toolkit.diagnosis.search.screen import LinearisedFit, Scored
    from toolkit.diagnosis.search.search import Search
    from toolkit.effects.applied import AppliedEffect


def with_resemblances(search: Search, laws: Laws, budget: TimeBudget) -> Laws:
    """Return the laws of an answer with the known effects that each is like; once, when all are known."""
    listed = list(laws.listed)
    active = {applied.key for applied in laws.fit.active}
    with contextlib.suppress(BudgetSpentError):
        for at, law in enumerate(listed):
            if law.applied.key in active:
                budget.check(f"known effects that law {at + 1} is like")
                near = resembling(search.problem, search.screen, search.scored, laws.fit, law.applied)
                listed[at] = replace(law, resembles=near)
    return replace(laws, listed=tuple(listed))


def resembling(
    problem: Problem, screen: LinearisedFit, scored: Sequence[Scored], made: Fit, law: AppliedEffect
) -> tuple[tuple[str, float], ...]:
    """Return known effects that are like a law, the nearest first, with their distance.

    Parameters
    ----------
    scored : every candidate and start, with its responses
    made : the fit with the law in it
    """
    others = tuple(applied for applied in made.active if applied.key != law.key)
    try:
        bare = replace(made, active=others, simulated=problem.simulate(made.p, others))
    except FitError:  # without the law it does not run
        return ()
    added = {name: made.simulated[name] - bare.simulated[name] for name in problem.names}
    told = replace(problem, observed=dict(made.simulated))
    start = _away(problem, screen, added)
    whole = float(start @ start)
    if not whole > 0:
        return ()
    distances: dict[str, float] = {}
    for trial in _likely(problem, screen, scored, start):
        fitted = joint_fit(told, bare, (trial.active,), plain=True)
        if fitted is None:
            continue
        left = {name: made.simulated[name] - fitted.simulated[name] for name in problem.names}
        away = _away(problem, screen, left)
        distance = math.sqrt(min(1.0, float(away @ away) / whole))
        name = trial.active.effect.name
        distances[name] = min(distance, distances.get(name, 1.0))
    near = sorted(((distance, name) for name, distance in distances.items() if distance < LAWS.alike))
    return tuple((name, distance) for distance, name in near[: LAWS.resembling])


def _likely(problem: Problem, screen: LinearisedFit, scored: Sequence[Scored], added: Array) -> list[Scored]:
    """Return candidates whose linear responses leave the least of what a law adds, by their best start."""
    best: dict[str, tuple[float, Scored]] = {}
    for trial in scored:
        if trial.active.effect.nuisance or trial.active.runs is not None:
            continue
        width = next(iter(trial.directions.values())).shape[1]
        columns = np.stack(
            [
                _away(problem, screen, {name: values[:, k] for name, values in trial.directions.items()})
                for k in range(width)
            ],
            axis=1,
        )
        if not np.isfinite(columns).all():
            continue
        solution = np.linalg.lstsq(columns, added, rcond=1e-9)[0]
        left = float(np.sum((added - columns @ solution) ** 2))
        name = trial.active.effect.name
        if name not in best or left < best[name][0]:
            best[name] = (left, replace(trial, active=_of_either_sign(trial.reached(solution.tolist()))))
    ranked = sorted(best.values(), key=lambda entry: entry[0])
    return [trial for _, trial in ranked[: LAWS.fitted]]


def _of_either_sign(applied: AppliedEffect) -> AppliedEffect:
    """Return an effect that may be turned round: a loop run the other way is like a loop."""
    effect = applied.effect
    parameters = tuple(
        replace(parameter, bounds=(-parameter.bounds[1], parameter.bounds[1]))
        if parameter.off == parameter.bounds[0] == 0.0 and parameter.unit != "s"
        else parameter
        for parameter in effect.parameters
    )
    return replace(applied, effect=replace(effect, parameters=parameters))


def _away(problem: Problem, screen: LinearisedFit, columns: Stacked) -> Array:
    """Return responses of all outputs less each run's constant and what the simulation's parameters take."""

    def stacked(of: Stacked) -> Array:
        parts = []
        for name, kept in problem.kept.items():
            spread = float(np.std(problem.observed[name][kept])) if kept.any() else 0.0
            for rows in problem.slices:
                part = of[name][rows][kept[rows]]
                parts.append((part - part.mean(axis=0)) / (spread or 1.0) if len(part) else part)
        return np.concatenate(parts)

    values = stacked(columns)
    if not screen.sizes.size:
        return values
    nominal = stacked(screen.columns)[:, : len(problem.free)]
    return np.asarray(values - nominal @ np.linalg.lstsq(nominal, values, rcond=1e-9)[0])
