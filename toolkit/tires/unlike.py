"""Rows that scatter unlike: what the noise of each recorded input leaves in a response.

Whatever a curve is drawn over was read as well. A slip angle with a noise of its own moves a force by its
slope there, most where the curve is steep and not at all at its peak; a load, or a gain, by the force's own
size. The variance of a row i is

    v_i = sum_k theta_k d_ik,    d_ik = 1, (dy/dSA)_i^2, ...

with variances theta of the noise of the response and of each input, those of the largest restricted
likelihood (Patterson and Thompson, Biometrika 58 (1971) 545) of the residuals of the fit. Least squares stays
what it is; its covariance is (X'X)^-1 X'VX (X'X)^-1. A fixed point of the likelihood's equations, theta_k
times y'P D_k P y over tr(P D_k), keeps every variance non-negative.

A bend of the curve over the noise of its input is a bias beside that, half the second derivative times the
variance: 0.1 deg of noise lowers a cornering stiffness by less than a thousandth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array, taken

_STEPS = 200
_SETTLED = 2e-5  # of the mean variance of a row
_LEVELS = 16  # of a part's root, from nothing to its largest: rows of one level are taken together
_MANY = 40  # rows from which on they are
_RIDGE = 1e-12
_NONE = 1e-6  # of the mean variance of a row: a part below it is none


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Unlike:
    """Of (curves,): ``variances`` (curves, k) of the parts and their ``covariance`` (curves, k, k)."""

    variances: Array
    covariance: Array

    def rows(self, parts: Array) -> Array:
        """Return the variance of each row (curves, points), zero where a curve has none."""
        return np.asarray(np.einsum("ck,ckn->cn", self.variances, parts))


def unlike_rows(residual: Array, columns: Array, parts: Array, *, own: int = 1) -> Unlike:
    """Return the variances of the parts of curves' noise, by the largest restricted likelihood.

    Parameters
    ----------
    residual : (curves, points) weighted, zero beyond a curve's own rows
    columns : (curves, p, points) weighted derivatives of the model, zero there too
    parts : (curves, k, points) what a unit of each variance gives a row; the first ``own`` are those of the
        responses, whose sum is one in a curve's own rows, and all are zero beyond
    """
    n = np.sum(parts[:, :own].sum(axis=1) > 0, axis=1)
    mean = parts.sum(axis=2) / n[:, None]
    size = np.sqrt(np.vecdot(residual, residual) / n) + 1e-300
    # In parts of a row's mean variance, so that all are of one size.
    d = parts / np.where(mean > 0, mean, np.inf)[..., None]
    y = residual / size[:, None]
    X = columns / (np.sqrt(np.vecdot(columns, columns))[..., None] + 1e-300)
    groups = _groups(np.concatenate([X, y[:, None]], axis=1), d, own)
    theta = np.zeros((len(n), parts.shape[1]))
    theta[:, :own] = mean[:, :own]
    alike = _score(theta, groups)
    # Where the residuals of rows alike ask for no further part, there is none.
    further = (mean > 0) & (alike.square > alike.trace)
    asked = further[:, own:].any(axis=1)[:, None] | (np.arange(parts.shape[1]) < own)
    asked &= mean > 0
    theta = np.where(asked, 1.0 / np.maximum(asked.sum(axis=1, keepdims=True), 1), 0.0)
    going = np.arange(len(n))
    if not further[:, own:].any(axis=1).all():
        # A single variance is found in one step, and few steps find those of several responses.
        going = np.flatnonzero(further[:, own:].any(axis=1) | (own > 1))
        alone = np.setdiff1d(np.arange(len(n)), going)
        theta[alone, 0] = alike.square[alone, 0] / alike.trace[alone, 0]
    for _ in range(_STEPS):
        if not len(going):
            break
        score = _score(theta[going], taken(groups, going))
        before = theta[going]
        after = before * np.divide(
            score.square, score.trace, out=np.zeros_like(before), where=score.trace > 0
        )
        theta[going] = after
        going = going[np.abs(after - before).max(axis=1) >= _SETTLED]
    theta = np.where(theta < _NONE * theta.sum(axis=1, keepdims=True), 0.0, theta)
    covariance = _inverse(_score(theta, groups).information(), theta > 0)
    scale = size[:, None] ** 2 / np.where(mean > 0, mean, np.inf)
    return Unlike(variances=theta * scale, covariance=covariance * scale[:, :, None] * scale[:, None, :])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Groups:
    # Rows that scatter about alike, together: of each curve's groups the sums of products of the derivatives
    # and, last, the residual (curves, groups, p + 1, p + 1), their rows (curves, groups), and the mean of
    # each part (curves, k, groups). Of few rows each is a group.
    products: Array
    rows: Array
    d: Array


def _groups(z: Array, d: Array, own: int) -> _Groups:
    inside = (d[:, :own].sum(axis=1) > 0) * 1.0
    if z.shape[2] <= _MANY:
        each = z.transpose(0, 2, 1)
        return _Groups(products=each[..., None] * each[..., None, :], rows=inside, d=d)
    keys = []
    for curve in d:
        top = np.sqrt(curve.max(axis=1, keepdims=True))
        level = np.floor(_LEVELS * np.sqrt(curve) / np.where(top > 0, top, 1.0))
        keys.append(np.unique(level, axis=1, return_inverse=True)[1].reshape(-1))
    count = 1 + max(int(key.max()) for key in keys)
    products = np.zeros((len(z), count, z.shape[1], z.shape[1]))
    rows, means = np.zeros((len(z), count)), np.zeros((*d.shape[:2], count))
    for curve, key in enumerate(keys):
        for group in range(int(key.max()) + 1):
            members = z[curve][:, key == group]
            products[curve, group] = members @ members.T
        rows[curve] = np.bincount(key, inside[curve], count)
        for part, values in enumerate(d[curve]):
            means[curve, part] = np.bincount(key, values, count) / np.maximum(rows[curve], 1)
    return _Groups(products=products, rows=rows, d=means)


def _inverse(information: Array, there: NDArray[np.bool_]) -> Array:
    both = there[:, :, None] & there[:, None, :]
    safe = np.where(both, information, np.eye(there.shape[1]))
    return np.asarray(np.linalg.pinv(safe, hermitian=True) * both)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Score:
    # With P = W - W X' (X W X')^-1 X W, W = 1 / V: y'P D_k P y and tr(P D_k), each (curves, k), and what the
    # information tr(P D_k P D_l) / 2 is made of.
    square: Array
    trace: Array
    groups: _Groups
    weight: Array
    A: Array
    hat: Array

    def information(self) -> Array:
        g = self.groups
        dw = g.d * self.weight[:, None]
        p = len(self.A[0])
        flat = g.products[..., :p, :p].reshape(*g.rows.shape, -1)
        inner = self.A[:, None] @ ((dw * self.weight[:, None]) @ flat).reshape(*dw.shape[:2], p, p)
        each = g.rows - 2 * self.weight * self.hat
        return np.asarray(
            0.5 * ((dw * each[:, None]) @ dw.transpose(0, 2, 1) + np.einsum("ckpq,clqp->ckl", inner, inner))
        )


def _score(theta: Array, g: _Groups) -> _Score:
    v = np.vecmat(theta, g.d)
    weight: Array = np.where(g.rows > 0, 1.0 / np.maximum(v, 1e-9), 0.0)
    p = g.products.shape[-1] - 1
    whole = np.vecmat(weight, g.products.reshape(*g.rows.shape, -1)).reshape(-1, p + 1, p + 1)
    normal = whole[:, :p, :p].copy()
    np.einsum("cpp->cp", normal)[...] += _RIDGE * (1e-300 + weight.max(axis=1))[:, None]
    A = np.linalg.inv(normal)
    beta = np.concatenate([-np.matvec(A, whole[:, :p, p]), np.ones((len(A), 1))], axis=1)
    left = np.vecdot(np.matvec(g.products, beta[:, None]), beta[:, None])
    hat = np.einsum("cgpq,cqp->cg", g.products[..., :p, :p], A)
    return _Score(
        square=np.matvec(g.d, weight**2 * left),
        trace=np.matvec(g.d, weight * g.rows - weight**2 * hat),
        groups=g,
        weight=weight,
        A=np.asarray(A),
        hat=np.asarray(hat),
    )
