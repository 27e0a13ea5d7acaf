"""A robust fit that only points: rows that a resistant regression gives little weight.

Outliers can hide each other: each inflates the scatter by which the other is judged, and no studentised
residual stands out. Tukey's biweight with a scale from the median is not moved by them where it begins among
sound rows: at Huber's estimate, or, where rows contradict the others, at the fit of the
others, since Huber's is tilted by rows of high leverage. The calibration itself is never fitted so.

The estimates are those of statsmodels' RLM. Its own iteration decomposes all rows anew in each of up to 50
steps, because it waits for a sum over all rows to settle to 1e-8; here one decomposition serves all steps,
and they end when no residual moves any more.

References: Huber and Ronchetti, Robust Statistics (2009), ch. 7; Beaton and Tukey, Technometrics 16 (1974).

Rows that contradict the others are found from the half that agrees best (`contradicting`). Rows that are
wrong together tilt the fit by which they are judged: their own residuals shrink, and those of sound rows
grow. So the search begins at the half of the rows that one equation fits best (least trimmed squares, which
up to half of the rows cannot move) and adds rows in the order in which they agree. It ends where the next one
deviates by more than Student's quantile at `RISK` over all rows: every row beyond that contradicts the
others. A curve does not end it, for its rows depart step by step.

References: Rousseeuw and Van Driessen, Data Mining and Knowledge Discovery 12 (2006), for the half; Hadi and
Simonoff, Journal of the American Statistical Association 88 (1993), for the order and the test.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.calibration.fit.basis import build_basis, inner
from toolkit.calibration.fit.regression import TermFit

# Both have 95 % efficiency on normal data.
_HUBER, _TUNING = 1.345, 4.685
_NORMAL_MEDIAN = 0.6744897501960817  # of |z| of a standard normal z
_STEPS = 50
_SETTLED = 1e-6  # of the scale: no weight moves by more than some 1e-6


def robust_weights(fit: TermFit, *, columns: Mapping[str, Array], load: Array) -> Array | None:
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
    stages: tuple[Callable[[Array], Array], ...] = (_huber, _biweight)
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
    q: Array, residuals: Array, weights_of: Callable[[Array], Array], reach: float, floor: float
) -> Array:
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


def _mad(residuals: Array) -> float:
    return float(np.median(np.abs(residuals))) / _NORMAL_MEDIAN


def _huber(z: Array) -> Array:
    return np.asarray(_HUBER / np.maximum(np.abs(z), _HUBER), dtype=np.float64)


def _biweight(z: Array) -> Array:
    inside = np.maximum(1 - np.square(z / _TUNING), 0.0)
    return np.asarray(inside * inside, dtype=np.float64)


RISK = 0.002  # that a row of a clean session is named
# Equations are drawn until one of sound rows is among them where a third of all rows is wrong, at this risk.
_WRONG, _MISSED, _MOST_DRAWS = 1 / 3, 1e-4, 2000
_CONCENTRATED, _REFINED, _RANKED_BY = 400, 10, 2000
_SEARCH_STEPS = 50
_SEARCH_SETTLED = 1e-9
_UNTOLD = 1e-13  # of the squares of all rows
_SHARE = 100  # rows are added singly up to this many, then by the hundredth part


def contradicting(design: Array, load: Array) -> tuple[int, ...]:
    """Return the rows (from 1) of a design (rows, terms) and a load (rows,) that contradict the others.

    None are named where the rows are under 3 a term, or more than half agree to rounding.
    """
    n, p = design.shape
    if n < 3 * p:
        return ()
    q = np.linalg.qr(design)[0]
    rows = _best_half(q, load)
    while len(rows) < n:
        judged = _judged(q, load, rows)
        if judged is None:
            return ()
        deviation, limit = judged
        order = np.argsort(deviation, kind="stable")
        if deviation[order[len(rows)]] >= limit:
            return tuple((np.flatnonzero(deviation >= limit) + 1).tolist())
        rows = order[: len(rows) + max(1, n // _SHARE)]
        rows = rows[deviation[rows] < limit]
    return ()


def deviating(design: Array, load: Array, wrong: Sequence[int]) -> tuple[int, ...]:
    """Return those of the ``wrong`` rows (from 1) that contradict the other rows on this design too."""
    other_rows = np.delete(np.arange(len(load)), np.array(wrong) - 1)
    if len(other_rows) - design.shape[1] < 1:
        return ()
    judged = _judged(np.linalg.qr(design)[0], load, other_rows)
    return () if judged is None else tuple(row for row in wrong if judged[0][row - 1] >= judged[1])


def _judged(q: Array, load: Array, rows: NDArray[np.intp]) -> tuple[Array, float] | None:
    """Return each row's deviation (rows,) from the equation of some, in its own standard deviations.

    And the least that contradicts them; None where those rows agree to rounding. ``q`` (rows, terms) is an
    orthonormal basis of the design.
    """
    from scipy.special import stdtrit

    core = q[rows]
    # Rows of loads that the core has not: what they alone tell is free, as of a leverage without end.
    inverse = np.linalg.inv(core.T @ core + _UNTOLD * np.eye(q.shape[1]))
    residuals = load - q @ (inverse @ (core.T @ load[rows]))
    dof = len(rows) - q.shape[1]
    scatter = float(np.sqrt(residuals[rows] @ residuals[rows] / dof))
    if scatter <= 1e-12 * float(np.abs(load).max()):
        return None
    # A row inside has drawn the fit to itself, one outside is predicted by it.
    leverage = np.sum(q @ inverse * q, axis=1)
    variance = 1 + leverage
    variance[rows] = np.maximum(1 - leverage[rows], 1e-9)
    deviation = np.abs(residuals) / (scatter * np.sqrt(variance))
    return deviation, float(stdtrit(dof, 1 - RISK / (2 * (len(rows) + 1))))


def _best(q: Array, load: Array, starts: Array) -> Array:
    """Return the best of some equations (equations, terms), as a sample of long sessions ranks them."""
    if len(load) > _RANKED_BY:
        sample = np.random.default_rng(1).choice(len(load), _RANKED_BY, replace=False)
        q, load = q[sample], load[sample]
    n, p = q.shape
    half = (n + p + 1) // 2
    residuals, sums = _trimmed(q, load, starts, half)
    if len(starts) > _CONCENTRATED:
        better = np.argpartition(sums, _CONCENTRATED)[:_CONCENTRATED]
        near = np.zeros((_CONCENTRATED, n))
        nearest = np.argpartition(residuals[better], half - 1, axis=1)[:, :half]
        np.put_along_axis(near, nearest, 1.0, axis=1)
        square = (near @ (q[:, :, None] * q[:, None, :]).reshape(n, -1)).reshape(-1, p, p)
        product = ((near * load) @ q)[:, :, None]
        solved = np.linalg.solve(square + _UNTOLD * np.eye(p), product)
        starts = np.asarray(solved[:, :, 0], dtype=np.float64)
        sums = _trimmed(q, load, starts, half)[1]
    return starts[np.argsort(sums, kind="stable")[:_REFINED]]


def _trimmed(q: Array, load: Array, solutions: Array, half: int) -> tuple[Array, Array]:
    """Return each equation's absolute residuals (equations, rows), and the squares of its nearest half."""
    residuals = np.asarray(np.abs(load - solutions @ q.T), dtype=np.float64)
    return residuals, np.sum(np.square(np.partition(residuals, half - 1, axis=1)[:, :half]), axis=1)


