"""Free simulations without a loop over time: the states of all rows at once, by Newton's method.

A simulation is the solution of ``state at the next row = flow(state at this row)`` for all rows. From a guess
of all states, the flows and their derivatives are found for all rows and sets of parameters in one sweep,
and the linear recursion that remains is quickly solved; a few sweeps lead to the states to far below the
tolerance of the integration. Where the guess is too far off, or the equation too far from smooth, `marching`
goes from row to row.

Source: Kiehl, Parallel Computing 20 (1994) 275 (parallel multiple shooting).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.simulators.integrate import OFF, RTOL
from toolkit.diagnosis.simulators.marching import march
from toolkit.diagnosis.simulators.row_flow import MOST_STEPS, enough, finer

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.diagnosis.case.case import Run
    from toolkit.diagnosis.simulators.row_flow import RowFlow, Rows

    Array = NDArray[np.float64]
    Places = NDArray[np.intp]

_SWEEPS = 15  # a guess that needs more is too far off
_CLOSE = 1e-2  # of the tolerance: a last correction that leaves the next far below it
_SLOW = 0.1  # of the last correction: where one is larger, derivatives are taken anew
_STALLED = 3  # corrections that are no smaller than the last: no way leads on
_FAR = 0.5  # of a state's spread, by which one correction moves it: beyond, the derivatives are others
_STEP = 1e-6  # of a state's size, for differences
_REFINED = 8
_MISSED = 3  # times in turn: terms that are not smooth enough
_MARCHED = 8  # columns: fewer are integrated in less time one by one, by plain numbers


@dataclass(frozen=True, slots=True, eq=False)
class Nodes:
    """A path from node to node: their places in rows, (nodes,), states, (states, sets, nodes), derivatives.

    The flow's derivatives are (nodes - 1, 1, states, states), or none.
    """

    place: Array
    x: Array
    slopes: Array | None


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """States at every row, (states, sets, rows), the steps of every interval, and the path from node to node.

    ``enough`` are the steps that would have done, by their errors: what a simulation near by begins with.
    """

    x: Array
    steps: Places
    nodes: Nodes | None
    enough: Places | None = None


class Guesses:
    """Of which terms in an equation a guess leads to a simulation, so that others are seldom tried.

    One term with a corner says nothing of another, nor parameters far off of those near by: after three
    misses in turn of the same terms a guess waits, for twice as many simulations after every further one.

    A simulation begins with the steps that the last one of its terms would have done with in its run: with
    fewer it would come to rest twice, once for nothing.
    """

    def __init__(self) -> None:
        self._missed: dict[object, int] = {}
        self._waiting: dict[object, int] = {}
        self._enough: dict[Run, tuple[tuple[object, ...], Places]] = {}

    def steps(self, run: Run, terms: tuple[object, ...], fewest: Places | int) -> Places | int:
        """Return the steps of a run's intervals, (rows - 1,), never fewer than the ``fewest``."""
        last, enough = self._enough.get(run, (None, None))
        return fewest if enough is None or last != terms else np.maximum(enough, fewest)

    def did(self, run: Run, terms: tuple[object, ...], enough: Places) -> None:
        """Learn which steps would have done in a run, (rows - 1,)."""
        self._enough[run] = terms, enough

    def are_tried(self, terms: tuple[object, ...]) -> bool:
        """Tell whether the next simulation with such terms is to begin from a guess."""
        waiting = self._waiting.get(terms, 0)
        self._waiting[terms] = max(waiting - 1, 0)
        return not waiting

    def led(self, terms: tuple[object, ...], *, on: bool) -> None:
        """Learn whether a guess has led to a simulation; what the bare equation missed, all terms have."""
        missed = 0 if on else self._missed.get(terms, self._missed.get((), 0)) + 1
        self._missed[terms] = missed
        self._waiting[terms] = 2**missed if missed >= _MISSED else 0


