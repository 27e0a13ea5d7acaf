"""The covariance of a joint fit: of generalised least squares, or the sandwich of ordinary ones."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.fit.noise import Autoregression, Layout, autocovariance, whiten

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Stacked = dict[str, NDArray[np.float64]]

_OPEN = 1e12  # variance, in searched units, of what the data leave open altogether


def covariance(
    J: Stacked,
    prior: NDArray[np.float64],
    sizes: NDArray[np.float64],
    layouts: dict[str, Layout],
    noise: dict[str, Autoregression],
    *,
    plain: bool,
) -> NDArray[np.float64]:
    """Return the covariance of (p, effects' parameters) in their units.

    Of ordinary least squares it is the sandwich with the residual's autocovariance in it.

    Parameters
    ----------
    J : of every output over all rows, d(simulated)/d(x), (rows, k); x are the parameters over ``sizes``
    prior : rows of the priors, (free, k)
    """
    if not len(sizes):
        return np.zeros((0, 0))
    parts, spread = [], prior.T @ prior
    for name, where in layouts.items():
        columns = J[name][where.index]
        if plain:
            weight = 1 / (noise[name].marginal_sd ** 2 * noise[name].correlation_rows)
            parts.append(columns * math.sqrt(weight))
            spread = spread + weight**2 * columns.T @ _correlated(columns, where, noise[name])
        else:
            parts.append(whiten(columns, where, noise[name]))
    rows = np.vstack([*parts, prior])
    size = np.sqrt((rows**2).sum(axis=0))
    size[size == 0] = 1.0
    _, s, vt = np.linalg.svd(rows / size, full_matrices=False)
    keep = s > 1e-10 * s.max()
    inverse = (vt[keep].T / s[keep] ** 2) @ vt[keep]
    if plain:
        inverse = inverse @ (spread / np.outer(size, size)) @ inverse
    if not keep.all():
        inverse[np.diag_indices_from(inverse)] += np.where(np.abs(vt[~keep]).max(axis=0) > 0.1, _OPEN, 0.0)
    scale = sizes / size
    return np.asarray(inverse * np.outer(scale, scale))


def _correlated(columns: NDArray[np.float64], where: Layout, noise: Autoregression) -> NDArray[np.float64]:
    """Return the noise's covariance matrix times columns, segment by segment."""
    from scipy.signal import fftconvolve

    products = np.empty_like(columns)
    for segment in where.segments:
        n = segment.stop - segment.start
        gamma = autocovariance(noise, n)
        kernel = np.concatenate([gamma[:0:-1], gamma])[:, None]
        products[segment] = fftconvolve(columns[segment], kernel, mode="full", axes=0)[n - 1 : 2 * n - 1]
    return products
