"""A robust fit that only points: rows that a resistant regression gives little weight.

Outliers can hide each other: each inflates the scatter by which the other is judged, and no studentised
residual stands out. Tukey's biweight with a scale from the median is not moved by them where it begins among
sound rows: at Huber's estimate, or, where rows contradict the others (`forward_search`), at the fit of the
others, since Huber's is tilted by rows of high leverage. The calibration itself is never fitted so.

The estimates are those of statsmodels' RLM. Its own iteration decomposes all rows anew in each of up to 50
steps, because it waits for a sum over all rows to settle to 1e-8; here one decomposition serves all steps,
and they end when no residual moves any more.

References: Huber and Ronchetti, Robust Statistics (2009), ch. 7; Beaton and Tukey, Technometrics 16 (1974).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.fit.basis import build_basis, inner
from toolkit.calibration.fit.forward_search import contradicting

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    from toolkit.calibration.fit.regression import TermFit

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
    sqrt(1 - leverage). A single row of high leverage can still draw the fit to itself: Cook's distance tells
    that.
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
    design = design if w is None else design * w[:, None]
    q = np.ascontiguousarray(np.linalg.qr(design)[0].T)
    reach = math.sqrt(float(np.einsum("ij,ij->j", q, q).max()))
    stages: tuple[Callable[[NDArray[np.float64]], NDArray[np.float64]], ...] = (_huber, _biweight)
    if wrong := contradicting(design, y):
        sound = np.delete(np.arange(n), np.array(wrong) - 1)
        residuals = y - np.linalg.lstsq(q.T[sound], y[sound], rcond=None)[0] @ q
        stages = (_biweight,)
    for weights_of in stages:
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
