"""Algorithm A of ISO 13528 (annex C.3): the robust mean and standard deviation of laboratories' results."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

FACTOR = 1.134  # as the standard prints it; 1.1334 of a normal distribution cut at 1.5 standard deviations
_CUT = 1.5
_MAD = 1.483
_SAME = 1e-10
_MOST_STEPS = 10_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Robust:
    """Robust mean and standard deviation of ``n`` results, and how many of them were drawn in."""

    mean: float
    sd: float
    n: int
    drawn_in: int

    @property
    def u(self) -> float:
        """Standard uncertainty of the mean, 1.25 s* / sqrt(p) (7.7.7)."""
        return float(1.25 * self.sd / np.sqrt(self.n))


def algorithm_a(values: NDArray[np.float64], *, factor: float = FACTOR) -> Robust:
    """Return the robust mean and standard deviation of results (n,), by iteration until they stay.

    Where more than half of the results are the same the iteration begins with their ordinary standard
    deviation; it may then end in 0.

    >>> clean = algorithm_a(np.array([9.9, 10.0, 10.1, 10.0, 9.8, 10.2]))
    >>> spoilt = algorithm_a(np.array([9.9, 10.0, 10.1, 10.0, 9.8, 99.0]))
    >>> abs(clean.mean - spoilt.mean) < 0.1
    True
    """
    mean = float(np.median(values))
    sd = _MAD * float(np.median(np.abs(values - mean))) or float(values.std(ddof=1))
    scale = max(float(np.abs(values - mean).max()), 1e-300)
    for _ in range(_MOST_STEPS):
        near = np.clip(values, mean - _CUT * sd, mean + _CUT * sd)
        after, spread = float(near.mean()), factor * float(near.std(ddof=1))
        settled = abs(after - mean) <= _SAME * scale and abs(spread - sd) <= _SAME * scale
        mean, sd = after, spread
        if settled:
            break
    sd = 0.0 if sd <= 1e-6 * scale else sd
    return Robust(
        mean=mean, sd=sd, n=len(values), drawn_in=int(np.count_nonzero(np.abs(values - mean) > _CUT * sd))
    )
