"""How much real runs differ: the log score of rows that no fit has seen, zeros and gains of runs in it.

Two recordings of the same thing never agree to their noise: a zero moves, a gain does, and what a
simulation leaves on an unseen run is larger than on those it was fitted to. A score that takes its noise
from the training rows alone throws away an effect that is right in every run but a little off in one.

Here a held-out run's residual has a zero and a gain of its own beside its noise, both normal over the runs.
How much they scatter, and how much larger the noise is than on the training rows, is what makes all held-out
runs together most likely (empirical Bayes). Each hypothesis has its own scatter: one that leaves the same
zero in every run pays for it.

Source: Laird and Ware, Biometrics 38 (1982) 963, random effects with a variance of their own.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.fit.noise import Autoregression, Layout, log_likelihood, whiten
from toolkit.diagnosis.policy import SCATTER

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_GRID = 9  # sizes of a scatter that are tried first
_STEPS = (3.0, 1.7, 1.3, 1.14, 1.07)  # factors by which it then moves


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class UnseenRun:
    """One output of one run that a fit has not seen, in units of the noise of its training rows.

    Attributes
    ----------
    n : values
    constant : logarithm of the density of values without any residual, that of the noise's scale in it
    rest : sum of squares of the innovations
    inner : products of the whitened constant and simulated output with themselves, (2, 2)
    outer : their products with the innovations, (2,)
    """

    n: int
    constant: float
    rest: float
    inner: Array
    outer: Array

    @staticmethod
    def of(residual: Array, simulated: Array, where: Layout, noise: Autoregression) -> UnseenRun:
        """Return a run from its kept values (n,) and their layout."""
        size = math.sqrt(float(np.mean(simulated**2))) or 1.0
        stacked = np.stack([residual, np.ones(where.n), simulated / size], axis=1)
        white = whiten(stacked, where, noise)
        columns, innovations = white[:, 1:], white[:, 0]
        rest = float(innovations @ innovations)
        return UnseenRun(
            n=where.n,
            constant=log_likelihood(residual, where, noise) + 0.5 * rest,
            rest=rest,
            inner=columns.T @ columns,
            outer=columns.T @ innovations,
        )


def scattered_scores(runs: Sequence[UnseenRun], *, by_run: bool) -> tuple[float, ...]:
    """Return the log score of every unseen run of one output, under the scatter that makes them most likely.

    Parameters
    ----------
    by_run : whole runs were held out; of blocks of a run nothing says that they have zeros of their own
    """
    if not runs:
        return ()
    best = (0.0, 0.0)
    if by_run and len(runs) >= SCATTER.fewest:
        best = max(_sizes(runs), key=lambda sizes: sum(_scores(runs, *sizes)))
        for step in _STEPS:
            nearby = [
                (best[0] * a, best[1] * b) for a, b in itertools.product((1.0, step, 1 / step), repeat=2)
            ]
            best = max(nearby, key=lambda sizes: sum(_scores(runs, *sizes)))
    return _scores(runs, *best)


def _sizes(runs: Sequence[UnseenRun]) -> list[tuple[float, float]]:
    """Return scatters of zero and gain: none, and from below what a run can show to all that it leaves."""
    largest = math.sqrt(max(run.rest for run in runs))
    seen = np.sqrt(np.max([np.diag(run.inner) for run in runs], axis=0))
    zeros, gains = (
        [0.0, *np.geomspace(SCATTER.least, max(largest, 2 * SCATTER.least), _GRID) / max(one, 1e-150)]
        for one in seen.tolist()
    )
    return [(float(zero), float(gain)) for zero in zeros for gain in gains]


def _scores(runs: Sequence[UnseenRun], zero: float, gain: float) -> tuple[float, ...]:
    """Return the score of every run under a scatter, the noise as large as it then is most likely.

    The scatter is in units of that noise: then its likeliest size has a closed form.
    """
    scale = np.array([zero, gain])
    squares, halves = [], []
    for run in runs:
        # Woodbury: of the covariance 1 + X S X' only a matrix of two rows is left.
        middle = np.eye(2) + scale[:, None] * run.inner * scale[None, :]
        taken = scale * run.outer
        squares.append(max(run.rest - float(taken @ np.linalg.solve(middle, taken)), 0.0))
        halves.append(0.5 * math.log(max(float(np.linalg.det(middle)), 1.0)))
    n = sum(run.n for run in runs)
    noise = math.sqrt(max(sum(squares) / n, 1.0))  # no rows are quieter for not having been seen
    return tuple(
        run.constant - run.n * math.log(noise) - 0.5 * square / noise**2 - half
        for run, square, half in zip(runs, squares, halves, strict=True)
    )
