"""Free simulations side by side, each with steps of its own: for what turns, stops or runs against a limit.

A column for each set of parameters and run goes from row to row as `integrate` does with one state; the price
of a step hardly grows with the number of columns, and none waits for the short steps of another.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.simulators.integrate import MANY, OFF, TURNING
from toolkit.diagnosis.simulators.row_flow import stepped

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.diagnosis.simulators.row_flow import RowFlow

    Array = NDArray[np.float64]
    Places = NDArray[np.intp]


def march(flow: RowFlow, starts: Array, sets: Places) -> tuple[Array, NDArray[np.bool_]]:
    """Return the states at every row, (states, sets, rows), and which of the sets came to the end, (sets,).

    A set that turns stiff or runs off does not.

    Parameters
    ----------
    starts : states at the first row of every run, (states, sets, runs)
    sets : which sets of the flow they are
    """
    rows, t = flow.rows, flow.rows.t
    n, count, runs = starts.shape
    x = np.full((n, count, len(t)), np.nan)
    begun = np.array([at.start for at in rows.slices])
    x[:, :, begun] = starts
    # Of every column: its set, the row that it comes from, the row at which it ends, its time and step.
    of, at = np.repeat(np.arange(count), runs), np.tile(begun, count)
    end, y = np.tile(rows.last, count), starts.reshape(n, -1).copy()
    now, h, tries = t[at], t[at + 1] - t[at], np.zeros(len(at), dtype=np.intp)
    columns = flow.columns(at, sets[of])
    first = flow.equation(at, columns)(0.0, y)
    reached = np.ones(count, dtype=bool)
    free = np.zeros(len(at), dtype=bool)  # a body has turned in the step that is tried again
    while len(of):
        rates, bristles = flow.equation(at, columns), columns.acting.bristles
        to, interval = t[at + 1], t[at + 1] - t[at]
        last = now + h >= to - 1e-12 * np.maximum(np.abs(to), h)
        h = np.where(last, to - now, h)
        on = [moving & ~free[held] for moving, held in zip(bristles.moving(y), bristles.columns, strict=True)]
        z, rate, error, turned = stepped(
            rates, y, first, h, (now - t[at]) / interval, h / interval, columns.atol, bristles, on
        )
        again = np.zeros(len(of), dtype=bool)
        for turns, held in zip(turned, bristles.columns, strict=True):
            again[held[turns]] = True
        good = np.isfinite(error)
        taken = good & (error <= 1) & ~again
        grow = np.where(good, np.clip(0.9 * np.maximum(error, 1e-30) ** -0.2, 0.2, 5.0), 0.2)
        y, first = np.where(taken, z, y), np.where(taken, rate, first)
        now = np.where(taken, np.where(last, to, now + h), now)
        h = np.where(again, h, h * grow)
        free = (free | again) & ~taken
        there = taken & last
        x[:, of[there], at[there] + 1] = y[:, there]
        at = np.where(there, at + 1, at)
        tries = np.where(there, 0, tries + 1)
        lost = (tries > (TURNING if bristles else MANY)) | ~(np.abs(y) < OFF).all(axis=0)
        if lost.any():
            reached[of[lost]] = False
        going = (at < end) & reached[of]
        if not going.all():
            of, at, end, tries = of[going], at[going], end[going], tries[going]
            now, h, free = now[going], h[going], free[going]
            y, first = y[:, going], first[:, going]
            columns = flow.columns(at, sets[of])
    return x, reached
