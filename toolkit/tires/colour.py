"""What coloured and unlike noise does to fits of single curves: their covariance, and how well it is known.

The rows of a sweep repeat themselves. Least squares then has the covariance (Gauss-Markov, unweighted)

    s^2 (X'X)^-1 X'R X (X'X)^-1,    s^2 = r'r / tr(M R),    M = 1 - X (X'X)^-1 X'

with R the correlation of the rows: a fit takes slow noise for a part of its curve, so that its residuals r
are smaller than the noise, and tr(M R) says by how much. R is that of a first-order autoregression, between
the standard deviations of rows that scatter unlike (`toolkit.tires.unlike`). Its
coefficient is not known either: its restricted likelihood (Patterson and Thompson, Biometrika 58 (1971) 545),
which unlike the residuals' own correlation allows for the fit, is a weight for each value, and the
covariance is the mean over them. Degrees of freedom are Satterthwaite's (Biometrics Bulletin 2 (1946) 110):
twice the squared mean of a variance over its own variance, from s^2 (tr(M R)^2 / tr(M R M R) degrees) and
from the coefficient, for each quantity by itself: a level depends on it more than a slope does. Three nodes
of Gauss and Hermite in arctanh of the coefficient stand for its weights. Residuals whose summed correlations
go beyond what these weights allow are slower than an autoregression of first order: the nodes move there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.tires.unlike import unlike_rows

# The autocorrelation of a fit's residuals: by how many rows they repeat themselves.


ROWS = 40  # fewer rows give noise for an estimate of one time
_FEWEST = 18  # rows for the weights of all coefficients: three to each parameter of a curve
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
    squares = [block @ block.transpose(0, 2, 1) for block in (later, earlier, head)]
    rho = RHO[:, None, None]
    M = squares[0][:, None] - rho * (lag + lag.transpose(0, 2, 1))[:, None]
    M = M + rho**2 * squares[1][:, None] + (1 - rho**2) * squares[2][:, None]
    A = M[..., :p, :p] + 1e-9 * np.eye(p)
    b = M[..., :p, p]
    rss = M[..., p, p] - np.vecdot(b, np.linalg.solve(A, b[..., None])[..., 0])
    _, logdet = np.linalg.slogdet(A)
    remaining = (lengths - p)[:, None]
    likelihood = -remaining * np.log(np.maximum(rss, 1e-300)) - logdet + np.log(1 - RHO**2)
    return np.asarray(0.5 * likelihood)


_NODES = np.array([-np.sqrt(3.0), 0.0, np.sqrt(3.0)])
_WEIGHTS = np.array([1.0, 4.0, 1.0]) / 6.0
_Z = np.arctanh(RHO)
_BEYOND = 2.0  # standard deviations
_RIDGE = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Noise:
    """The noise of (curves,): ``variance`` of a row of weight one and its ``dof``, infinite where known.

    ``time`` rows that repeat each other, 1 for white noise; ``coloured`` (k,) the curves where it is more,
    with ``information`` (k, p, p) that their rows hold of the parameters, and ``largest`` (k,) the variance
    along the worst direction of parameters; rows that scatter unlike are among them. ``factor`` (k, p, p),
    ``nodes`` (3, k, p, p), ``own_dof`` (3, k) and ``sizes`` are what `dof_of` needs.
    """

    variance: Array
    dof: Array
    time: Array
    coloured: NDArray[np.intp]
    information: Array
    largest: Array
    factor: Array
    nodes: Array
    own_dof: Array
    sizes: Sizes

    def dof_of(self, gradients: Array) -> Array:
        """Return degrees of freedom (k, m) of m quantities of the coloured curves by gradients (k, m, p)."""
        a = np.linalg.solve(self.factor, gradients.transpose(0, 2, 1))
        V = np.einsum("kpm,nkpq,kqm->nkm", a, self.nodes, a)
        unsure = self.sizes.unsure(np.einsum("kpm,kjpq,kqm->kjm", a, self.sizes.moved, a))
        dof = _satterthwaite(V, self.own_dof, unsure)
        return np.where(np.isinf(self.dof[self.coloured])[:, None], np.inf, dof)


def noise_of(
    residual: Array,
    columns: Array,
    lengths: NDArray[np.intp],
    cost: Array,
    known: Array,
    parts: Array | None = None,
) -> Noise:
    """Return the noise of fits.

    Parameters
    ----------
    residual : (curves, points) weighted, in the order of recording, zero beyond a curve's own ``lengths``
    columns : (curves, p, points) weighted derivatives of the model, zero there too
    cost : (curves,) sum of squares that stands for the noise
    known : (curves,) variance known beforehand, a floor; NaN for none
    parts : (curves, k, points) of `unlike_rows`; the rows of a curve scatter alike without them, where they
        are few, and where their variance is known beforehand
    """
    p = columns.shape[1]
    variance = np.fmax(cost / (lengths - p), known)
    # A variance that scatter does not raise is known; else it rests on the rows.
    dof = np.where(np.nan_to_num(known) >= variance, np.inf, lengths - p + 0.0)
    time = np.ones(len(lengths))
    inside = np.arange(residual.shape[1]) < lengths[:, None]
    r = (residual - (residual.sum(axis=1) / lengths)[:, None]) * inside
    total = np.vecdot(r, r)
    first = np.vecdot(r[:, 1:], r[:, :-1]) / np.where(total > 0, total, 1.0)
    root = 1.0 / np.sqrt(lengths)
    enough = (lengths >= _FEWEST) & (total > 0)
    repeats = enough & (first >= root - p / lengths)
    slow = np.ones(len(lengths))
    for i in np.flatnonzero(repeats & (first >= 2 * root)):
        slow[i] = summed_time(r[i, : lengths[i]])
    alone = [residual.copy(), columns.copy()]
    if parts is not None and (own := np.flatnonzero(repeats)).size:
        # Sizes are told by rows that do not repeat each other; they change slowly along a recording.
        part = _Part(residual[own], columns[own], lengths[own], inside[own].astype(np.float64))
        rho = part.nodes(slow[own])[1]
        for rows, before in zip(alone, (residual, columns), strict=True):
            by = rho.reshape(-1, *(1,) * (rows.ndim - 1))
            rows[own, ..., 1:] -= by * before[own][..., :-1]
            rows[own, ..., 1:] /= np.sqrt(1 - by**2)
            rows[own] *= inside[own].reshape(len(own), *(1,) * (rows.ndim - 2), -1)
    unlike, variances, covariance = _unlike(alone[0], alone[1], parts, enough & np.isnan(known))
    coloured = np.flatnonzero(repeats | unlike)
    if not len(coloured):
        return Noise(
            variance=variance, dof=dof, time=time, coloured=coloured,
            information=np.zeros((0, p, p)), largest=np.zeros(0), factor=np.zeros((0, p, p)),
            nodes=np.zeros((3, 0, p, p)), own_dof=np.zeros((3, 0)), sizes=Sizes.none(p),
        )  # fmt: skip
    each = inside[:, None] * 1.0 if parts is None else parts
    size = np.einsum("ck,ckn->cn", variances, each)[coloured]
    size = np.sqrt(size * (lengths[coloured] / size.sum(axis=1))[:, None])
    part = _Part(residual[coloured], columns[coloured], lengths[coloured], size)
    rho = np.where(repeats[coloured], part.nodes(slow[coloured]), 0.0)
    nodes, s2, own_dof = part.spread(rho, cost[coloured], known[coloured])
    mean = np.einsum("n,nkpq->kpq", _WEIGHTS, nodes)
    sizes = Sizes(
        variances=variances[coloured],
        covariance=covariance[coloured],
        moved=np.einsum("kpn,kjn,kqn->kjpq", part.basis, each[coloured], part.basis),
        dof=part.spread(np.zeros_like(rho[:1]), cost[coloured], known[coloured])[2][0],
    )
    unsure = sizes.unsure(np.einsum("kjpp->kj", sizes.moved)[..., None])
    worst = _satterthwaite(np.einsum("nkpp->nk", nodes)[..., None], own_dof, unsure)[:, 0]
    time[coloured] = _WEIGHTS @ ((1 + rho) / (1 - rho))
    variance[coloured] = _WEIGHTS @ s2
    dof[coloured] = np.where(np.isinf(dof[coloured]), np.inf, worst)
    return Noise(
        variance=variance,
        dof=dof,
        time=time,
        coloured=coloured,
        information=part.factor @ np.linalg.solve(mean, part.factor.transpose(0, 2, 1)),
        largest=np.linalg.eigvalsh(mean)[:, -1],
        factor=part.factor,
        nodes=nodes,
        own_dof=own_dof,
        sizes=sizes,
    )


def _unlike(
    residual: Array, columns: Array, parts: Array | None, asked: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], Array, Array]:
    # Which curves have rows that scatter unlike (curves,); variances of the parts and their covariance.
    count = 1 if parts is None else parts.shape[1]
    variances, covariance = np.zeros((len(asked), count)), np.zeros((len(asked), count, count))
    variances[:, 0] = 1.0
    if parts is not None and asked.any():
        found = unlike_rows(residual[asked], columns[asked], parts[asked])
        variances[asked], covariance[asked] = found.variances, found.covariance
    return np.asarray((variances[:, 1:] > 0).any(axis=1)), variances, covariance


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sizes:
    """What is not known of how unlike the rows of the coloured curves (k,) scatter.

    ``variances`` (k, j) of the parts and their ``covariance`` (k, j, j); ``moved`` (k, j, p, p) what a unit
    of each leaves in basis @ noise; ``dof`` of a row's variance where the shares of the parts are known.
    """

    variances: Array
    covariance: Array
    moved: Array
    dof: Array

    @classmethod
    def none(cls, p: int) -> Sizes:
        """Return that of no curve with p parameters."""
        return cls(
            variances=np.zeros((0, 1)), covariance=np.zeros((0, 1, 1)),
            moved=np.zeros((0, 1, p, p)), dof=np.zeros(0),
        )  # fmt: skip

    def unsure(self, by: Array) -> Array:
        """Return the relative variance of variances (k, m) by (k, j, m), beyond that of a common factor."""
        value = np.einsum("kj,kjm->km", self.variances, by)
        square = np.einsum("kjm,kji,kim->km", by, self.covariance, by)
        relative = square / np.maximum(value**2, 1e-300)
        return np.asarray(np.maximum(relative - 2 / self.dof[:, None], 0.0))


def _satterthwaite(V: Array, own_dof: Array, unsure: Array) -> Array:
    # Degrees of freedom (k, m) of variances (nodes, k, m) that have `own_dof` (nodes, k) each, and what is
    # `unsure` (k, m) of the shares of their parts.
    mean = np.einsum("n,nkm->km", _WEIGHTS, V)
    apart = (V - mean) ** 2 + 2 * V**2 / own_dof[..., None]
    spread = np.einsum("n,nkm->km", _WEIGHTS, apart) + unsure * mean**2
    return np.asarray(np.maximum(2 * mean**2 / spread, 1.0))


class _Part:
    # The coloured curves with an orthonormal basis of their columns: columns = factor @ basis. ``size`` is
    # the standard deviation of each row over the root of their mean square, zero beyond a curve's length.
    def __init__(self, residual: Array, columns: Array, lengths: NDArray[np.intp], size: Array) -> None:
        self.residual, self.lengths, self.size = residual, lengths, size
        normal = columns @ columns.transpose(0, 2, 1)
        size = np.sqrt(np.einsum("cpp->cp", normal)) + 1e-300
        unit = normal / (size[:, :, None] * size[:, None, :])
        np.einsum("cpp->cp", unit)[...] += _RIDGE
        lower = np.linalg.cholesky(unit)
        self.factor = size[:, :, None] * lower
        self.basis = np.linalg.solve(lower, columns / size[:, :, None])

    def nodes(self, slow: Array) -> Array:
        """Return coefficients (3, curves); ``slow`` is the time of the summed correlations."""
        over = np.where(self.size > 0, 1.0 / np.where(self.size > 0, self.size, 1.0), 0.0)
        likelihood = restricted_likelihood(self.residual * over, self.basis * over[:, None], self.lengths)
        weight = np.exp(likelihood - likelihood.max(axis=1, keepdims=True))
        weight /= weight.sum(axis=1, keepdims=True)
        middle = weight @ _Z
        width = np.sqrt(np.maximum(weight @ _Z**2 - middle**2, 0.0))
        # The arctanh of the coefficient that has this time.
        slower = 0.5 * np.log(slow)
        middle = np.where(slower > middle + _BEYOND * width, slower, middle)
        return np.asarray(np.tanh(np.maximum(middle + _NODES[:, None] * width, 0.0)))

    def spread(self, rho: Array, cost: Array, known: Array) -> tuple[Array, Array, Array]:
        """Return of each node the covariance of basis @ noise, a row's variance, its degrees of freedom."""
        size = self.size[:, None]
        moved = _correlated(self.basis * size, rho, self.lengths) * size
        G = moved @ self.basis.transpose(0, 2, 1)  # (nodes, curves, p, p)
        n = self.lengths
        trace = np.einsum("kcpp->kc", G)
        remaining = np.maximum(n - trace, 1.0)
        squares = np.broadcast_to(size**2, (len(rho), *size.shape))
        square = np.einsum("kcpn,kcpn->kc", squares, _correlated(size**2, rho**2, n))
        square -= 2 * np.einsum("kcpn,kcpn->kc", moved, moved)
        square = np.maximum(square + np.einsum("kcpq,kcqp->kc", G, G), 1e-300)
        s2 = np.fmax(cost / remaining, known)
        return s2[..., None, None] * G, s2, remaining**2 / square


def _correlated(rows: Array, rho: Array, lengths: NDArray[np.intp]) -> Array:
    # The product with the correlation matrix rho^|i - j|: (nodes, curves, p, points), zero beyond a curve's
    # length. Its inverse is tridiagonal, over 1 - rho^2: 1 + rho^2 (1 at both ends) and -rho beside.
    from scipy.linalg.lapack import dptsv

    products = np.zeros((len(rho), *rows.shape))
    for curve, n in enumerate(lengths):
        right = rows[curve, :, :n].T
        for node, correlation in enumerate(rho[:, curve].tolist()):
            diagonal = np.full(n, 1.0 + correlation * correlation)
            diagonal[0] = diagonal[-1] = 1.0
            product = dptsv(diagonal, np.full(n - 1, -correlation), right)[2]
            products[node, curve, :, :n] = (1.0 - correlation * correlation) * product.T
    return products
