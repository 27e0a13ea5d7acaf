"""Free simulations without a loop over time: the states of all rows at once, by Newton's method.

A simulation is the solution of ``state at the next row = flow(state at this row)`` for all rows. From a guess
of all states, the flows and their derivatives are found for all rows and sets of parameters in one sweep,
and the linear recursion that remains is quickly solved; a few sweeps lead to the states to far below the
tolerance of the integration. Where the guess is too far off, or the equation too far from smooth, `marching`
goes from row to row.

Source: Kiehl, Parallel Computing 20 (1994) 275 (parallel multiple shooting).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.simulators.integrate import OFF, RTOL
from toolkit.diagnosis.simulators.marching import march
from toolkit.diagnosis.simulators.row_flow import MOST_STEPS, enough, finer

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.diagnosis.case.case import Run
    from toolkit.diagnosis.simulators.row_flow import RowFlow

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
class Path:
    """States at every row, (states, sets, rows), the steps of every interval, and the flow's derivatives.

    ``enough`` are the steps that would have done, by their errors: what a simulation near by begins with.
    """

    x: Array
    steps: Places
    slopes: Array | None
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
    guess : the first rows of the runs are their starts; the steps are the fewest; derivatives of a path near
        by, or none
    sizes : of the states, for differences, (states,)
    smooth : which sets may come from a guess at all, (sets,)
    """
    x, steps, slopes = guess.x.copy(), guess.steps, guess.slopes
    rest = np.flatnonzero(smooth)
    for _ in range(_REFINED if len(rest) else 0):
        errors, slopes, solved = _converged(flow, x, rest, steps, slopes, sizes)
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
    if not len(rest):
        return Path(x, guess.steps, None), reached
    return Path(x, steps, slopes, enough(steps, errors[able])), reached


def _converged(
    flow: RowFlow, x: Array, sets: Places, steps: Places, near: Array | None, sizes: Array
) -> tuple[Array, Array | None, NDArray[np.bool_]]:
    """Move the states of some sets to where they follow from each other, in place.

    Returns
    -------
    errors of each set's intervals, (sets, rows - 1), derivatives of the flow, and which sets came to rest
    """
    errors = np.zeros((len(sets), len(steps)))
    active, slopes, kept = np.arange(len(sets)), near, near
    before, missed = np.full(len(sets), np.inf), np.full(len(sets), np.inf)
    stalled = np.zeros(len(sets), dtype=np.intp)
    solved = np.zeros(len(sets), dtype=bool)
    for _ in range(_SWEEPS):
        at = sets[active]
        there = x[:, at]
        ends, shares = flow(there, steps, at)
        if slopes is None:
            # At first those of one set stand for all: they are seldom far from each other.
            chosen = slice(0, 1) if kept is None else slice(None)
            slopes = flow_slopes(flow, there[:, chosen], ends[:, chosen], steps, at[chosen], sizes)
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


def flow_slopes(flow: RowFlow, x: Array, ends: Array, steps: Places, sets: Places, sizes: Array) -> Array:
    """Return the derivatives of the flow at every row, (rows, sets, states, states)."""
    n = len(x)
    slopes = np.empty((len(steps), len(sets), n, n))
    for i in range(n):
        moved = x.copy()
        moved[i] += _STEP * sizes[i]
        on, _ = flow(moved, steps, sets)
        slopes[:, :, :, i] = ((on - ends) / (_STEP * sizes[i])).transpose(2, 1, 0)
    slopes[flow.rows.last[:-1]] = 0.0  # a run begins where it begins
    return np.where(np.isfinite(slopes), slopes, 0.0)


def recursion(slopes: Array, added: Array) -> Array:
    """Return the solution of d[k + 1] = slopes[k] d[k] + added[k] from nothing, without the first.

    In blocks that are gone through side by side, and then joined.

    Parameters
    ----------
    slopes : (rows, sets or 1, states, states)
    added : (states, sets, rows)

    Returns
    -------
    of the shape of ``added``
    """
    n, sets, rows = added.shape
    long = max(int(np.sqrt(rows)), 1)
    blocks = -(-rows // long)
    padded = np.zeros((blocks * long, slopes.shape[1], n, n))
    padded[:rows] = slopes
    A = padded.reshape(blocks, long, *padded.shape[1:])
    b = np.zeros((blocks * long, sets, n, 1))
    b[:rows, :, :, 0] = added.transpose(2, 1, 0)
    b = b.reshape(blocks, long, sets, n, 1)
    ways, alone = np.empty_like(A), np.empty_like(b)
    ways[:, 0], alone[:, 0] = A[:, 0], b[:, 0]
    for k in range(1, long):
        np.matmul(A[:, k], ways[:, k - 1], out=ways[:, k])
        alone[:, k] = A[:, k] @ alone[:, k - 1] + b[:, k]
    begun = np.zeros((blocks, 1, sets, n, 1))
    for k in range(1, blocks):
        begun[k] = ways[k - 1, -1] @ begun[k - 1] + alone[k - 1, -1]
    solved = (ways @ begun + alone).reshape(blocks * long, sets, n)[:rows]
    return np.ascontiguousarray(solved.transpose(2, 1, 0))
