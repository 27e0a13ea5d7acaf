"""Shewhart chart for individuals and moving range, one point a session.

    sigma = mean moving range / d2,   limits = centre +- 3 sigma,   upper limit of the range = D4 mean range

with d2 = 1.128 and D4 = 3.267 for ranges of two successive points. Centre and sigma come from a baseline of
points and stay; a chart of fewer than 20 points is provisional.

Reference: ISO 7870-2, charts for individuals and moving ranges; NIST/SEMATECH e-Handbook, 6.3.2.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.control.rules import Break, broken_rules

if TYPE_CHECKING:
    from numpy.typing import NDArray

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
