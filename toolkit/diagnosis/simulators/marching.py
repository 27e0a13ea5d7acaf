"""Free simulations side by side, each with steps of its own: for what turns, stops or runs against a limit.

A column for each set of parameters and run goes from row to row as `integrate` does with one state; the price
of a step hardly grows with the number of columns, and none waits for the short steps of another.

Neighbours of a state go with it in its own steps. What the steps leave is then the same for all of them, and
no part of their difference, however small that is.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.diagnosis.simulators.integrate import MANY, OFF, SLOW, TURNING
from toolkit.diagnosis.simulators.row_flow import stepped
from toolkit.diagnosis.simulators.sliding_friction import until_turns

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.arrays import Array
    from toolkit.diagnosis.simulators.row_flow import RowFlow
    from toolkit.diagnosis.simulators.sliding_friction import HeldSlide

    Places = NDArray[np.intp]
    Mask = NDArray[np.bool_]

_NO_BODY = -1


def march(flow: RowFlow, starts: Array, sets: Places) -> tuple[Array, Mask]:
    """Return the states at every row, (states, sets, rows), and which of the sets came to the end, (sets,).

    A set that turns stiff or runs off does not.

    Parameters
    ----------
    starts : states at the first row of every run, (states, sets, runs)
    sets : which sets of the flow they are
    """
    rows = flow.rows
    n, count, runs = starts.shape
    x = np.full((n, count, len(rows.t)), np.nan)
    begun = np.array([at.start for at in rows.slices])
    x[:, :, begun] = starts
    of = np.repeat(np.arange(count), runs)

    def keep(which: Places, row: Places, y: Array) -> None:
        x[:, of[which], row] = y[:, :, 0]

    ended = _marched(
        flow, sets[of][:, None], np.tile(begun, count), np.tile(rows.last, count),
        starts.reshape(n, -1, 1), keep,
    )  # fmt: skip
    return x, np.asarray(ended.reshape(count, runs).all(axis=1))


def flows(flow: RowFlow, x: Array, sets: Places) -> tuple[Array, Mask]:
    """Return the states of sets one row on, each in steps of its own, and which of the sets all came there.

    Parameters
    ----------
    x : states at every row, (states, sets, rows)
    sets : which sets of the flow they are, (sets,)

    Returns
    -------
    states (states, sets, rows - 1) and (sets,); the end of a run's last row is the first row of the next run
    """
    ends, begun = x[:, :, 1:].copy(), _begun(flow, x)
    of, at = np.repeat(np.arange(len(sets)), len(begun)), np.tile(begun, len(sets))

    def keep(which: Places, row: Places, y: Array) -> None:
        ends[:, of[which], row - 1] = y[:, :, 0]

    ended = _marched(flow, sets[of][:, None], at, at + 1, x[:, of, at][:, :, None], keep)
    return ends, np.asarray(ended.reshape(len(sets), -1).all(axis=1))


def neighbours_on(flow: RowFlow, x: Array, sets: Places) -> tuple[Array, bool]:
    """Return the states one row on of a set and of its neighbours in its steps, and whether all came there.

    Parameters
    ----------
    x : states at every row, those of the neighbours behind the first, (states, neighbours, rows)
    sets : which set of the flow each of them is, (neighbours,)

    Returns
    -------
    states (states, neighbours, rows - 1); the end of a run's last row is the first row of the next run
    """
    ends, begun = x[:, :, 1:].copy(), _begun(flow, x)

    def keep(which: Places, _: Places, y: Array) -> None:
        ends[:, :, begun[which]] = y.transpose(0, 2, 1)

    of = np.broadcast_to(sets, (len(begun), len(sets)))
    ended = _marched(flow, of, begun, begun + 1, x[:, :, begun].transpose(0, 2, 1), keep)
    return ends, bool(ended.all())


def _begun(flow: RowFlow, x: Array) -> Places:
    return np.delete(np.arange(x.shape[2] - 1), flow.rows.last[:-1])


def _marched(
    flow: RowFlow,
    sets: Places,
    at: Places,
    end: Places,
    y: Array,
    keep: Callable[[Places, Places, Array], None],
) -> Mask:
    """March from row to row, and tell what came to its end.

    Parameters
    ----------
    sets : of every state and its neighbours, (marching, neighbours)
    at, end : row of the beginning and of the end, (marching,)
    y : states at the beginning, the neighbours behind the one whose steps they take, (states, marching,
        neighbours)
    keep : is told what has come to which row, and its states there
    """
    n, many, beside = y.shape
    t, who, y = flow.rows.t, np.arange(many), np.ascontiguousarray(y).reshape(n, -1)
    ended, lead = np.zeros(many, dtype=bool), slice(None, None, beside)

    def each(values: Any) -> Any:
        return values if beside == 1 else np.repeat(values, beside)

    now, h, tries = t[at], t[at + 1] - t[at], np.zeros(many, dtype=np.intp)
    columns = flow.columns(np.repeat(at, beside), sets.ravel())
    first = flow.equation(np.repeat(at, beside), columns)(0.0, y)
    free = np.zeros(many, dtype=bool)  # a body that hardly moves has turned in the step that is tried again
    over = np.full(many, _NO_BODY)  # velocity of the body that the step leads up to its turn
    turned = np.zeros(many, dtype=bool)  # a body is at its turn
    while len(who):
        rates, bristles = flow.equation(np.repeat(at, beside), columns), columns.acting.bristles
        to, interval = t[at + 1], t[at + 1] - t[at]
        last = now + h >= to - 1e-12 * np.maximum(np.abs(to), h)
        h = np.where(last, to - now, h)
        held = bristles.held(y, first, np.repeat(free, beside), np.repeat(turned, beside), beside)
        z, rate, error = stepped(
            rates, y, first, each(h), each((now - t[at]) / interval), each(h / interval), columns.atol, held
        )
        error = error[lead]
        good = np.isfinite(error)
        taken = good & (error <= 1)
        grow = np.where(good, np.clip(0.9 * np.maximum(error, 1e-30) ** -0.2, 0.2, 5.0), 0.2)
        ahead, released, at_turn = h * grow, np.zeros(len(who), dtype=bool), np.zeros(len(who), dtype=bool)
        if bristles:
            before, after = (y[:, lead], first[:, lead]), (z[:, lead], rate[:, lead])
            for slide in held.slides:
                slow = SLOW * columns.atol[slide.of.velocity, lead]
                released |= _up_to_turns(slide, before, after, h, slow, over, taken, ahead, at_turn)
            taken &= ~released
            over[released | (taken & at_turn)] = _NO_BODY
            free = (free | released) & ~taken
            turned = np.where(taken, at_turn, turned)
        y, first = np.where(each(taken), z, y), np.where(each(taken), rate, first)
        now = np.where(taken, np.where(last, to, now + h), now)
        h = np.where(released, h, ahead)
        there = np.flatnonzero(taken & last)
        if len(there):
            keep(who[there], at[there] + 1, y.reshape(n, -1, beside)[:, there])
            at[there] += 1
            tries[there] = -1
        tries += 1
        whole = np.asarray((np.abs(y[:, lead]) < OFF).all(axis=0))
        lost = (tries > (TURNING if bristles else MANY)) | ~whole
        arrived = at >= end
        ended[who[arrived]] = whole[arrived]
        going = ~arrived & ~lost
        if not going.all():
            who, at, end, tries, sets = who[going], at[going], end[going], tries[going], sets[going]
            now, h, free, over, turned = now[going], h[going], free[going], over[going], turned[going]
            y, first = y[:, np.repeat(going, beside)], first[:, np.repeat(going, beside)]
            columns = flow.columns(np.repeat(at, beside), sets.ravel())
    return ended


def _up_to_turns(
    slide: HeldSlide, before: tuple[Array, Array], after: tuple[Array, Array], h: Array, slow: Array,
    over: Places, taken: Mask, ahead: Array, at_turn: Mask,
) -> Mask:  # fmt: skip
    """Lead what turns up to its turn, as `integrate` does, and tell what rests.

    Parameters
    ----------
    before, after : states and rates before a step and after it, (states, marching)
    h : the step's length, (marching,)
    slow : velocity by which a body is at its turn, (marching,)
    over, taken, ahead, at_turn : velocity of the body that is led to its turn, whether the step holds, the
        length of the next, and whether a body is at its turn, (marching,) all; changed in place

    Returns
    -------
    where a body has turned that hardly moves: its bend is integrated as any state
    """
    at, v = slide.leads, slide.of.velocity
    rests, led = np.zeros(len(h), dtype=bool), over[at] == v
    if not led.any() and not slide.turned.any():
        return rests
    (speed, pull), (later, pulled) = ((states[v, at], rates[v, at]) for states, rates in (before, after))
    turns, holds, slow = slide.turned & ~led, led & taken[at], slow[at]
    there = holds & (np.abs(later) <= slow)
    rests[at[turns & (np.abs(speed) <= slow)]] = True
    turns &= np.abs(speed) > slow
    beyond = holds & ~there & (later * speed < 0)
    for which, by, then in ((turns, slide.after, slide.speed), (beyond, h[at], later)):
        some = at[which]
        ahead[some] = until_turns(speed[which], pull[which], by[which], then[which])
        taken[some], over[some] = False, v
    near = holds & ~there & ~beyond & (later * pulled < 0)
    ahead[at[near]] = np.minimum(ahead[at[near]], -later[near] / pulled[near])
    at_turn[at[there]] = True
    there &= pulled != 0
    ahead[at[there]] = np.sqrt(slide.reach[there] / np.abs(pulled[there]))
    return rests
