"""Shewhart chart for individuals and moving range, one point a session.

    sigma = mean moving range / d2,   limits = centre +- 3 sigma,   upper limit of the range = D4 mean range

with d2 = 1.128 and D4 = 3.267 for ranges of two successive points. Centre and sigma come from a baseline of
points and stay; a chart of fewer than 20 points is provisional.

Reference: ISO 7870-2, charts for individuals and moving ranges; NIST/SEMATECH e-Handbook, 6.3.2.2.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Run rules of a control chart: patterns that a process in control hardly ever draws.


@dataclass(frozen=True, slots=True, kw_only=True)
class RunRule:
    """A rule of Nelson's list: its ``number``, in words, and the ``length`` of the stretch it looks at."""

    number: int
    text: str
    length: int
    test: Callable[[NDArray[np.float64]], bool]


@dataclass(frozen=True, slots=True, kw_only=True)
class Break:
    """A rule that is broken by the points that end at ``index`` (from 0)."""

    rule: RunRule
    index: int


def broken_rules(z: NDArray[np.float64]) -> tuple[Break, ...]:
    """Return every rule that a stretch of points breaks, at the last point of the stretch, in their order.

    >>> [(one.rule.number, one.index) for one in broken_rules(np.array([0.0, 0.5, 3.5]))]
    [(1, 2)]
    """
    return tuple(
        Break(rule=rule, index=end)
        for end in range(len(z))
        for rule in RULES
        if end + 1 >= rule.length and rule.test(z[end + 1 - rule.length : end + 1])
    )


def _beyond(limit: float, least: int) -> Callable[[NDArray[np.float64]], bool]:
    # The last point itself must be out: else a point back in the middle would be told as breaking the rule.
    def test(z: NDArray[np.float64]) -> bool:
        return any(
            side * z[-1] > limit and int(np.count_nonzero(side * z > limit)) >= least for side in (1, -1)
        )

    return test


def _one_side(z: NDArray[np.float64]) -> bool:
    return bool((z > 0).all() or (z < 0).all())


def _steady(z: NDArray[np.float64]) -> bool:
    step = np.diff(z)
    return bool((step > 0).all() or (step < 0).all())


def _alternating(z: NDArray[np.float64]) -> bool:
    step = np.diff(z)
    return bool((step[:-1] * step[1:] < 0).all())


def _quiet(z: NDArray[np.float64]) -> bool:
    return bool((np.abs(z) <= 1).all())


def _none_in_the_middle(z: NDArray[np.float64]) -> bool:
    return bool((np.abs(z) > 1).all() and (z > 0).any() and (z < 0).any())


RULES = (
    RunRule(number=1, text="one point beyond 3 sigma", length=1, test=_beyond(3, 1)),
    RunRule(number=2, text="nine in a row on one side of the centre", length=9, test=_one_side),
    RunRule(number=3, text="six in a row rising or falling", length=6, test=_steady),
    RunRule(number=4, text="fourteen in a row alternating up and down", length=14, test=_alternating),
    RunRule(number=5, text="two of three beyond 2 sigma on one side", length=3, test=_beyond(2, 2)),
    RunRule(number=6, text="four of five beyond 1 sigma on one side", length=5, test=_beyond(1, 4)),
    RunRule(number=7, text="fifteen in a row within 1 sigma", length=15, test=_quiet),
    RunRule(number=8, text="eight in a row beyond 1 sigma on both sides", length=8, test=_none_in_the_middle),
)


D2, D4 = 1.128, 3.267
LEAST_BASELINE = 4
SETTLED = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Centre, sigma and control limits in the unit of the points; ``points`` of the baseline."""

    centre: float
    sigma: float
    lower: float
    upper: float
    mean_range: float
    upper_range: float
    points: int

    @property
    def provisional(self) -> bool:
        """Whether the baseline is too short for settled limits."""
        return self.points < SETTLED


def limits_of(values: NDArray[np.float64]) -> Limits | None:
    """Return the limits of a baseline (points,); None where it is too short or does not scatter at all."""
    if len(values) < LEAST_BASELINE:
        return None
    centre, mean_range = float(values.mean()), float(np.abs(np.diff(values)).mean())
    sigma = mean_range / D2
    # Equal to the last digits: a sigma of rounding would call every later point an alarm.
    if sigma <= 1e-12 * float(np.abs(values).max()):
        return None
    return Limits(
        centre=centre,
        sigma=sigma,
        lower=centre - 3 * sigma,
        upper=centre + 3 * sigma,
        mean_range=mean_range,
        upper_range=D4 * mean_range,
        points=len(values),
    )


def breaks_of(values: NDArray[np.float64], limits: Limits) -> tuple[Break, ...]:
    """Return the run rules that the points (points,) break against these limits."""
    return broken_rules((values - limits.centre) / limits.sigma)
