"""Many free simulations of one equation at a time: a column for each set of parameters, steps in common.

A right-hand side that is written with numpy takes columns of states as it takes one state, and the price of
a call hardly grows with their number. Whether it does is tried before it is trusted: the same rates must come
out one by one. One that branches on a value, or calls `math`, refuses or differs there, and is integrated
alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.diagnosis.simulators.integrate import MANY, OFF, RTOL, TURNING, A, B, C, E
from toolkit.diagnosis.simulators.sliding_friction import HeldColumns, Slide, TurnedError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Rates = Callable[[float, Array], Array]

_TRIALS = 4
_SAME = 1e-12
_ROWS = tuple(np.array(row) for row in A)
_WEIGHTS, _ERROR = np.array(B), np.array(E)


class NotTogetherError(Exception):
    """The columns cannot be integrated together; alone each of them may."""


def columns_of(sets: Sequence[Mapping[str, float]]) -> dict[str, Array]:
    """Return sets of parameters as one, each value a row of columns (m,)."""
    return {name: np.array([values[name] for values in sets], dtype=np.float64) for name in sets[0]}


def takes_columns(
    rhs: Callable[..., Any],
    t: float,
    start: Array,
    size: Array,
    u: Mapping[str, float],
    p: Mapping[str, float],
) -> bool:
    """Tell whether a right-hand side gives for columns of states and parameters what it gives for each.

    Parameters
    ----------
    start, size : a state and how far to stray from it, (states,)
    u, p : inputs of one row, parameters as declared
    """
    rng = np.random.default_rng(0)
    for _ in range(_TRIALS):
        states = start[:, None] + size[:, None] * rng.normal(size=(len(start), 3))
        sets = [
            {name: value * (1 + 0.1 * float(rng.normal())) for name, value in p.items()} for _ in range(3)
        ]
        try:
            alone = [np.asarray(rhs(t, states[:, k].copy(), dict(u), dict(sets[k])), float) for k in range(3)]
            together = np.asarray(rhs(t, states.copy(), dict(u), columns_of(sets)), dtype=np.float64)
        except Exception:  # noqa: BLE001 - whatever a user's code raises: it does not take columns
            return False
        expected = np.stack(alone, axis=1)
        if together.shape != expected.shape or not np.allclose(
            together, expected, rtol=_SAME, atol=0, equal_nan=True
        ):
            return False
    return True


def integrate_together(
    rates: Rates, t: Array, starts: Array, atol: Array, slides: Sequence[tuple[int, Slide]] = ()
) -> Array:
    """Return the states at every row, (rows, states, columns).

    Parameters
    ----------
    rates : (time, states (states, columns)) -> their rates, as an array of its own
    t : rising times of the rows [s]
    starts : states at the first row, (states, columns)
    atol : absolute tolerance of each state, (states,) or in each column (states, columns); the relative one
        is that of `integrate`
    slides : column and bristle of each that slides

    Raises
    ------
    NotTogetherError
        the equation turns stiff in some column, or runs off
    """
    x = starts.copy()
    solution = np.empty((len(t), *x.shape))
    solution[0] = x
    atol = atol.reshape(len(x), -1)
    h = float(t[1] - t[0]) if len(t) > 1 else 1.0
    k, held = rates(float(t[0]), x), HeldColumns(slides)
    for i in range(len(t) - 1):
        x, k, h = _advance(rates, float(t[i]), float(t[i + 1]), x, k, atol, h, held)
        if not (np.abs(x) < OFF).all():
            raise NotTogetherError
        solution[i + 1] = x
    return solution


def _advance(
    rates: Rates,
    t: float,
    end: float,
    x: Array,
    first: Array,
    atol: Array,
    step: float,
    columns: HeldColumns,
) -> tuple[Array, Array, float]:
    """Go from one row to the next as `integrate` does with one state; the worst column rules the step."""
    k = np.empty((7, x.size))
    k[0] = first.ravel()
    h = min(step, end - t)
    columns.begin(x)
    for _ in range(MANY + (TURNING - MANY) * columns.turning):
        last = t + h >= end - 1e-12 * max(abs(end), h)
        if last:
            h = end - t
        try:
            for j, (c, row) in enumerate(zip(C, _ROWS, strict=True), start=1):
                y = x + h * (row @ k[:j]).reshape(x.shape)
                columns.hold(y)
                k[j] = rates(t + c * h, y).ravel()
            y = x + h * (_WEIGHTS @ k[:6]).reshape(x.shape)
            columns.hold(y)
            k[6] = rates(t + h, y).ravel()
        except TurnedError:
            continue
        size = atol + RTOL * np.maximum(np.abs(x), np.abs(y))
        share = h * (_ERROR @ k).reshape(x.shape) / size
        columns.known(share)
        error = float(np.sqrt(np.mean(share**2, axis=0)).max())
        if not np.isfinite(error):
            h *= 0.2
            continue
        grow = min(5.0, max(0.2, 0.9 * error**-0.2)) if error > 0 else 5.0
        if error <= 1.0:
            if last:
                return y, k[6].reshape(x.shape).copy(), h * grow
            t, x = t + h, y
            k[0] = k[6]
        columns.begin(x)
        h *= grow
    raise NotTogetherError