def trajectories(
    flow: RowFlow, guess: Path, sizes: Array, smooth: NDArray[np.bool_]
) -> tuple[Path, NDArray[np.bool_]]:
    """Return the states at every row, and which of the sets were simulated to the end, (sets,).

    A few that no guess leads to are left: alone each of them is sooner done.

    Parameters
    ----------
    guess : the first rows of the runs are their starts; the steps are the fewest; a path near by, or none
    sizes : of the states, for differences, (states,)
    smooth : which sets may come from a guess at all, (sets,)
    """
    x, steps, last = guess.x.copy(), guess.steps, guess.nodes
    rest = np.flatnonzero(smooth)
    for turn in range(_REFINED if len(rest) else 0):
        nodes = flow.parted(steps)
        y, slopes = _begun(x, nodes.rows, flow.rows, last, of_all=turn > 0)
        shares, slopes, solved = _converged(nodes, y, rest, slopes, sizes)
        x, last = y[:, :, nodes.rows.at], Nodes(nodes.rows.place, y, slopes)
        errors = np.maximum.reduceat(shares, nodes.rows.at[:-1], axis=1)
        wanted = finer(steps, errors)
        able = solved & (wanted.max(axis=1) <= MOST_STEPS)  # the others are not waited for
        rest = rest[able]
        if not len(rest) or (errors[able] <= 1).all():
            break
        steps = wanted[able].max(axis=0)
    reached = np.zeros(x.shape[1], dtype=bool)
    reached[rest] = True
    others = np.flatnonzero(~reached)
    if len(others) * len(flow.rows.slices) >= _MARCHED:
        starts = guess.x[:, others][:, :, [at.start for at in flow.rows.slices]]
        x[:, others], reached[others] = march(flow, starts, others)
    if not len(rest) or last is None:
        return Path(x, guess.steps, None), reached
    return Path(x, steps, replace(last, x=last.x[:, rest[:1]]), enough(steps, errors[able])), reached


def _begun(
    x: Array, rows: Rows, recorded: Rows, last: Nodes | None, *, of_all: bool
) -> tuple[Array, Array | None]:
    """Return states at nodes to begin from, and the flow's derivatives near by, if there are any.

    Parameters
    ----------
    x : states at the recorded rows, (states, sets, rows)
    last : states at other nodes: of all the sets, or of one near by, which has the equation's own ones
    """
    place = recorded.place if last is None else last.place
    before = np.clip(np.searchsorted(place, rows.place, side="right") - 1, 0, len(place) - 2)
    share = (rows.place - place[before]) / (place[before + 1] - place[before])

    def between(values: Array) -> Array:
        return values[:, :, before] + share * (values[:, :, before + 1] - values[:, :, before])

    if last is None:
        return between(x), None
    if of_all:
        y = between(last.x)
    else:
        y = np.zeros((*x.shape[:2], len(rows.t)))
        y[: len(last.x)] = between(last.x)
    begun = [at.start for at in rows.slices]
    y[:, :, begun] = x[:, :, [at.start for at in recorded.slices]]
    if last.slopes is None or last.slopes.shape[2] != len(x):
        return y, None
    # Of another length of time the derivatives differ from one by so much more or less.
    longer = np.diff(rows.place) / np.diff(place)[before[:-1]]
    one = np.eye(len(x))
    slopes = one + longer[:, None, None, None] * (last.slopes[before[:-1]] - one)
    slopes[rows.last[:-1]] = 0.0
    return y, slopes