def _best_half(q: Array, load: Array) -> NDArray[np.intp]:
    """Return the rows of the smallest sum of squares about one equation, just over half of them.

    ``q`` (rows, terms) is an orthonormal basis of the design. Equations through as many rows as terms, drawn
    by a fixed seed, are ranked; so are the better of them, once fitted to the half that is nearest to each:
    an equation through as many rows as terms holds their scatter. The best are fitted so until it stays.
    """
    n, p = q.shape
    half = (n + p + 1) // 2
    draws = min(math.ceil(math.log(_MISSED) / math.log1p(-((1 - _WRONG) ** p))), _MOST_DRAWS)
    drawn = np.random.default_rng(0).integers(n, size=(draws, p))
    # Rows that repeat one loading do not determine an equation: the least of their solutions is a poor start.
    starts = (np.linalg.pinv(q[drawn]) @ load[drawn][:, :, None])[:, :, 0]
    starts = np.asarray(np.vstack([starts, q.T @ load]), dtype=np.float64)
    best, rows = np.inf, np.arange(n)
    for start in _best(q, load, starts):
        nearest, before = np.argpartition(np.abs(load - q @ start), half - 1)[:half], np.inf
        for _ in range(_SEARCH_STEPS):
            solution = np.linalg.lstsq(q[nearest], load[nearest], rcond=None)[0]
            distance = np.abs(load - q @ solution)
            nearest = np.argpartition(distance, half - 1)[:half]
            total = float(np.sum(np.square(distance[nearest])))
            if total >= before * (1 - _SEARCH_SETTLED):
                break
            before = total
        if total < best:
            best, rows = total, nearest
    return rows
