"""Estimate: a value with its standard uncertainty, the result type of the GUM (JCGM 100:2008)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """A measured or fitted value.

    Attributes
    ----------
    value : the best estimate, in ``unit``
    u : standard uncertainty (coverage factor 1), in ``unit``
    dof : effective degrees of freedom; infinite where a type B statement is taken as certain
    unit : unit of value and u
    """

    value: float
    u: float
    unit: str
    dof: float = math.inf

    def expanded(self, probability: float = 0.95) -> tuple[float, float]:
        """Return (U, k): expanded uncertainty and coverage factor from Student's t (GUM G.6.4).

        >>> U, k = Estimate(value=1.0, u=0.5, unit="N", dof=10).expanded()
        >>> round(k, 3), round(U, 3)
        (2.228, 1.114)
        """
        k = coverage_factor(self.dof, probability)
        return k * self.u, k

    def scaled(self, factor: float, unit: str) -> Estimate:
        """Return the estimate times an exact factor, in another unit."""
        return Estimate(value=self.value * factor, u=self.u * abs(factor), unit=unit, dof=self.dof)


@lru_cache(maxsize=256)
def coverage_factor(dof: float, probability: float = 0.95) -> float:
    """Return Student's t for a two-sided coverage probability.

    Degrees of freedom are truncated to a whole number as in GUM G.4.1; one that is whole but for
    rounding counts as whole. Below one there is no interval.

    >>> round(coverage_factor(math.inf), 4)
    1.96
    """
    from scipy.special import ndtri, stdtrit

    tail = 0.5 + probability / 2
    if math.isnan(dof) or dof < 1 - 1e-9:
        return math.nan
    return float(ndtri(tail)) if math.isinf(dof) else float(stdtrit(math.floor(dof * (1 + 1e-9)), tail))


def effective_dof(contributions: list[tuple[float, float]]) -> float:
    """Return the Welch-Satterthwaite degrees of freedom of (u_i, dof_i) (GUM G.4.1).

    >>> effective_dof([(3.0, 10.0), (4.0, math.inf)])
    77.16049382716...
    """
    total = sum(u * u for u, _ in contributions)
    bottom = sum(u**4 / dof for u, dof in contributions if not math.isinf(dof))
    return math.inf if bottom == 0 else total * total / bottom
