"""ASTM E74, annex: the degree of the polynomial that fits best.

The indications are averaged at each of the n forces, and polynomials of degree 1 to 5 are fitted. From the
highest degree downward, the first degree m with s_(m-1) / s_m above

    C(n, m) = sqrt(1 + (F_0.975(1, n - m - 1) - 1) / (n - m))

is the degree of best fit; where there is none, it is 1. The factor is the F test of one more term, written
for the standard deviations: with SSE_(m-1) = SSE_m + F s_m^2 and n - m and n - m - 1 degrees of freedom,
(s_(m-1) / s_m)^2 = 1 + (F - 1) / (n - m).

Reference: ASTM E74, annex on the degree of the best fitting polynomial, with its table of factors.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.fit.regression import fit_terms

if TYPE_CHECKING:
    from numpy.typing import NDArray

HIGHEST = 5
_PROBABILITY = 0.025


@dataclass(frozen=True, slots=True, kw_only=True)
class DegreeStep:
    """One comparison: ``ratio`` = s_(degree - 1) / s_degree against ``factor`` = C(n, degree)."""

    degree: int
    ratio: float
    factor: float

    @property
    def better(self) -> bool:
        """Whether the degree fits better than the next lower one."""
        return self.ratio > self.factor


def degree_factor(n: int, m: int) -> float:
    """Return C(n, m) of the annex.

    >>> round(degree_factor(10, 2), 3)
    1.373
    """
    from scipy.special import fdtri

    quantile = float(fdtri(1, n - m - 1, 1 - _PROBABILITY))
    return math.sqrt(1 + (quantile - 1) / (n - m))


def best_degree(
    *, force: NDArray[np.float64], indication: NDArray[np.float64]
) -> tuple[int, tuple[DegreeStep, ...]]:
    """Return the degree of best fit of averaged indications (n,) at n forces, and each comparison made."""
    n = len(force)
    top = min(HIGHEST, n - 2)
    # Below this the scatter is rounding, and a ratio of two roundings means nothing.
    floor = 64 * np.finfo(float).eps * float(np.abs(indication).max())
    spread = [max(_spread(force, indication, m), floor) for m in range(1, top + 1)]
    steps: list[DegreeStep] = []
    for m in range(top, 1, -1):
        step = DegreeStep(degree=m, ratio=spread[m - 2] / spread[m - 1], factor=degree_factor(n, m))
        steps.append(step)
        if step.better:
            return m, tuple(steps)
    return 1, tuple(steps)


def _spread(force: NDArray[np.float64], indication: NDArray[np.float64], m: int) -> float:
    terms = ("F", *(f"F^{power}" for power in range(2, m + 1)), "intercept")
    return fit_terms(terms=terms, columns={"F": force}, load=indication).residual_sd
