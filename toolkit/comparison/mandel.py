"""Mandel's h and k: which laboratory lies apart, and which scatters more than the others (ISO 5725-2, 7.3.1).

    h = (y - m) / s       m, s: mean and standard deviation of the p laboratories' means y
    k = s_i / s_r         s_r: the repeatability, pooled over all laboratories

At level a, two-sided for h and one-sided for k, with F of n_i - 1 and N - n_i degrees of freedom of N in all:

    |h| > (p - 1) t / sqrt(p (p - 2 + t^2))         t of p - 2 degrees of freedom, a / 2 above it
    k > sqrt(N F / (N - n_i + n_i F)), where n_i and N count degrees of freedom

For equal numbers of results that is the standard's table of critical values; for different ones each
laboratory has a limit of its own. 5 % tells a straggler, 1 % an outlier.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

Departure = Literal["straggler", "outlier"]
STRAGGLER, OUTLIER = 0.05, 0.01
FEWEST = 3
"""Laboratories below which h says nothing: of two it is 0.71, whatever they report."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Consistency:
    """A laboratory's h and k, None where there are too few laboratories or repeats, and what they tell."""

    h: float | None
    k: float | None
    h_departure: Departure | None
    k_departure: Departure | None


def consistencies(results: Sequence[Sequence[float]]) -> tuple[Consistency, ...]:
    """Return h and k of every laboratory from its results, their numbers equal or not.

    >>> [round(laboratory.h, 3) for laboratory in consistencies([[1.0], [2.0], [6.0]])]
    [-0.756, -0.378, 1.134]
    """
    means = np.array([math.fsum(values) / len(values) for values in results])
    p, scatter = len(means), float(means.std(ddof=1)) if len(means) > 1 else 0.0
    dofs = [len(values) - 1 for values in results]
    squares = [float(np.sum((np.array(values) - np.mean(values)) ** 2)) for values in results]
    repeated = sum(dof > 0 for dof in dofs) > 1 and sum(squares) > 0
    s_r = math.sqrt(sum(squares) / sum(dofs)) if repeated else math.nan
    laboratories = []
    for mean, dof, square in zip(means, dofs, squares, strict=True):
        h = float((mean - means.mean()) / scatter) if p >= FEWEST and scatter > 0 else None
        k = math.sqrt(square / dof) / s_r if repeated and dof else None
        h_limits = [h_limit(p, level) for level in (STRAGGLER, OUTLIER)] if h is not None else []
        k_limits = [k_limit(dof, sum(dofs), level) for level in (STRAGGLER, OUTLIER)] if k is not None else []
        laboratories.append(
            Consistency(h=h, k=k, h_departure=_departure(h, h_limits), k_departure=_departure(k, k_limits))
        )
    return tuple(laboratories)


def _departure(statistic: float | None, limits: Sequence[float]) -> Departure | None:
    if statistic is None:
        return None
    straggler, outlier = limits
    if abs(statistic) > outlier:
        return "outlier"
    return "straggler" if abs(statistic) > straggler else None


def h_limit(laboratories: int, level: float) -> float:
    """Return the critical value of |h| of three laboratories or more.

    >>> round(h_limit(10, 0.01), 2), round(h_limit(10, 0.05), 2)
    (2.18, 1.8)
    """
    from scipy.special import stdtrit

    p = laboratories
    t = float(stdtrit(p - 2, 1 - level / 2))
    return (p - 1) * t / math.sqrt(p * (p - 2 + t * t))


def k_limit(dof: int, total: int, level: float) -> float:
    """Return the critical value of k: ``dof`` of the laboratory and ``total`` of all, it among them.

    >>> round(k_limit(1, 10, 0.01), 2), round(k_limit(2, 20, 0.05), 2)  # ten of two, of three results
    (2.32, 1.68)
    """
    from scipy.special import fdtri

    F = float(fdtri(dof, total - dof, 1 - level))
    return math.sqrt(total * F / (total - dof + dof * F))
