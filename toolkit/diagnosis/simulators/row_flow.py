"""The flow of an equation from each row to the next, for all rows and sets of parameters in one sweep.

A right-hand side that takes columns takes the states of all rows as readily as those of several sets. Within
an interval the inputs are linear and the equation is smooth, so that a few steps of Dormand and Prince's pair
lead from row to row; how many, each interval's own error says.

Source: Dormand, Prince, J. Comp. Appl. Math. 6 (1980) 19.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.simulators.integrate import RTOL, A, B, C, E
from toolkit.effects.law import TIME

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.diagnosis.case.case import Run
    from toolkit.diagnosis.simulators.columnwise import Columnwise
    from toolkit.diagnosis.simulators.forces import Acting, ForcesTogether
    from toolkit.diagnosis.simulators.sliding_friction import Held

    Array = NDArray[np.float64]
    Places = NDArray[np.intp]
    Rates = Callable[[float | Array, Array], Array]

MOST_STEPS = 64  # from one row to the next: where an equation asks for more, all rows would wait for one
_SAFE = 1.1
_ROWS, _WEIGHTS, _ERROR = tuple(np.array(row) for row in A), np.array(B), np.array(E)


class Rows:
    """The rows of several runs one behind the other; between two runs nothing flows.

    ``t``, ``u`` (rows,); ``run`` is the place of every row's run; ``last`` are the last rows of the runs.
    Nodes are rows with others between them: ``at`` are the places of the recorded rows among them, ``place``
    where each of them is, in recorded rows.
    """

    def __init__(self, runs: Sequence[Run], drivers: Sequence[str]) -> None:
        self.t = np.concatenate([run.t for run in runs])
        self.u = {name: np.concatenate([run.columns[name] for run in runs]) for name in drivers}
        counts = [run.rows for run in runs]
        self.run = np.repeat(np.arange(len(runs)), counts)
        self.last = np.cumsum(counts) - 1
        self.slices = tuple(
            slice(int(end) + 1 - count, int(end) + 1) for end, count in zip(self.last, counts, strict=True)
        )
        self.at, self.place = np.arange(len(self.t)), np.arange(len(self.t), dtype=np.float64)

    def parted(self, steps: Places) -> Rows:
        """Return the rows with nodes between them, one for every step of an interval but the last.

        Parameters
        ----------
        steps : of every interval, (rows - 1,); of one between two runs nothing is asked
        """
        counts = steps.copy()
        counts[self.last[:-1]] = 1
        nodes, at = copy(self), np.concatenate([[0], np.cumsum(counts)])
        row = np.repeat(np.arange(len(steps)), counts)
        share = (np.arange(len(row)) - at[row]) / counts[row]

        def between(column: Array) -> Array:
            return np.append(column[row] + share * (column[row + 1] - column[row]), column[-1])

        nodes.t, nodes.u = between(self.t), {name: between(column) for name, column in self.u.items()}
        nodes.run, nodes.last = np.append(self.run[row], self.run[-1]), at[self.last]
        nodes.slices = tuple(slice(int(at[of.start]), int(at[of.stop - 1]) + 1) for of in self.slices)
        nodes.at, nodes.place = at, np.append(row + share, float(len(steps)))
        return nodes


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """Parameters, forces and tolerances of columns of states."""

    p: Mapping[str, Array]
    acting: Acting
    atol: Array


class RowFlow:
    """From the states of rows to those of the next rows, with what the steps leave as a share of tolerance.

    Parameters
    ----------
    rhs : the equation's own, for columns
    p : of every set, each (sets,)
    forces : what enters the equation beside its own terms, of every set and run
    atol : of every state, the forces' among them, in every set, (states, sets)
    """

    def __init__(
        self, rhs: Columnwise, rows: Rows, p: Mapping[str, Array], forces: ForcesTogether, atol: Array
    ) -> None:
        self._rhs, self.rows, self._p, self._forces = rhs, rows, p, forces
        self.atol = atol
        self._single: dict[bytes, _Stretch] = {}

    def parted(self, steps: Places) -> RowFlow:
        """Return the flow from node to node, each in a single step, in place of steps one after the other."""
        return RowFlow(self._rhs, self.rows.parted(steps), self._p, self._forces, self.atol)

    def on(self, x: Array, sets: Places) -> tuple[Array, Array]:
        """Return what a call with a single step of every interval returns; sets that come again cost less."""
        rows, key = self.rows, sets.tobytes()
        if key not in self._single:
            self._single[key] = self._stretch(np.delete(np.arange(len(rows.t) - 1), rows.last[:-1]), sets)
        stretch = self._single[key]
        if len(rows.last) == 1:
            end, error = _led(x[:, :, :-1], stretch, 1)
            return end.reshape(x[:, :, 1:].shape), error.reshape(len(sets), -1)
        ends, errors = x[:, :, 1:].copy(), np.zeros((x.shape[1], x.shape[2] - 1))
        end, error = _led(x.take(stretch.at, axis=2), stretch, 1)
        _put(ends, stretch.at, end)
        _put(errors, stretch.at, error)
        return ends, errors

    def __call__(self, x: Array, steps: Places, sets: Places) -> tuple[Array, Array]:
        """Return the states one row on, and the largest error of a step as a share of what is allowed.

        Parameters
        ----------
        x : states at the rows, (states, sets, rows); the last rows of the runs are not led on
        steps : of every interval, (rows - 1,)
        sets : which of the sets the columns of ``x`` are

        Returns
        -------
        states (states, sets, rows - 1), errors (sets, rows - 1)
        """
        ends, errors = x[:, :, 1:].copy(), np.zeros((x.shape[1], x.shape[2] - 1))
        flows = np.ones(len(steps), dtype=bool)
        flows[self.rows.last[:-1]] = False
        for count in np.unique(steps[flows]).tolist():
            at = np.flatnonzero(flows & (steps == count))
            end, error = _led(x.take(at, axis=2), self._stretch(at, sets), count)
            _put(ends, at, end)
            _put(errors, at, error)
        return ends, errors

    def columns(self, places: Places, sets: Places) -> Columns:
        """Return what does not change along columns: row and set of each, (m,), the row for its run."""
        p = {name: values[sets] for name, values in self._p.items()}
        return Columns(p, self._forces.on(sets, self.rows.run[places]), self.atol.take(sets, axis=1))

    def equation(self, places: Places, columns: Columns) -> Rates:
        """Return (share of the way to the next row, states) -> rates; the share is a number or (m,).

        Parameters
        ----------
        places : row of every column, (m,)
        """
        rows, own, acting = self.rows, self._forces.own, columns.acting
        t, step = rows.t[places], rows.t[places + 1] - rows.t[places]
        u = [(name, column[places], column[places + 1] - column[places]) for name, column in rows.u.items()]

        def rates(w: float | Array, y: Array) -> Array:
            inputs = {name: value + w * rise for name, value, rise in u}
            if not acting and len(y) == own:
                return self._rhs(t + w * step, y.copy(), inputs, columns.p)
            rate = np.zeros_like(y)
            rate[:own] = self._rhs(t + w * step, y[:own].copy(), inputs, columns.p)
            acting.add(y, rate, {**inputs, TIME: t + w * step})
            return rate

        return rates

    def _stretch(self, at: Places, sets: Places) -> _Stretch:
        places = np.tile(at, len(sets))
        columns = self.columns(places, np.repeat(sets, len(at)))
        length = self.rows.t[places + 1] - self.rows.t[places]
        return _Stretch(at, columns, self.equation(places, columns), length)


@dataclass(frozen=True, slots=True, eq=False)
class _Stretch:
    """Rows of sets that are led on together: what does not change on the way to the next rows."""

    at: Places
    columns: Columns
    rates: Rates
    length: Array


def _put(whole: Array, at: Places, part: Array) -> None:
    """Put rows into the last axis, in place: line by line takes a tenth of the time of an index over all."""
    lines = whole.reshape(-1, whole.shape[-1])
    for line, values in zip(lines, part.reshape(len(lines), -1), strict=True):
        line[at] = values


def _led(x: Array, on: _Stretch, count: int) -> tuple[Array, Array]:
    """Return states and errors after ``count`` steps to the next rows, a column for each set and row.

    Parameters
    ----------
    x : states at the rows of the stretch, (states, sets, rows)
    """
    y = x.reshape(len(x), -1)
    rates, bristles, atol = on.rates, on.columns.acting.bristles, on.columns.atol
    h, worst, first = on.length / count, np.zeros(y.shape[1]), rates(0.0, y)
    for i in range(count):
        free = np.zeros(y.shape[1], dtype=bool)
        while True:
            held = bristles.held(y, first, free)
            z, last, share = stepped(rates, y, first, h, i / count, 1 / count, atol, held)
            if not any(slide.turned.any() for slide in held.slides):
                break
            for slide in held.slides:
                free[slide.leads] |= slide.turned
        y, first = z, last
        np.maximum(worst, share, out=worst)
    return y, worst


def stepped(
    rates: Rates,
    y: Array,
    first: Array,
    h: Array,
    w: float | Array,
    width: float | Array,
    atol: Array,
    held: Held,
) -> tuple[Array, Array, Array]:
    """Return state and rate after a step, and its error as a share of what is allowed.

    Parameters
    ----------
    y, first : states and their rates at its beginning, (states, columns)
    h : its length [s], (columns,)
    w, width : where it begins, and its length, as shares of the way from row to row
    held : the bends of bristles, which note where a body turns
    """
    k = np.empty((7, y.size))
    k[0] = first.ravel()
    for j, (c, row) in enumerate(zip(C, _ROWS, strict=True), start=1):
        z = y + h * (row @ k[:j]).reshape(y.shape)
        held.set(z, c * h)
        k[j] = rates(w + c * width, z).ravel()
    z = y + h * (_WEIGHTS @ k[:6]).reshape(y.shape)
    held.set(z, h)
    k[6] = rates(w + width, z).ravel()
    share = h * (_ERROR @ k).reshape(y.shape) / (atol + RTOL * np.maximum(np.abs(y), np.abs(z)))
    held.known(share)
    return z, k[6].reshape(y.shape), np.sqrt(np.mean(share**2, axis=0))


def finer(steps: Places, errors: Array) -> Places:
    """Return the steps of every interval by its errors, (sets, rows): a power of two, never fewer.

    Parameters
    ----------
    steps : so far, (rows,)
    errors : of every set, (sets, rows)
    """
    return np.where(errors > 1, np.maximum(_by_errors(steps, errors), 2 * steps), steps)


def enough(steps: Places, errors: Array) -> Places:
    """Return the steps of every interval that would have done for all sets, (rows,): a power of two.

    Parameters
    ----------
    steps : that were taken, (rows,)
    errors : that they left of every set, (sets, rows)
    """
    return np.minimum(steps, _by_errors(steps, errors.max(axis=0)))


def _by_errors(steps: Places, errors: Array) -> Places:
    wanted = steps * _SAFE * np.maximum(errors, 1e-30) ** 0.2
    return np.exp2(np.ceil(np.log2(np.maximum(wanted, 1.0)))).astype(np.intp)
