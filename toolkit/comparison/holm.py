"""Decisions over a whole table: Holm's step-down procedure (Scand. J. Statist. 6, 1979, 65-70).

Of m hypotheses, ordered by p, the i-th smallest is multiplied by m - i + 1; the largest so far stands. The
chance of even one false decision in the table is then at most the level, whatever the dependence.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def holm(p: Sequence[float | None]) -> tuple[float | None, ...]:
    """Return adjusted p values; those that are None were not decided and do not count.

    >>> [round(x, 10) for x in holm([0.01, 0.04, 0.03])]
    [0.03, 0.06, 0.06]
    """
    places = [i for i, one in enumerate(p) if one is not None]
    found: list[float | None] = [None] * len(p)
    values = np.array([p[i] for i in places], dtype=np.float64)
    order = np.argsort(values, kind="stable")
    adjusted = np.maximum.accumulate(values[order] * (len(values) - np.arange(len(values))))
    for rank, place in enumerate(order):
        found[places[place]] = float(min(adjusted[rank], 1.0))
    return tuple(found)
