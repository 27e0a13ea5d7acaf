"""Significance: the p values of single tests, and decisions over a whole table by Holm's procedure.

Holm's step-down procedure (Scand. J. Statist. 6, 1979, 65-70): of m hypotheses, ordered by p, the i-th
smallest is multiplied by m - i + 1; the largest so far stands. The chance of even one false decision in the
table is then at most the level, whatever the dependence.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def holm(p: Sequence[float | None]) -> tuple[float | None, ...]:
    """Return adjusted p values; those that are None were not decided and do not count.

    >>> [round(x, 10) for x in holm([0.01, 0.04, 0.03])]
    [0.03, 0.06, 0.06]
    """
    places = [place for place, value in enumerate(p) if value is not None]
    adjusted: list[float | None] = [None] * len(p)
    values = np.array([p[place] for place in places], dtype=np.float64)
    order = np.argsort(values, kind="stable")
    largest = np.maximum.accumulate(values[order] * (len(values) - np.arange(len(values))))
    for rank, index in enumerate(order):
        adjusted[places[index]] = float(min(largest[rank], 1.0))
    return tuple(adjusted)


def two_sided_p(value: float, u: float, dof: float) -> float | None:
    """Return the two-sided p of a value that has standard uncertainty ``u`` being zero; None without one.

    Student's t; normal for infinite degrees of freedom.
    """
    from scipy.special import ndtr, stdtr

    if not u > 0 or math.isnan(dof):
        return None
    t = -abs(value) / u
    return float(2 * (ndtr(t) if math.isinf(dof) else stdtr(dof, t)))


def grubbs_p(values: NDArray[np.float64]) -> float | None:
    """Return the two-sided p of the value farthest from the mean (Grubbs, Technometrics 11, 1969, 1-21).

    None for fewer than three values, or values that are all the same.

    >>> round(grubbs_p(np.array([0.0, 0.1, -0.1, 0.05, 5.0])), 4) < 0.01
    True
    """
    from scipy.special import stdtr

    n, s = len(values), float(values.std(ddof=1)) if len(values) > 1 else 0.0
    if n < 3 or s <= 0:
        return None
    G = float(np.max(np.abs(values - values.mean()))) / s
    remainder = (n - 1) ** 2 - n * G * G
    if remainder <= 0:
        return 0.0
    t = math.sqrt(n * (n - 2) * G * G / remainder)
    return min(1.0, 2 * n * float(stdtr(n - 2, -t)))
