"""Start shapes that come from the data: a library of Magic Formula shapes, scored against every curve.

The library is the same for every curve (its abscissa is normalised), so scoring all of it against all
curves is three matrix products. It is cut into strata of C, E and B; the best few strata of a curve, each by its
best shape, are the starts: diverse by construction, and near the data.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from toolkit.tires.kernel import D_LIMIT, Problems, curvature_parameter, sine

if TYPE_CHECKING:
    from toolkit.tires.kernel import Array

_NODES = 40
_PER_STRATUM = 60
_C = ((0.3, 1.25), (1.25, 1.9), (1.9, 2.9), (2.9, 4.0))
_Q = (
    (curvature_parameter(0.999), curvature_parameter(-0.5)),
    (curvature_parameter(-0.5), curvature_parameter(-19.0)),
)
_LN_B = ((np.log(0.08), np.log(1.5)), (np.log(1.5), np.log(24.0)))


@cache
def library() -> tuple[Array, Array]:
    """Return the shapes (strata, shapes, 4) and their sines at the nodes (strata * shapes, nodes)."""
    points = _halton(_PER_STRATUM)
    strata = []
    for c in _C:
        for q in _Q:
            for b in _LN_B:
                low = np.array([b[0], c[0], q[0], 0.0])
                high = np.array([b[1], c[1], q[1], 0.0])
                shapes = low + (high - low) * points
                # Most curves pass zero near their middle; some begin there (one-sided), few lie beyond.
                shapes[:, 3] = 1.4 * np.sign(points[:, 3] - 0.5) * np.abs(2 * points[:, 3] - 1) ** 1.7
                strata.append(shapes)
    shapes = np.array(strata)
    nodes = np.broadcast_to(_nodes(), (shapes.shape[0] * shapes.shape[1], _NODES))
    return shapes, sine(shapes.reshape(-1, 4), nodes)


def pick(problems: Problems, count: int) -> Array:
    """Return the best ``count`` start shapes of every curve (curves, count, 4), best first."""
    shapes, sines = library()
    strata, per, _ = shapes.shape
    weight, moment = _deposit(problems)
    total = weight.sum(axis=1)[:, None]
    f, ff, fy = weight @ sines.T, weight @ (sines * sines).T, moment @ sines.T
    y = moment.sum(axis=1)[:, None]
    variance = np.maximum(ff - f * f / total, 1e-12 * total)
    gain = fy - f * y / total
    D = np.clip(gain / variance, -D_LIMIT, D_LIMIT)
    score = D * D * variance - 2 * D * gain
    inside = (shapes[..., 3].reshape(-1) >= problems.low[:, 3:4]) & (
        shapes[..., 3].reshape(-1) <= problems.high[:, 3:4]
    )
    score = np.where(inside, score, score * 0.5).reshape(-1, strata, per)
    best = score.argmin(axis=2)
    order = np.argsort(np.take_along_axis(score, best[..., None], axis=2)[..., 0], axis=1)[:, :count]
    chosen = np.take_along_axis(best, order, axis=1)
    return np.clip(shapes[order, chosen], problems.low[:, None, :], problems.high[:, None, :])


def _deposit(problems: Problems) -> tuple[Array, Array]:
    # Shares each point between its two nearest nodes: weights and weighted ordinates on the library's nodes.
    curves, points = problems.u.shape
    w = problems.sw**2
    place = np.clip((problems.u + 1.0) * (0.5 * (_NODES - 1)), 0.0, _NODES - 1 - 1e-9)
    left = place.astype(np.intp)
    share = place - left
    slot = left + _NODES * np.arange(curves)[:, None]
    size = curves * _NODES + 1
    weight = np.bincount(slot.ravel(), (w * (1 - share)).ravel(), size)
    weight += np.bincount(slot.ravel() + 1, (w * share).ravel(), size)
    wy = w * problems.y
    moment = np.bincount(slot.ravel(), (wy * (1 - share)).ravel(), size)
    moment += np.bincount(slot.ravel() + 1, (wy * share).ravel(), size)
    return weight[:-1].reshape(curves, _NODES), moment[:-1].reshape(curves, _NODES)


def _nodes() -> Array:
    return np.linspace(-1.0, 1.0, _NODES)


def _halton(count: int) -> Array:
    # Low-discrepancy points of [0, 1]^4 in the bases 2, 3, 5, 7 (Halton 1960).
    result = np.empty((count, 4))
    for column, base in enumerate((2, 3, 5, 7)):
        for row in range(count):
            index, fraction, value = row + 1, 1.0, 0.0
            while index:
                fraction /= base
                index, digit = divmod(index, base)
                value += fraction * digit
            result[row, column] = value
    return result
