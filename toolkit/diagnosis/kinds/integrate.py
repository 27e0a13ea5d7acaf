"""Integration from row to row: Dormand and Prince's pair with error control, LSODA where it turns stiff.

Inputs are linear between rows, so that the equation is smooth within an interval and has a kink at each row:
steps end on rows, and no step ever looks across one.

Source: Dormand, Prince, J. Comp. Appl. Math. 6 (1980) 19.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Rate = Callable[[float, "NDArray[np.float64]"], "NDArray[np.float64]"]

RTOL = 1e-6
_MOST = 20_000  # rates that the stiff solver may ask for between two rows
OFF = 1e100  # in no unit is a state of any plant as large
_MANY = 60  # steps within one interval: the equation is stiff there

_C = (0.2, 0.3, 0.8, 8 / 9, 1.0)
_A = tuple(
    np.array(row)
    for row in (
        (0.2,),
        (3 / 40, 9 / 40),
        (44 / 45, -56 / 15, 32 / 9),
        (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
        (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    )
)
_B = np.array([35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84])
_E = np.array([71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])


class IntegrationError(Exception):
    """The equation cannot be integrated on."""


def integrate(
    rate: Rate, t: NDArray[np.float64], start: NDArray[np.float64], atol: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the states at every row, shape (states, rows).

    Parameters
    ----------
    rate : (time, state) -> its rate
    t : rising times of the rows [s]
    start : state at the first row
    atol : absolute tolerance of each state; the relative one is 1e-6

    Raises
    ------
    IntegrationError
        the state runs off to no number, or even the stiff solver gives up
    """
    made = np.empty((len(start), len(t)))
    made[:, 0] = x = start
    step = float(t[1] - t[0]) if len(t) > 1 else 1.0
    for i in range(len(t) - 1):
        x, step, at = advance(rate, float(t[i]), float(t[i + 1]), x, atol, step)
        if at < t[i + 1]:
            x = _stiff(rate, at, float(t[i + 1]), x, atol)
        if not (np.abs(x) < OFF).all():
            raise IntegrationError(f"the state has run off at {t[i + 1]:g} s")
        made[:, i + 1] = x
    return made


def advance(
    rate: Rate, t: float, end: float, x: NDArray[np.float64], atol: NDArray[np.float64], step: float
) -> tuple[NDArray[np.float64], float, float]:
    """Go from one row to the next; return the state, the step to go on with, and the time that was reached.

    Parameters
    ----------
    x : a state (states,), or columns of states (states, columns): then the worst column rules the step
    atol : absolute tolerance, of a shape that goes with ``x``
    step : to begin with [s]

    A time before ``end`` says that the equation is stiff there.
    """
    k = np.empty((7, x.size))
    k[0] = rate(t, x).ravel()
    h = min(step, end - t)
    for _ in range(_MANY):
        last = t + h >= end - 1e-12 * max(abs(end), h)
        if last:
            h = end - t
        for j, (c, row) in enumerate(zip(_C, _A, strict=True), start=1):
            k[j] = rate(t + c * h, x + h * (row @ k[:j]).reshape(x.shape)).ravel()
        y = x + h * (_B @ k[:6]).reshape(x.shape)
        k[6] = rate(t + h, y).ravel()
        size = atol + RTOL * np.maximum(np.abs(x), np.abs(y))
        error = float(np.sqrt(np.mean((h * (_E @ k).reshape(x.shape) / size) ** 2, axis=0)).max())
        if not np.isfinite(error):
            h *= 0.2
            continue
        grow = min(5.0, max(0.2, 0.9 * error**-0.2)) if error > 0 else 5.0
        if error <= 1.0:
            if last:
                return y, h * grow, end
            t, x = t + h, y
            k[0] = k[6]
        h *= grow
    return x, end - t, t


def _stiff(
    rate: Rate, t: float, end: float, x: NDArray[np.float64], atol: NDArray[np.float64]
) -> NDArray[np.float64]:
    from scipy.integrate import solve_ivp

    left = _MOST

    def counted(at: float, state: NDArray[np.float64]) -> NDArray[np.float64]:
        # Before a state that runs off within finite time, the solver's steps would shrink for ever.
        nonlocal left
        left -= 1
        if left < 0:
            raise IntegrationError(f"no end is reached near {at:g} s")
        return rate(at, state)

    made = solve_ivp(counted, (t, end), x, method="LSODA", rtol=RTOL, atol=atol)
    if not made.success or not np.isfinite(made.y[:, -1]).all():
        raise IntegrationError(str(made.message))
    return np.asarray(made.y[:, -1], dtype=np.float64)