def _converged(
    flow: RowFlow, x: Array, sets: Places, near: Array | None, sizes: Array
) -> tuple[Array, Array | None, NDArray[np.bool_]]:
    """Move the states of some sets to where they follow from each other, in place.

    Parameters
    ----------
    flow : from node to node
    x : states at the nodes, (states, sets, nodes)
    near : the flow's derivatives near by, (nodes - 1, 1, states, states), or none

    Returns
    -------
    errors of each set's steps, (sets, nodes - 1), derivatives of the flow, and which sets came to rest
    """
    errors = np.zeros((len(sets), x.shape[2] - 1))
    active, slopes, kept = np.arange(len(sets)), near, near
    before, missed = np.full(len(sets), np.inf), np.full(len(sets), np.inf)
    stalled = np.zeros(len(sets), dtype=np.intp)
    solved = np.zeros(len(sets), dtype=bool)
    for _ in range(_SWEEPS):
        at = sets[active]
        there = x[:, at]
        ends, shares = flow.on(there, at)
        if slopes is None:
            # At first those of one set stand for all: they are seldom far from each other.
            chosen = slice(0, 1) if kept is None else slice(None)
            slopes = _single_slopes(flow, there[:, chosen], ends[:, chosen], at[chosen], sizes)
            kept = slopes[:, :1] if kept is None or len(active) == len(sets) else kept
        off_rows = ends - there[:, :, 1:]
        moved = recursion(slopes, off_rows)
        size = flow.atol[:, at, None] + RTOL * np.abs(ends)
        off = (np.abs(moved) / size).max(axis=(0, 2))
        usable = np.isfinite(off) & (np.abs(ends) < OFF).all(axis=(0, 2))
        share = _FAR / np.maximum((np.abs(moved) / sizes[:, None, None]).max(axis=(0, 2)), _FAR)
        x[:, at[usable], 1:] += (share[:, None] * moved)[:, usable]
        # As much smaller as a correction is than the last one, the next is than it.
        last = before[active]
        ahead = np.where((off < 1) & (last < np.inf) & (share == 1), off * off / last, off)
        done = usable & (np.minimum(off, ahead) < _CLOSE)
        errors[active[done]] = shares[done]
        solved[active[done]] = True
        fresh = slopes.shape[1] > 1 or len(active) == 1
        miss = np.sqrt(np.mean((off_rows / size) ** 2, axis=(0, 2)))
        stalled[active] += (miss > 0.95 * missed[active]) & fresh & (off > _CLOSE)
        missed[active] = miss
        going = usable & ~done & (stalled[active] < _STALLED)
        slow = bool(((off > _SLOW * before[active]) | (share < 1))[going].any())
        before[active] = off
        if not going.any():
            break
        slopes = None if slow else slopes[:, going] if slopes.shape[1] > 1 else slopes
        active = active[going]
    return errors, kept, solved


def _single_slopes(flow: RowFlow, x: Array, ends: Array, sets: Places, sizes: Array) -> Array:
    """Return the derivatives of the flow from node to node, (nodes - 1, sets, states, states)."""
    n, count = len(x), len(sets)
    moved = np.tile(x, (1, n, 1))
    for i in range(n):
        moved[i, i * count : (i + 1) * count] += _STEP * sizes[i]
    on, _ = flow.on(moved, np.tile(sets, n))
    on = on.reshape(n, n, count, -1) - ends[:, None]
    slopes = (on / (_STEP * sizes)[None, :, None, None]).transpose(3, 2, 0, 1)
    return _within_runs(flow, slopes)


def _within_runs(flow: RowFlow, slopes: Array) -> Array:
    """Return derivatives without those between runs, where nothing flows, and none that is no number."""
    slopes = np.where(np.isfinite(slopes), slopes, 0.0)
    slopes[flow.rows.last[:-1]] = 0.0
    return slopes


def flow_slopes(flow: RowFlow, x: Array, ends: Array, steps: Places, sets: Places, sizes: Array) -> Array:
    """Return the derivatives of the flow at every row, (rows, sets, states, states)."""
    n = len(x)
    slopes = np.empty((len(steps), len(sets), n, n))
    for i in range(n):
        moved = x.copy()
        moved[i] += _STEP * sizes[i]
        on, _ = flow(moved, steps, sets)
        slopes[:, :, :, i] = ((on - ends) / (_STEP * sizes[i])).transpose(2, 1, 0)
    return _within_runs(flow, slopes)


def recursion(slopes: Array, added: Array) -> Array:
    """Return the solution of d[k + 1] = slopes[k] d[k] + added[k] from nothing, without the first.

    The unknowns one behind the other are those of a banded triangular system.

    Parameters
    ----------
    slopes : (rows, sets or 1, states, states)
    added : (states, sets, rows)

    Returns
    -------
    of the shape of ``added``
    """
    from scipy.linalg.lapack import dtbtrs

    n, sets, rows = added.shape
    right = np.ascontiguousarray(added.transpose(1, 2, 0)).reshape(sets, rows * n)
    # Of every column what stands on and under its diagonal.
    band = np.zeros((slopes.shape[1], rows, n, 2 * n))
    for j in range(n):
        band[:, :-1, j, n - j : 2 * n - j] = -slopes[1:, :, :, j].transpose(1, 0, 2)
    solved = np.empty_like(right)
    for k, column in enumerate(band):
        of = slice(k, k + 1) if len(band) > 1 else slice(None)
        solved[of] = dtbtrs(column.reshape(rows * n, 2 * n).T, right[of].T, uplo="L", diag="U")[0].T
    return np.ascontiguousarray(solved.reshape(sets, rows, n).transpose(2, 0, 1))
