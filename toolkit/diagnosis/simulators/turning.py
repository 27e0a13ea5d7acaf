"""Simulations that turn, stop or run against a limit, all rows at once, from one that is known.

As `trajectories` has it for smooth equations: the states of all rows are led on to the next rows, each in
steps of its own, and a linear recursion corrects them until they follow from each other. From a known
simulation near by that takes a few sweeps, in which thousands of states march some twenty steps, where one
state would go thousands of steps from row to row.

Derivatives by differences take a simulation for each parameter. Next to a known one they are the first
correction: of every row, what a change of the state and of each parameter makes of the next row, in the steps
of the known one; free of what each simulation's own steps would leave.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.simulators.forces import ForcesTogether
from toolkit.diagnosis.simulators.integrate import OFF, RTOL
from toolkit.diagnosis.simulators.marching import flows, neighbours_on
from toolkit.diagnosis.simulators.row_flow import RowFlow, Rows
from toolkit.diagnosis.simulators.run_starts import in_columns
from toolkit.diagnosis.simulators.trajectory import recursion
from toolkit.diagnosis.simulators.user_code import silenced

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.arrays import Array
    from toolkit.diagnosis.case.case import Run
    from toolkit.diagnosis.simulators.forces import Forces
    from toolkit.diagnosis.simulators.ode_responses import IntegratedModel
    from toolkit.effects.applied import AppliedEffect

    Mask = NDArray[np.bool_]
    Point = tuple[Mapping[str, float], Sequence[AppliedEffect]]

_STEP = 1e-6  # of a state's size, for differences
_NEAR = 1e-2  # of a state's spread: the square of more shows
_SWEEPS = 10  # a guess that needs more is too far off
_SLOW = 0.2  # of the last correction: where one is larger, derivatives are taken anew
_FAR = 2.0  # of a state's spread: by no correction near a known simulation is it moved as far


class Turning:
    """The last simulations of a model that turned, by the runs and by what makes them turn."""

    def __init__(self, model: IntegratedModel) -> None:
        self._model = model
        self._paths: dict[
            object, tuple[Array, Array | None]
        ] = {}  # states (states, rows), flow's derivatives

    def solved(self, runs: Sequence[Run], listed: Sequence[Point]) -> tuple[list[Array], Mask]:
        """Return the states of sets in every run, (states, sets, rows), and which came to the end, (sets,).

        None does that is smooth, turns otherwise than the first, or is nowhere near what is known: there are
        better ways for it.
        """
        model, own = self._model, len(self._model.states)
        reached = np.zeros(len(listed), dtype=bool)
        acting = [model.forces(active) for _, active in listed]
        turning, columns = [_turning(forces) for forces in acting], model.equation.columns
        everywhere = all(applied.acts_in(run) for _, active in listed for applied in active for run in runs)
        if columns is None or not turning[0] or not everywhere:
            return [], reached
        able = [k for k, one in enumerate(turning) if one == turning[0]]
        listed, acting = [listed[k] for k in able], [acting[k] for k in able]
        together, rows, (p, active) = ForcesTogether(acting, own, runs), Rows(runs, model.drivers), listed[0]
        starts = np.zeros((own + together.added, len(listed), len(runs)))
        for k, run in enumerate(runs):
            starts[:own, :, k] = np.stack([model.equation.start(run, values) for values, _ in listed], axis=1)
            for i, one in enumerate(acting):
                starts[own : own + one.added, i, k] = model.equation.begun(run, starts[:own, i, k], one)
        values = in_columns([each for each, _ in listed])
        atol = np.stack([model.tolerance(starts[:own, 0, 0], one, one.added) for one in acting], axis=1)
        flow = RowFlow(columns, rows, values, together, atol)
        sizes = np.array([*(model.scale[name][1] for name in model.states), *acting[0].sizes])
        ways = [own + force.way for force in acting[0].listed if force.way is not None]
        reaches = sizes.copy()
        reaches[ways] = np.inf  # nothing depends on where a way began
        key = (tuple(map(model.recorded, runs)), tuple(turning[0]))
        with silenced():
            first = self._led(flow, key, starts[:, :1], sizes, reaches)
            if first is None:
                x = np.concatenate([model.integrated(run, p, active) for run in runs], axis=1)
                first = x, None
            x, slopes = self._paths[key] = first
            made = np.repeat(x[:, None], len(listed), axis=1)
            there = np.ones(len(listed), dtype=bool)
            if len(listed) > 1:
                slopes, off = beside(flow, x, starts, sizes)
                self._paths[key] = x, slopes
                far = ~((np.abs(off) / reaches[:, None, None]).max(axis=(0, 2)) < _NEAR)
                far |= [_places(one) != _places(acting[0]) for one in acting[1:]]
                rest = 1 + np.flatnonzero(far)
                made[:, 1:] += np.where(far[:, None], 0.0, off)
                begun = np.array([at.start for at in rows.slices])
                made[:, rest[:, None], begun] = starts[:, rest]
                if len(rest):
                    _, there[rest] = converged(flow, made, rest, slopes, sizes, reaches)
        reached[np.array(able)[there]] = True
        whole = np.full((len(made), len(reached), made.shape[2]), np.nan)
        whole[:, able] = made
        return [whole[:, :, at] for at in rows.slices], reached

    def _led(
        self, flow: RowFlow, key: object, starts: Array, sizes: Array, reaches: Array
    ) -> tuple[Array, Array | None] | None:
        """Return the first set's states from the path that is known, and the flow's derivatives."""
        if key not in self._paths:
            return None
        known, slopes = self._paths[key]
        x = known[:, None].copy()
        x[:, :, [at.start for at in flow.rows.slices]] = starts
        slopes, reached = converged(flow, x, np.zeros(1, dtype=np.intp), slopes, sizes, reaches)
        return (x[:, 0], slopes) if reached[0] else None


def converged(
    flow: RowFlow, x: Array, sets: NDArray[np.intp], slopes: Array | None, sizes: Array, reaches: Array
) -> tuple[Array | None, Mask]:
    """Move the states of some sets to where they follow from each other, in place.

    Parameters
    ----------
    x : states at every row, (states, sets of the flow or 1, rows); the first rows of the runs are right
    slopes : derivatives of the flow near by, (rows - 1, 1, states, states), or none
    sizes, reaches : of the states, for differences and for how far one correction may lead, (states,)

    Returns
    -------
    the derivatives used last, and which of the sets came to rest
    """
    active, solved = np.arange(len(sets)), np.zeros(len(sets), dtype=bool)
    before = np.full(len(sets), np.inf)
    for _ in range(_SWEEPS):
        at = sets[active]
        there = x[:, at]
        fresh = slopes is None
        if slopes is None:
            slopes, ends, whole = _slopes(flow, there[:, 0], int(at[0]), sizes)
            arrived = np.array([whole])
        if not fresh or len(active) > 1:
            ends, arrived = flows(flow, there, at)
        moved = recursion(slopes, ends - there[:, :, 1:])
        size = flow.atol[:, at, None] + RTOL * np.abs(ends)
        off = (np.abs(moved) / size).max(axis=(0, 2))
        usable = np.isfinite(off) & arrived & (np.abs(ends) < OFF).all(axis=(0, 2))
        near = (np.abs(moved) / reaches[:, None, None]).max(axis=(0, 2)) < _FAR
        x[:, at[usable], 1:] += moved[:, usable]
        done = usable & (off < 1)
        solved[active[done]] = True
        slow = off > _SLOW * before[active]
        stalled = ~near | (slow & fresh & (off > before[active]))
        before[active] = off
        going = usable & ~done & ~stalled
        if not going.any():
            break
        if slow[going].any():
            slopes = None
        active = active[going]
    return slopes, solved


def _slopes(flow: RowFlow, x: Array, of: int, sizes: Array) -> tuple[Array, Array, bool]:
    """Return the derivatives of a set's flow at every row, where it leads, and whether all of it came there.

    They are (rows - 1, 1, states, states) and (states, 1, rows - 1).
    """
    moved = np.concatenate([x[:, None], x[:, None] + _STEP * np.diag(sizes)[:, :, None]], axis=1)
    ends, whole = neighbours_on(flow, moved, np.full(1 + len(x), of, dtype=np.intp))
    return _differences(flow, ends, sizes), ends[:, :1], whole


def _differences(flow: RowFlow, ends: Array, sizes: Array) -> Array:
    """Return d(end)/d(state), from the ends of a path and of its states moved one by one."""
    n = len(sizes)
    slopes = ((ends[:, 1 : 1 + n] - ends[:, :1]) / (_STEP * sizes)[:, None]).transpose(2, 0, 1)[:, None]
    slopes[flow.rows.last[:-1]] = 0.0
    return np.where(np.isfinite(slopes), slopes, 0.0)


def beside(flow: RowFlow, x: Array, starts: Array, sizes: Array) -> tuple[Array, Array]:
    """Return the flow's derivatives along the first set's states, and how the other sets' states are off.

    To the first order; NaN where they cannot be led on.

    Parameters
    ----------
    x : states of the first set, (states, rows)
    starts : states of all sets at the first rows of the runs, (states, sets, runs)

    Returns
    -------
    (rows - 1, 1, states, states) and (states, sets - 1, rows)
    """
    n, others, rows = len(x), starts.shape[1] - 1, flow.rows
    slopes, _, _ = _slopes(flow, x, 0, sizes)
    there = np.repeat(x[:, None], 1 + others, axis=1)
    ends, _ = neighbours_on(flow, there, np.arange(1 + others, dtype=np.intp))
    added = ends[:, 1:] - ends[:, :1]
    added[:, :, rows.last[:-1]] = 0.0
    begun = starts[:, 1:] - starts[:, :1]
    for k, at in enumerate(rows.slices):
        if at.stop - at.start > 1:
            added[:, :, at.start] += slopes[at.start, 0] @ begun[:, :, k]
    off = np.concatenate([np.zeros((n, others, 1)), recursion(slopes, added)], axis=2)
    off[:, :, [at.start for at in rows.slices]] = begun
    return slopes, off


def _places(forces: Forces) -> list[object]:
    return [force.place for force in forces.listed]


def _turning(forces: Forces) -> list[object]:
    """Return what makes an equation turn, and where its added states stand."""
    return [
        place
        for place, force in zip(_places(forces), forces.listed, strict=True)
        if force.bristle is not None or (force.active.effect.term and force.active.effect.term.limit)
    ]
