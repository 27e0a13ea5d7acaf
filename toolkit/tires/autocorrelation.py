"""The autocorrelation of a fit's residuals: by how many rows they repeat themselves.

Rows of a 100 Hz sweep are no independent samples: the variance of what is fitted to them grows by the
integrated autocorrelation time. A fit takes slow noise for a part of its curve, so that its residuals look
less correlated than the noise was; restricted likelihood allows for that.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

ROWS = 40  # fewer rows give noise for an estimate
_SHARE = 8.0  # rows that an estimate of so many repeated rows takes at least
RHO = np.linspace(0.0, 0.98, 50)


def autocorrelation_time(residual: Array, columns: Array | None = None) -> float:
    """Return 1 + 2 sum of the autocorrelations of residuals in the order of recording, at least 1.

    Parameters
    ----------
    residual : (rows,) in the order of recording, weighted
    columns : (parameters, rows) derivatives of the model in the same weights; with them the noise is also
        taken as a first-order autoregression whose coefficient maximises the restricted likelihood
        (Patterson and Thompson, Biometrika 58 (1971) 545), and the larger of the two times counts

    The sum of the autocorrelations ends where a pair of neighbours is no longer positive (Geyer, Statistical
    Science 7 (1992) 473). Few rows give 1.

    >>> autocorrelation_time(np.tile([1.0, -1.0], 50))
    1.0
    """
    n = len(residual)
    if n < ROWS:
        return 1.0
    r = residual - residual.mean()
    total = float(r @ r)
    if total <= 0:
        return 1.0
    first = float(r[1:] @ r[:-1]) / total
    time = summed_time(r) if first >= 2.0 / np.sqrt(n) else 1.0
    if columns is not None and first >= 1.0 / np.sqrt(n) - len(columns) / n:
        likelihood = restricted_likelihood(residual[None], columns[None], np.array([n]))
        best = float(RHO[int(np.argmax(likelihood[0]))])
        time = max(time, (1 + best) / (1 - best))
    return float(np.clip(time, 1.0, n / _SHARE))


def summed_time(r: Array) -> float:
    """Return 1 + 2 sum of the autocorrelations of (rows,) about zero, to where a pair is not positive."""
    n = len(r)
    size = 1 << (2 * n - 1).bit_length()
    spectrum = np.fft.rfft(r, size)
    acov = np.fft.irfft(spectrum * np.conj(spectrum), size)[:n]
    rho = acov / acov[0]
    pairs = rho[: n - n % 2].reshape(-1, 2).sum(axis=1)
    end = int(np.argmax(pairs <= 0)) if (pairs <= 0).any() else len(pairs)
    return 2.0 * float(np.minimum.accumulate(pairs[:end]).sum()) - 1.0


def restricted_likelihood(residual: Array, columns: Array, lengths: NDArray[np.intp]) -> Array:
    """Return the restricted log-likelihood (curves, 50) of the coefficients ``RHO`` of an autoregression.

    Parameters
    ----------
    residual : (curves, points), zero beyond a curve's own ``lengths`` (curves,)
    columns : (curves, p, points) derivatives of the model in the same weights, zero there too
    """
    # Whitened by x_t - rho x_(t-1), every product of rows is a parabola in rho: three matrices serve all.
    rows = np.concatenate([columns, residual[:, None]], axis=1)
    size = np.sqrt(np.vecdot(rows, rows))
    rows = rows / np.where(size > 0, size, 1.0)[..., None]
    p = rows.shape[1] - 1
    earlier = rows[..., :-1].copy()
    # The last row of a padded curve has none after it.
    last = np.arange(earlier.shape[-1]) >= (lengths - 1)[:, None]
    earlier *= ~last[:, None, :]
    later, head = rows[..., 1:], rows[..., :1]
    lag = later @ earlier.transpose(0, 2, 1)
    squares = [one @ one.transpose(0, 2, 1) for one in (later, earlier, head)]
    rho = RHO[:, None, None]
    M = squares[0][:, None] - rho * (lag + lag.transpose(0, 2, 1))[:, None]
    M = M + rho**2 * squares[1][:, None] + (1 - rho**2) * squares[2][:, None]
    A = M[..., :p, :p] + 1e-9 * np.eye(p)
    b = M[..., :p, p]
    rss = M[..., p, p] - np.vecdot(b, np.linalg.solve(A, b[..., None])[..., 0])
    _, logdet = np.linalg.slogdet(A)
    left = (lengths - p)[:, None]
    likelihood = -left * np.log(np.maximum(rss, 1e-300)) - logdet + np.log(1 - RHO**2)
    return np.asarray(0.5 * likelihood)
