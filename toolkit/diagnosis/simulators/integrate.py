"""Integration from row to row: Dormand and Prince's pair with error control, LSODA where it turns stiff.

Inputs are linear between rows, so that the equation is smooth within an interval and has a kink at each row:
steps end on rows, and none looks across one. The rate itself has no jump there: that of a step's end is that
of the next one's beginning. Where one interval is stiff, those behind it are, and to find that out takes the
most steps: LSODA leads on over more and more of them, in steps no longer than a row, before the pair is tried
again.

Source: Dormand, Prince, J. Comp. Appl. Math. 6 (1980) 19.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.simulators.sliding_friction import Hold, Slide, TurnedError, held, until_turn

if TYPE_CHECKING:
    from toolkit.arrays import Array

    Rate = Callable[[float, "Array"], "Array"]

RTOL = 1e-6
_MOST = 20_000  # rates that the stiff solver may ask for between two rows
OFF = 1e100  # in no unit is a state of any plant as large
_STRETCH = 16  # rows at most that the stiff solver leads over, before the other is tried again
_HUGE = 1e300
SLOW = 100.0  # tolerances of a velocity, by which a body is at its turn
MANY = 60  # steps within one interval: the equation is stiff there
TURNING = 240  # the same where bristles slide: each body that turns takes a run of short steps

# The tableau, row by row: C, A; the fifth order's weights B; what they are off the fourth order's, E.
C = (1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0)
A = (
    (1 / 5,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
)
B = (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84)
E = (71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40)


class IntegrationError(Exception):
    """The equation cannot be integrated on."""


def integrate(
    rate: Rate,
    t: Array,
    start: Array,
    atol: Array,
    slides: Sequence[Slide] = (),
) -> Array:
    """Return the states at every row, shape (states, rows).

    Parameters
    ----------
    rate : (time, state) -> its rate
    t : rising times of the rows [s]
    start : state at the first row
    atol : absolute tolerance of each state; the relative one is 1e-6
    slides : bristles among the states

    Raises
    ------
    IntegrationError
        the state runs off to no number, even the stiff solver gives up, or there is not one rate a state
    """
    solution = np.empty((len(start), len(t)))
    solution[:, 0] = x = start
    step = float(t[1] - t[0]) if len(t) > 1 else 1.0
    rates = rate(float(t[0]), start)
    if rates.shape != start.shape:
        raise IntegrationError(wrong_rates(rates, start.size))
    _check_numbers(float(t[0]), start, rates)
    absolute, k = atol.tolist(), rates.tolist()
    i = in_turn = 0  # row, and stiff stretches in turn
    while i < len(t) - 1:
        x, k, step, at = _advance(rate, float(t[i]), float(t[i + 1]), x, k, absolute, step, slides)
        there = x[:, None]
        if at < t[i + 1]:
            rows = t[i + 1 : i + 1 + min(2**in_turn, _STRETCH)]
            there = _stiff(rate, at, rows, x, atol)
            x, in_turn = there[:, -1], in_turn + 1
            k = rate(float(rows[-1]), x).tolist()
        else:
            in_turn = 0
        off = ~(np.abs(there) < OFF).all(axis=0)
        if off.any():
            raise IntegrationError(f"the state has run off at {t[i + 1 + int(np.argmax(off))]:g} s")
        solution[:, i + 1 : i + 1 + there.shape[1]] = there
        i += there.shape[1]
    return solution


def _advance(
    rate: Rate,
    t: float,
    end: float,
    x: Array,
    k1: list[float],
    atol: list[float],
    step: float,
    slides: Sequence[Slide],
) -> tuple[Array, list[float], float, float]:
    """Go from one row to the next; return state and rate, the step to go on with, the time that was reached.

    A time before ``end`` says that the equation is stiff there. In plain numbers, written out: for the few
    states of a plant that takes less than half the time of arrays.
    """
    of = range(len(x))
    bends = {slide.bend for slide in slides}
    y: list[float] = x.tolist()
    (a21,), (a31, a32), (a41, a42, a43), (a51, a52, a53, a54), (a61, a62, a63, a64, a65) = A
    b1, _, b3, b4, b5, b6 = B
    e1, _, e3, e4, e5, e6, e7 = E
    hold = held(slides, y, k1, None) if slides else None
    over: Slide | None = None  # the body that a step leads up to its turn
    h = min(step, end - t)
    for _ in range(TURNING if slides else MANY):
        last = t + h >= end - 1e-12 * max(abs(end), h)
        if last:
            h = end - t

        try:
            k2 = _at(rate, t, C[0] * h, [y[i] + h * (a21 * k1[i]) for i in of], hold, over)
            k3 = _at(rate, t, C[1] * h, [y[i] + h * (a31 * k1[i] + a32 * k2[i]) for i in of], hold, over)
            k4 = _at(
                rate,
                t,
                C[2] * h,
                [y[i] + h * (a41 * k1[i] + a42 * k2[i] + a43 * k3[i]) for i in of],
                hold,
                over,
            )
            k5 = _at(
                rate,
                t,
                C[3] * h,
                [y[i] + h * (a51 * k1[i] + a52 * k2[i] + a53 * k3[i] + a54 * k4[i]) for i in of],
                hold,
                over,
            )
            x6 = [
                y[i] + h * (a61 * k1[i] + a62 * k2[i] + a63 * k3[i] + a64 * k4[i] + a65 * k5[i]) for i in of
            ]
            k6 = _at(rate, t, C[4] * h, x6, hold, over)
            z = [y[i] + h * (b1 * k1[i] + b3 * k3[i] + b4 * k4[i] + b5 * k5[i] + b6 * k6[i]) for i in of]
            k7 = _at(rate, t, h, z, hold, over)
        except TurnedError as turn:
            speed = y[turn.slide.velocity]
            if abs(speed) <= SLOW * atol[turn.slide.velocity]:
                hold, over = None, None  # it rests, or nearly so: its bend is integrated as any state
            else:
                over, h = turn.slide, until_turn(speed, k1[turn.slide.velocity], turn.after, turn.speed)
            continue
        error = 0.0
        for i in of:
            if hold is not None and i in bends:
                continue
            off = e1 * k1[i] + e3 * k3[i] + e4 * k4[i] + e5 * k5[i] + e6 * k6[i] + e7 * k7[i]
            share = h * off / (atol[i] + RTOL * max(abs(y[i]), abs(z[i])))
            error += share * share
        if not error < _HUGE:
            h *= 0.2
            continue
        error = math.sqrt(error / len(y))
        grow = min(5.0, max(0.2, 0.9 * error**-0.2)) if error > 0 else 5.0
        if error > 1.0:
            h *= grow
            continue
        turned, ahead = None, h * grow
        if over is not None:
            speed, pull = z[over.velocity], k7[over.velocity]
            if abs(speed) <= SLOW * atol[over.velocity]:
                turned, ahead = over, math.sqrt(over.reach / abs(pull)) if pull else ahead
            elif speed * y[over.velocity] < 0:
                h = until_turn(y[over.velocity], k1[over.velocity], h, speed)
                continue
            elif speed * pull < 0:
                ahead = min(ahead, -speed / pull)
        if last:
            return np.array(z), k7, ahead, end
        t, y, k1, h = t + h, z, k7, ahead
        if slides:
            hold, over = held(slides, y, k1, turned), None if turned else over
    return np.array(y), k1, end - t, t


def _at(
    rate: Rate, t: float, after: float, y: list[float], hold: Hold | None, over: Slide | None
) -> list[float]:
    if hold is not None:
        hold(y, after, over)
    rates: list[float] = rate(t + after, np.array(y)).tolist()
    return rates


def wrong_rates(rates: Array, states: int) -> str:
    """Return what rhs gives where that is not one rate for each state in a sequence.

    >>> wrong_rates(np.array(0.5), 1)
    'rhs gives a number; expected a sequence of rates, one for each state (1), such as [rate]'
    >>> wrong_rates(np.zeros(3), 2), wrong_rates(np.zeros((2, 1)), 2)
    ('rhs gives 3 rates for 2 states', 'rhs gives rates of shape (2, 1) for 2 states')
    """
    if rates.ndim == 0:
        return (
            f"rhs gives a number; expected a sequence of rates, one for each state ({states}), such as [rate]"
        )
    got = f"{rates.size} rates" if rates.ndim == 1 else f"rates of shape {rates.shape}"
    return f"rhs gives {got} for {states} state{'' if states == 1 else 's'}"


def _check_numbers(t: float, x: Array, rates: Array) -> None:
    """Refuse rates that are no numbers, with the time and the state that rhs was asked at."""
    if not np.isfinite(rates).all():
        bad = int(np.flatnonzero(~np.isfinite(rates))[0])
        state = ", ".join(f"{value:.6g}" for value in x.tolist())
        raise IntegrationError(f"rhs gives {rates[bad]} for state {bad + 1} at t = {t:g} s, x = [{state}]")


def _stiff(rate: Rate, t: float, rows: Array, x: Array, atol: Array) -> Array:
    """Return the states at the next rows, (states, rows). No step is longer than from one row to the next."""
    from scipy.integrate import solve_ivp

    calls_left, end = _MOST * len(rows), float(rows[-1])
    bad: tuple[float, Array, Array] | None = None

    def counted(at: float, state: Array) -> Array:
        # Before a state that runs off within finite time, the solver's steps would shrink for ever.
        nonlocal calls_left, bad
        calls_left -= 1
        if calls_left < 0:
            raise IntegrationError(f"no end is reached near {at:g} s")
        rates = rate(at, state)
        if bad is None and not all(map(math.isfinite, rates.tolist())) and np.isfinite(state).all():
            bad = at, state.copy(), rates
        return rates

    longest = float(np.diff(rows).max()) if len(rows) > 1 else math.inf
    solved = solve_ivp(
        counted, (t, end), x, method="LSODA", t_eval=rows, rtol=RTOL, atol=atol, max_step=longest
    )
    if not solved.success or not np.isfinite(solved.y[:, -1]).all():
        if bad is not None:
            _check_numbers(*bad)
        raise IntegrationError(
            str(solved.message) if not solved.success else f"the state is no number at {end:g} s"
        )
    return np.asarray(solved.y, dtype=np.float64)
