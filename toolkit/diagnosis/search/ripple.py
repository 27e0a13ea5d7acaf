"""A force that repeats with the position: which periods to try, and what each would do to the outputs.

The responses of two periods have nothing in common once they differ by a cycle over the way, so that the
periods stand as close as half a cycle; hundreds of simulations would be too many, and their linear responses
along one simulation are not.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.policy import RIPPLE
from toolkit.errors import FitError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.diagnosis.fit.fit import Fit
    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.diagnosis.simulators.simulator import Active

    Stacked = dict[str, NDArray[np.float64]]

NAME = "periodic_ripple"


def longest(problem: Problem, channel: str | None) -> float:
    """Return the longest period of which a motion shows that it repeats, in the position's unit."""
    return float(_way(problem, channel)[0] / RIPPLE.longest)


def periods(problem: Problem, channel: str | None) -> tuple[float, ...]:
    """Return the periods to try, in the position's unit, the longest first; none where nothing moves."""
    whole, step = _way(problem, channel)
    if not whole > 0:
        return ()
    # Two rows to a period at the usual speed; where the motion is slower, shorter ones would still be seen.
    most = min(RIPPLE.shortest, whole / (2 * step) if step > 0 else RIPPLE.shortest)
    count = min(
        int((most - RIPPLE.longest) / RIPPLE.step),
        max(RIPPLE.least, RIPPLE.work // problem.rows),
    )
    return tuple(float(whole / cycles) for cycles in RIPPLE.longest + RIPPLE.step * np.arange(max(count, 1)))


def _way(problem: Problem, channel: str | None) -> tuple[float, float]:
    moving = problem.model.capability.motion
    return (0.0, 0.0) if moving is None else moving.way(channel)


def responses(
    problem: Problem, base: Fit, active: Active, starts: Sequence[Mapping[str, float]]
) -> list[Stacked]:
    """Return the responses of every start: of each output (rows, 2), a sine and a cosine of the position.

    Parameters
    ----------
    active : where the ripple acts
    starts : amplitude and period of each

    Raises
    ------
    FitError
        the simulation cannot be run
    """
    wave = np.array([2 * np.pi / one["period"] for one in starts])
    size = np.array([one["amplitude"] for one in starts])

    def pattern(x: NDArray[np.float64]) -> NDArray[np.float64]:
        turned = np.multiply.outer(x, wave)
        return np.hstack([size * np.sin(turned), size * np.cos(turned)])

    made = problem.pushed(base.p, base.active, active, pattern, 2 * len(starts))
    for column in made.values():
        if not np.isfinite(column).all():
            raise FitError(
                "an equation cannot be linearised along its motion",
                where=str(active.channel),
                got="responses without bound",
                expected="an equation that is smooth where it moves",
                next_step="look at the equation where it has corners",
                rule="simulator",
            )
    return [
        {name: column[:, [k, k + len(starts)]] for name, column in made.items()} for k in range(len(starts))
    ]
