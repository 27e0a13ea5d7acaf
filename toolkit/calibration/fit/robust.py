"""A robust fit that only points: rows that a resistant regression gives little weight.

Two outliers can hide each other: each inflates the scatter by which the other is judged, and no studentised
residual stands out. Huber's estimate from there Tukey's biweight, with a scale from the median, is not moved
by them. The calibration itself is never fitted so.

The estimates are those of statsmodels' RLM. Its own iteration decomposes all rows anew in each of up to 50
steps, because it waits for a sum over all rows to settle to 1e-8; here one decomposition serves all steps,
and they end when no residual moves any more.

References: Huber and Ronchetti, Robust Statistics (2009), ch. 7; Beaton and Tukey, Technometrics 16 (1974);
Hadi and Simonoff, Journal of the American Statistical Association 88 (1993), for the test of a set of rows.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.fit.basis import build_basis, inner

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    from toolkit.calibration.fit.regression import TermFit

SMALL_WEIGHT = 0.05
RISK = 0.002
# Both have 95 % efficiency on normal data.
_HUBER, _TUNING = 1.345, 4.685
_NORMAL_MEDIAN = 0.6744897501960817  # of |z| of a standard normal z
_STEPS = 50
_SETTLED = 1e-6  # of the scale: no weight moves by more than some 1e-6


def robust_weights(
    fit: TermFit, *, columns: Mapping[str, NDArray[np.float64]], load: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """Return the biweight of each row (rows,), 1 in the middle and 0 for a row that is cast out.

    None where the scatter is rounding, or too few rows are left to judge by (fewer than 3 a term). The
    residuals are scaled by 1.4826 median |r| sqrt(n / dof), since p fitted terms shrink them, and by
    sqrt(1 - leverage). A row of high leverage can still draw the fit to itself: Cook's distance tells that.
    """
    n, p = len(load), len(fit.terms)
    if n < 3 * p:
        return None
    w = None if fit.weights is None else np.sqrt(fit.weights)
    design = build_basis(fit.terms, columns).design
    y = load if w is None else load * w
    floor = 1e-12 * float(np.abs(y).max())
    residuals = fit.residuals if w is None else fit.residuals * w
    if math.sqrt(inner(residuals, residuals) / n) <= floor:
        return None
    q, _ = np.linalg.qr(design if w is None else design * w[:, None])
    q = np.ascontiguousarray(q.T)
    reach = math.sqrt(float(np.einsum("ij,ij->j", q, q).max()))
    for weights_of in (_huber, _biweight):
        residuals = _reweighted(q, residuals, weights_of, reach, floor)
    scale = _mad(residuals) * math.sqrt(n / fit.dof)
    if scale <= floor:
        return None
    return _biweight(residuals / (scale * np.sqrt(1 - np.minimum(fit.leverage, 1 - 1e-9))))


def _reweighted(
    q: NDArray[np.float64],
    residuals: NDArray[np.float64],
    weights_of: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    reach: float,
    floor: float,
) -> NDArray[np.float64]:
    """Return the residuals (rows,) of an M-estimate by iteratively reweighted least squares.

    ``q`` (terms, rows) is an orthonormal basis of the design, ``rest`` the residuals to begin with, ``reach``
    the largest length of a row of q: a step of length d moves no residual by more than reach d. The scale is
    the median's, anew in every step.
    """
    for _ in range(_STEPS):
        scale = _mad(residuals)
        if scale <= floor:
            break
        weighted = q * weights_of(residuals / scale)
        try:
            step = np.linalg.solve(weighted @ q.T, np.einsum("ij,j->i", weighted, residuals))
        except np.linalg.LinAlgError:
            break
        residuals = residuals - step @ q
        if reach * float(np.linalg.norm(step)) <= _SETTLED * scale:
            break
    return residuals


def _mad(residuals: NDArray[np.float64]) -> float:
    return float(np.median(np.abs(residuals))) / _NORMAL_MEDIAN


def _huber(z: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(_HUBER / np.maximum(np.abs(z), _HUBER), dtype=np.float64)


def _biweight(z: NDArray[np.float64]) -> NDArray[np.float64]:
    inside = np.maximum(1 - np.square(z / _TUNING), 0.0)
    return np.asarray(inside * inside, dtype=np.float64)


def hidden_outliers(
    fit: TermFit,
    weights: NDArray[np.float64] | None,
    *,
    columns: Mapping[str, NDArray[np.float64]],
) -> tuple[int, ...]:
    """Return the rows (from 1) of small robust weight that the fit without all of them contradicts.

    The median's scale is rough in short sessions, and casts out sound rows. So each row under SMALL_WEIGHT is
    held against the least-squares fit of the others, the whole set left out at once: its deviation over its
    own standard deviation exceeds Student's quantile at RISK over all rows (Bonferroni).
    """
    if weights is None:
        return ()
    out = np.flatnonzero(weights < SMALL_WEIGHT)
    dof = fit.dof - len(out)
    if not len(out) or dof < 2:
        return ()
    from scipy.special import stdtrit

    w = np.ones(len(weights)) if fit.weights is None else np.sqrt(fit.weights)
    q, _ = np.linalg.qr(build_basis(fit.terms, columns).design * w[:, None])
    e = fit.residuals * w
    # Rows left out together: e_out = (1 - H)^-1 e, and so much less is left of the sum of squares.
    spread = np.linalg.pinv(np.eye(len(out)) - q[out] @ q[out].T)
    deviation = spread @ e[out]
    remaining = float(e @ e - e[out] @ deviation)
    if remaining <= 0:
        return ()
    ratio = np.abs(deviation) / np.sqrt(remaining / dof * np.diag(spread))
    limit = float(stdtrit(dof, 1 - RISK / (2 * len(weights))))
    return tuple(int(row) + 1 for row in out[ratio > limit])
