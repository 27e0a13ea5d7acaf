"""Start shapes that come from the data: a grid of Magic Formula shapes, scored against every curve.

The grid is the same for every curve (its abscissa is normalised), so scoring all of it against all curves is
three matrix products. Where the score is lower than at all neighbours on the grid a basin begins: the
lowest of these local minima are the starts, diverse by construction and near the data.
"""

from __future__ import annotations

from functools import cache
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from toolkit.tires.kernel import D_LIMIT, SV_LIMIT, Problems, curvature_parameter, sine

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.tires.kernel import Array

    Array32 = NDArray[np.float32]

_NODES = 40
_B = (0.08, 0.2, 0.5, 1.0, 1.8, 3.2, 6.0, 12.0, 24.0)
_C = (0.35, 0.7, 1.1, 1.6, 2.2, 2.9, 3.6)
_E = (-19.0, -6.0, -2.0, -0.3, 0.5, 0.9)
_H = (-3.0, -1.8, -1.2, -0.9, -0.6, -0.3, 0.0, 0.3, 0.6, 0.9, 1.2, 1.8, 3.0)
_BLOCK = (16, 378)  # curves and shapes: 16 x 378 x 40 nodes is under 2^18, below which OpenBLAS stays alone
_AT_ONCE = 32
_GRID = (len(_B), len(_C), len(_E), len(_H))


@cache
def library() -> tuple[Array, Array32, Array32]:
    """Return the shapes (shapes, 4), their sines at the nodes and the squares (nodes, shapes).

    Single precision is enough: a score only ranks starts.
    """
    shapes = np.array(list(product(np.log(_B), _C, curvature_parameter(np.array(_E)), _H)))
    nodes = np.broadcast_to(np.linspace(-1.0, 1.0, _NODES), (len(shapes), _NODES))
    sines = np.ascontiguousarray(sine(shapes, nodes).T.astype(np.float32))
    return shapes, sines, sines * sines


def pick(problems: Problems, count: int) -> Array:
    """Return the ``count`` best start shapes of every curve (curves, count, 4), best first."""
    # A few curves at a time: their scores by every shape then stay in the cache.
    places = np.arange(len(problems.u))
    parts = [places[first : first + _AT_ONCE] for first in range(0, len(places), _AT_ONCE)]
    return np.concatenate([_pick(problems.take(part), count) for part in parts])


def _pick(problems: Problems, count: int) -> Array:
    shapes, sines, squares = library()
    weight, moment = _deposit(problems)
    total = weight.sum(axis=1)[:, None]
    y = moment.sum(axis=1)[:, None]
    f, ff, fy = _product(weight, sines), _product(weight, squares), _product(moment, sines)
    # D and Sv as in the kernel, each clipped in turn; then the cost without its constant sum of y^2.
    D = np.clip((fy - f * (y / total)) / np.maximum(ff - f * f / total, 1e-6 * total), -D_LIMIT, D_LIMIT)
    Sv = np.clip((y - D * f) / total, -SV_LIMIT, SV_LIMIT)
    np.maximum(ff, 1e-6 * total, out=ff)
    D = np.clip((fy - Sv * f) / ff, -D_LIMIT, D_LIMIT)
    score = D * (D * ff + 2 * (Sv * f - fy)) + Sv * (Sv * total - 2 * y)
    beyond = (shapes[:, 3] < problems.low[:, 3:4]) | (shapes[:, 3] > problems.high[:, 3:4])
    score[beyond] = np.inf
    # A large number instead of a mask: where there are too few basins, the next best shapes fill up.
    score += np.where(_is_basin(score), np.float32(0), np.float32(1e6))
    best = np.argpartition(score, count, axis=1)[:, :count]
    order = np.argsort(np.take_along_axis(score, best, axis=1), axis=1)
    best = np.take_along_axis(best, order, axis=1)
    return np.clip(shapes[best], problems.low[:, None, :], problems.high[:, None, :])


def _product(array32: Array32, right: Array32) -> Array32:
    # In blocks too small for the linear algebra to share among threads: their start and their waiting for a
    # core that is busy otherwise cost many times the product.
    result = np.empty((len(array32), right.shape[1]), dtype=np.float32)
    height, breadth = _BLOCK
    for top in range(0, len(array32), height):
        for side in range(0, right.shape[1], breadth):
            place = (slice(top, top + height), slice(side, side + breadth))
            np.matmul(array32[place[0]], right[:, place[1]], out=result[place])
    return result


def _is_basin(score: Array32) -> NDArray[np.bool_]:
    # No lower neighbour along any of the four axes of the grid.
    grid = score.reshape(-1, *_GRID)
    basin = np.ones(grid.shape, dtype=np.bool_)
    for axis in range(1, grid.ndim):
        lead = (slice(None),) * axis
        before, after = (*lead, slice(None, -1)), (*lead, slice(1, None))
        basin[before] &= grid[before] <= grid[after]
        basin[after] &= grid[after] <= grid[before]
    return basin.reshape(score.shape)


def _deposit(problems: Problems) -> tuple[Array32, Array32]:
    # Shares each point between its two nearest nodes: weights and weighted ordinates on the grid's nodes.
    curves = len(problems.u)
    w = problems.sw**2
    place = np.clip((problems.u + 1.0) * (0.5 * (_NODES - 1)), 0.0, _NODES - 1 - 1e-9)
    lower = place.astype(np.intp)
    share = place - lower
    slot = lower + _NODES * np.arange(curves)[:, None]
    size = curves * _NODES + 1

    def deposit(amount: Array) -> Array32:
        sums = np.bincount(slot.ravel(), (amount * (1 - share)).ravel(), size)
        sums = sums + np.bincount(slot.ravel() + 1, (amount * share).ravel(), size)
        return sums[:-1].reshape(curves, _NODES).astype(np.float32)

    return deposit(w), deposit(w * problems.y)
