"""What many small forces would each do to a motion: linear responses about one simulation.

A force that repeats with the position has a period that a search cannot guess: between two trial periods
the response is another one altogether. Hundreds of them are affordable where the equation is linearised once
about its simulated motion and all forces are propagated together.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from toolkit.arrays import Array

    RatesAt = Callable[[Array, Array], Array]

_STEP = 1e-6  # of a state's size, for differences


def propagated(
    rates_at: RatesAt,
    t: Array,
    x: Array,
    pushes: Array,
    *,
    at: int,
    sizes: Array,
) -> Array:
    """Return how the states move under small additions to one state's rate, (times, states, forces).

    The trapezoidal rule on the equation linearised about ``x``: stable at any step, of second order.

    Parameters
    ----------
    rates_at : (times (m,), states (n, m)) -> their rates, with what acts already
    t : rising times [s], (times,), several to each row of a recording
    x : the simulated states, (states, times)
    pushes : additions to the rate, (times, forces)
    at : the state whose rate they enter
    sizes : of the states, for differences, (states,)
    """
    n, count = x.shape
    slopes = np.empty((count, n, n))
    rates = rates_at(t, x)
    for i in range(n):
        moved = x.copy()
        moved[i] += _STEP * sizes[i]
        slopes[:, :, i] = ((rates_at(t, moved) - rates) / (_STEP * sizes[i])).T
    half = 0.5 * np.diff(t)[:, None, None]
    ahead = np.eye(n) - half * slopes[1:]
    on = np.linalg.solve(ahead, np.eye(n) + half * slopes[:-1])
    entry = np.zeros((count - 1, n, 1))
    entry[:, at, 0] = half[:, 0, 0]
    entry = np.linalg.solve(ahead, entry)
    sums = pushes[1:] + pushes[:-1]
    responses = np.zeros((count, n, pushes.shape[1]))
    for k in range(count - 1):
        responses[k + 1] = on[k] @ responses[k] + entry[k] * sums[k]
    return responses


def integrated(t: Array, pushes: Array) -> Array:
    """Return the integral over time of every column, by the trapezoidal rule from zero, (times, forces)."""
    steps = 0.5 * np.diff(t)[:, None] * (pushes[1:] + pushes[:-1])
    return np.concatenate([np.zeros((1, pushes.shape[1])), np.cumsum(steps, axis=0)])
