"""First-order lag, delay and play of a sampled signal; time may be irregular."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike

    from toolkit.arrays import Array


_FINER = 4
_CORNER = 0.5  # of the largest step between two rows: by so much more or less in the next one is a corner
STRAIGHT = "_straight"  # among an effect's values: the rows are fine enough for straight lines
PAST = "_past"
"""Among an effect's values: how far its state was, at a run's first row, from where a long rest on that row
would have left it, in units of the range of what it follows. What came before that row is not recorded."""


def begun(x: Array, values: Mapping[str, float]) -> float | None:
    """Return where a state that follows a signal was at the first row, None for at rest on it."""
    past = values.get(PAST, 0.0)
    return float(x[0] + past * np.ptp(x)) if past and len(x) else None


def lag(t: Array, x: Array, time_constant: ArrayLike, start: float | None = None) -> Array:
    """Return y of ``time_constant`` dy/dt + y = x, shape (n,), exact for an x that is linear between rows.

    Parameters
    ----------
    t : time [s], rising, shape (n,)
    time_constant : [s], one number or shape (n,), not negative; an interval uses the value at its end, and
        without lag anywhere y is x itself
    start : y at the first row; x there by default
    """
    constants = np.broadcast_to(np.asarray(time_constant, dtype=np.float64), t.shape)[1:]
    if start is None and not (constants > 0).any():
        return x.copy()
    tau = np.maximum(constants, 1e-12)
    ratio = np.diff(t) / tau
    decay = np.exp(-ratio)
    # Response to a ramp: y1 = decay*y0 + (1 - decay)*x0 + (1 - (1 - decay)/ratio)*(x1 - x0)
    ramp = np.where(ratio > 1e-6, 1 + np.expm1(-ratio) / np.maximum(ratio, 1e-300), 0.5 * ratio)
    drive = -np.expm1(-ratio) * x[:-1] + ramp * np.diff(x)
    y = np.empty_like(x)
    y[0] = x[0] if start is None else start
    if len(ratio) and np.ptp(decay) <= 1e-9 * decay.max():
        from scipy.signal import lfilter

        y[1:] = lfilter([1.0], [1.0, -decay[0]], drive, zi=[decay[0] * y[0]])[0]
        return y
    last, ahead = float(y[0]), []
    for keep, add in zip(decay.tolist(), drive.tolist(), strict=True):
        last = keep * last + add
        ahead.append(last)
    y[1:] = ahead
    return y


def delayed(t: Array, x: Array, delay: float, *, straight: bool = False, past: float = 0.0) -> Array:
    """Return x(t - delay), cubic between rows; beyond the ends the end value.

    With a ``past`` it goes on in a straight line there, which is off by so much of the range a delay away.

    Straight lines would take a tenth of what changes within a few rows, and the delay would be found too
    short by as much; a step between two rows overshoots by 7 % beside it. Where x has gaps, straight lines;
    also where ``straight`` asks for them, of an x on rows so fine that its corners stand on them.
    """
    if delay == 0 or not len(t):
        return x.copy()
    at = np.clip(t - delay, t[0], t[-1])
    y = np.interp(at, t, x) if straight else _between(t, x, at)
    return y + past * np.ptp(x) * np.abs(t - delay - at) / abs(delay) if past else y


def filtered(
    t: Array,
    x: Array,
    time_constant: float,
    *,
    straight: bool = False,
    start: float | None = None,
) -> Array:
    """Return a signal behind a first-order filter, cubic as in `delayed`, from a ``start`` as in `lag`."""
    if straight or len(t) < 3 or not time_constant > 0:
        return lag(t, x, time_constant, start)
    fine = np.interp(np.arange(_FINER * (len(t) - 1) + 1) / _FINER, np.arange(len(t)), t)
    return lag(fine, _between(t, x, fine), time_constant, start)[::_FINER]


def followed(t: Array, command: Array, time_constant: float, start: float | None = None) -> Array:
    """Return what follows a command with a time constant; ``start`` as in `lag`.

    A command of steps and ramps is straight between its rows; one without corners is cubic, as in `filtered`.
    """
    steps = np.abs(np.diff(command)).max(initial=0.0)
    corners = np.abs(np.diff(command, 2)).max(initial=0.0) > _CORNER * steps
    return filtered(t, command, time_constant, straight=bool(corners), start=start)


def _between(t: Array, x: Array, at: Array) -> Array:
    """Return x at other times by Hermite's cubics, their slopes from the rows on both sides."""
    if len(t) < 3 or not np.isfinite(x).all():
        return np.interp(at, t, x)
    from scipy.interpolate import CubicHermiteSpline

    return np.asarray(CubicHermiteSpline(t, x, np.gradient(x, t))(at))


def play(x: Array, width: float, past: float = 0.0) -> Array:
    """Return the play operator's output for a gap of full ``width``.

    It starts in the middle of the gap, or off it by the share ``past`` of half the gap.
    """
    half = 0.5 * abs(width)
    last, played = float(x[0]) + past * half if len(x) else 0.0, []
    for low, high in zip((x - half).tolist(), (x + half).tolist(), strict=True):
        last = low if last < low else high if last > high else last
        played.append(last)
    return np.array(played, dtype=np.float64)


def plays(x: Array, halves: Array, past: float = 0.0) -> Array:
    """Return the mean of play operators with several half gaps, loaded from zero for the first time.

    With a ``past`` each has gone by this share of the way from there to the farther end of its gap.

    A row clips the state to an interval, and one clip after another is a clip again: all rows at once by
    doubling the number of rows that stand behind one clip (Hillis and Steele's scan).
    """
    if not len(x):
        return x
    low, high = x[:, None] - halves, x[:, None] + halves
    state = np.clip(0.0, low[0], high[0])
    state = state + past * (np.where(state > x[0], low[0], high[0]) - state)
    reach = 1
    while reach < len(x):
        first = np.maximum(np.minimum(low[:-reach], high[reach:]), low[reach:])
        last = np.maximum(np.minimum(high[:-reach], high[reach:]), low[reach:])
        low[reach:], high[reach:] = first, last
        reach *= 2
    return np.asarray(np.minimum(np.maximum(state, low), high).mean(axis=1))
