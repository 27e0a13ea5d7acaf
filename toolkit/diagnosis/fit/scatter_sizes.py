"""Sizes of the zeros and gains by which runs scatter, those that make the runs likeliest.

The likelihood has ridges where a run shows little of its gain or all of it at once, so that no slope is
followed: sizes are taken from a grid and then moved by factors that shrink. None is a size of the grid too,
and stays none.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np

from toolkit.diagnosis.policy import SCATTER

if TYPE_CHECKING:
    from toolkit.arrays import Array

_GRID = 9  # sizes of a scatter that are tried first
_STEPS = (3.0, 1.7, 1.3, 1.14, 1.07)  # factors by which it then moves


class WhitenedRun(Protocol):
    """One output of one run, whitened by its noise."""

    @property
    def rest(self) -> float:
        """Sum of squares of what is left."""

    @property
    def inner(self) -> Array:
        """Products of the constant and the simulated output with themselves (2, 2)."""


def likeliest_sizes(
    runs: Sequence[WhitenedRun], likelihood: Callable[[float, float], float]
) -> tuple[float, float]:
    """Return the sizes of zeros and gains at the largest ``likelihood`` of such a pair.

    They are tried from below what a run can show to all that it leaves.
    """
    largest = math.sqrt(max(run.rest for run in runs))
    shown = np.sqrt(np.max([np.diag(run.inner) for run in runs], axis=0))
    zeros, gains = (
        [
            0.0,
            *(
                np.geomspace(SCATTER.least, max(largest, 2 * SCATTER.least), _GRID) / max(each, 1e-150)
            ).tolist(),
        ]
        for each in shown.tolist()
    )
    best = max(itertools.product(zeros, gains), key=lambda sizes: likelihood(*sizes))
    for step in _STEPS:
        factors = itertools.product((1.0, step, 1 / step), repeat=2)
        nearby = [(best[0] * of_zeros, best[1] * of_gains) for of_zeros, of_gains in factors]
        best = max(nearby, key=lambda sizes: likelihood(*sizes))
    return best
