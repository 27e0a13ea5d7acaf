"""The order of planned loads: mounts in turn, each loaded up and then down, against drift and creep.

Least squares takes a drift for a slope where loads rise with time, and creep after a large load for a part of
the next one. Neither needs a term where the order is such that the coefficients do not answer to it.
"""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

import numpy as np

from toolkit.arrays import Array
from toolkit.planning.exchange import Alternatives, best_of, exchanged

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.planning.fixtures import FeasibleLoads

_STARTS = 16


def visits(
    rows: NDArray[np.intp], points: NDArray[np.intp], feasible: FeasibleLoads, up: NDArray[np.bool_]
) -> list[NDArray[np.intp]]:
    """Return the rows of a run by mount, each loaded from the smallest up and then down again.

    No load is reached from below before a mount's loads and from above after them: by itself it has no side.

    ``points`` (rows of the session,) is the candidate of each row, ``up`` (rows,) its direction.
    """
    by_mount: dict[str, list[int]] = {}
    for row in rows.tolist():
        by_mount.setdefault(feasible.mount[points[row]], []).append(row)
    size = feasible.amount[points]
    empty = by_mount.pop("", [])
    if empty:
        by_mount.setdefault(max(by_mount, key=lambda mount: len(by_mount[mount]), default=""), []).extend(
            empty
        )
    return [
        np.array(sorted(group, key=lambda row: (not up[row], size[row] if up[row] else -size[row])))
        for group in by_mount.values()
    ]


def in_order(
    runs: list[list[NDArray[np.intp]]], weights: Array, relative: Array, rng: np.random.Generator
) -> tuple[NDArray[np.intp], Array]:
    """Return the rows of a session in the order that its results answer least to, and what they answer.

    Parameters
    ----------
    runs : of each run its visits, as `visits` makes them
    weights : (results, rows) what a unit error of each row makes of each result
    relative : (results, rows) the load of each row that creeps, by the largest

    The answers (results, 2) are those to a drift of one unit over a run and to a creep of one unit after the
    largest load, the sizes of different runs independent of each other.
    """
    sequences = [_best_order(groups, weights, relative, rng) for groups in runs]
    answers = np.sum([_squares(rows, weights, relative) for rows in sequences], axis=0)
    return np.concatenate(sequences), np.sqrt(answers)


def _best_order(
    groups: list[NDArray[np.intp]], weights: Array, relative: Array, rng: np.random.Generator
) -> NDArray[np.intp]:
    """Return a run's rows by exchange of its visits' places, the best of a few starts."""
    places = range(len(groups))

    @functools.cache  # an exchange comes to most orders by both of the visits that change places
    def answers(order: tuple[int, ...]) -> float:
        return float(_squares(_sequence(groups, order), weights, relative).sum())

    def alternatives(order: tuple[int, ...], place: int) -> Alternatives[tuple[int, ...]]:
        def swapped(other: int) -> tuple[int, ...]:
            swap = {place: order[other], other: order[place]}
            return tuple(swap.get(at, visit) for at, visit in enumerate(order))

        losses = np.array([answers(swapped(other)) for other in places])
        return Alternatives(losses=losses, present=place, design=swapped)

    starts = (tuple(rng.permutation(len(groups)).tolist()) for _ in range(_STARTS if len(groups) > 2 else 1))
    best = best_of(starts, lambda start: exchanged(start, alternatives, lambda: places), answers)
    return _sequence(groups, best)


def _sequence(groups: list[NDArray[np.intp]], order: tuple[int, ...]) -> NDArray[np.intp]:
    return np.concatenate([groups[at] for at in order])


def _squares(rows: NDArray[np.intp], weights: Array, relative: Array) -> Array:
    """Return the squared answers (results, 2) of a run's rows in their order."""
    drift, each = _drift(len(rows)), weights[:, rows]
    creep = np.diff(relative[:, rows], axis=1, prepend=0.0)  # what the load before leaves
    return np.stack([(each @ drift) ** 2, np.sum(each * creep, axis=1) ** 2], axis=1)


@functools.cache
def _drift(count: int) -> Array:
    """Return a drift of one unit over a run (rows,), zero in the mean."""
    drift = np.linspace(-0.5, 0.5, count)
    drift -= drift.mean()
    drift.flags.writeable = False
    return drift
