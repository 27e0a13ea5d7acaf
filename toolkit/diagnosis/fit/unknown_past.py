"""What effects with a memory had seen before the first row, which nobody recorded.

A filter, a bristle, a relaxing tire has a state, and a run that begins in the middle of motion finds it
where what came before has left it. Taken as at rest, it is wrong for the first rows: a few of them, of little
noise, would part effects that thousands of rows do not. So where effects are held against each other, each
has the state at every run's first row that suits it best, as a departure from rest that is normal about none.
So do rows that no fit has seen: what came before a run is not among what other runs could have taught.

A state that fades answers to its beginning in proportion: one column a run, of a length that the effect has
itself. Nothing else of a fit moves with it.

Source: Ljung, System Identification, 1999, 10.1 (estimated initial states of a simulation).
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.fit.noise import whiten
from toolkit.diagnosis.policy import PAST
from toolkit.effects import filters
from toolkit.errors import FitError

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.fit.fit import Fit
    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.effects.applied import AppliedEffect

_FADED = 0.5  # of its largest: what is left of a past at a run's end is a zero, and no past, where it is more
_STEP = 1e-3  # of the range of what a state follows: a difference of simulations in proportion


def past_gain(problem: Problem, made: Fit) -> float:
    """Return by how much a fit is likelier where the states of its effects at every first row are free."""
    responses = past_responses(problem, made)
    if not responses:
        return 0.0
    columns, residual = [], []
    for name in problem.names:
        where = problem.layout(name, made.rows)
        columns.append(whiten(responses[name][where.index], where, made.noise[name]))
        residual.append(whiten(made.residual[name][where.index], where, made.noise[name]))
    response, left = np.vstack(columns), np.concatenate(residual)
    return float(0.5 * left @ taken_by_past(response, left))


def past_responses(problem: Problem, made: Fit) -> dict[str, Array]:
    """Return how every output answers to states at the first rows, (rows, states); {} without a memory."""
    listed = [_responses(problem, made, applied) for applied in made.active if applied.effect.remembers]
    return {name: np.hstack([each[name] for each in listed]) for name in problem.names} if listed else {}


def taken_by_past(response: Array, values: Array) -> Array:
    """Return what states at the first rows take of whitened values, (n,) or (n, columns)."""
    normal = response.T @ response + np.eye(response.shape[1]) / PAST.spread**2
    return np.asarray(response @ np.linalg.solve(normal, response.T @ values))


def _responses(problem: Problem, made: Fit, applied: AppliedEffect) -> dict[str, Array]:
    """Return how every output answers to a state at the first row of each run, (rows, runs)."""
    moved = tuple(
        replace(each, values={**each.values, filters.PAST: _STEP}) if each.key == applied.key else each
        for each in made.active
    )
    responses = {name: np.zeros((problem.rows, len(problem.slices))) for name in problem.names}
    try:
        simulated = problem.simulate(made.p, moved)
    except FitError:
        return responses
    for name, response in responses.items():
        change = (simulated[name] - made.simulated[name]) / _STEP
        for k, rows in enumerate(problem.slices):
            past = np.nan_to_num(change[rows])
            if len(past) and abs(past[-1]) < _FADED * np.abs(past).max():
                response[rows, k] = past
    return responses
