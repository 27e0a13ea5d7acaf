"""What the best of a whole search is worth: the null distribution of its largest statistic.

Under the null the whitened residual is Gaussian and has lost what the nominal parameters can fit. The
statistics of all candidates and starts are then quadratic forms of one Gaussian vector, whose covariance is
the Gram matrix of their responses; so their joint distribution is drawn, not bounded, and the p-value of
the best one has the whole search in it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.policy import SCREENING

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.diagnosis.search.screen import LinearisedFit


def search_p_values(
    screen: LinearisedFit, blocks: Sequence[NDArray[np.float64]], gains: Sequence[float], seed: int
) -> list[float]:
    """Return for every statistic the chance that a search without an effect finds one as improbable.

    Parameters
    ----------
    blocks : orthonormal whitened responses of every candidate and start, (values, k)
    gains : their gains of twice the log-likelihood, each times its trust
    """
    if not blocks:
        return []
    widths = [block.shape[1] for block in blocks]
    stacked = np.hstack(blocks)
    gram = stacked.T @ stacked
    values, vectors = np.linalg.eigh(gram)
    keep = values > 1e-9 * max(float(values.max()), 1e-300)
    root = vectors[:, keep] * np.sqrt(values[keep])
    n = screen.n
    dof = max(n - screen.sizes.size - int(keep.sum()), 1)
    rng = np.random.default_rng(seed)
    normal = rng.standard_normal((SCREENING.draws, root.shape[1]))
    z = normal @ root.T
    total = (normal**2).sum(axis=1) + rng.chisquare(dof, SCREENING.draws)
    smallest = np.full(SCREENING.draws, math.inf)
    starts = np.cumsum([0, *widths[:-1]])
    for width in sorted(set(widths) - {0}):
        chosen = starts[[i for i, start_width in enumerate(widths) if start_width == width]]
        part = sum(z[:, chosen + k] ** 2 for k in range(width))
        share = np.asarray(part) / total[:, None]
        statistic = -n * np.log1p(-np.minimum(share, 1 - 1e-9))
        smallest = np.minimum(smallest, _log_p(statistic.max(axis=1), width))
    smallest.sort()
    p_values = []
    for gain, width in zip(gains, widths, strict=True):
        p = float(_log_p(np.array([max(gain, 0.0)]), max(width, 1))[0])
        below = int(np.searchsorted(smallest, p, side="right"))
        if below >= SCREENING.fewest_draws:
            p_values.append((below + 1) / (SCREENING.draws + 1))
        else:
            # Beyond what was drawn: Bonferroni on as many independent tests as the drawn tail shows.
            tail = float(smallest[int(SCREENING.tail * SCREENING.draws)])
            p_values.append(min(1.0, math.exp(min(0.0, p - tail)) * SCREENING.tail))
    return p_values


def _log_p(statistic: NDArray[np.float64], dof: int) -> NDArray[np.float64]:
    """Return the logarithm of chi-squared's upper tail; far out by its leading term."""
    from scipy.special import gammaincc, gammaln

    half = 0.5 * statistic
    tail = gammaincc(0.5 * dof, half)
    far = (0.5 * dof - 1) * np.log(np.maximum(half, 1e-300)) - half - gammaln(0.5 * dof)
    return np.where(tail > 1e-290, np.log(np.maximum(tail, 1e-300)), far)
