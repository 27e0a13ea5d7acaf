"""The Magic Formula's least-squares problem, reduced to four unknowns, for many curves at once.

D and Sv enter linearly: for any shape (B, C, E, Sh) their best values within bounds have a closed form,
so they are solved and not searched (variable projection, Golub and Pereyra 1973; the derivative is
Kaufman's, 1975, exact where the linear part is free or at a bound). Curves are normalised: slip angle by
its half range about its middle, ordinate by max|y|; the four unknowns are

    p = (ln B, C, q, h)    E = 1.25 - exp(q),    h the shift in units of the half range

because the cost is far closer to a parabola in ln B and q than in B and E.

Start shapes come from the data: a grid of Magic Formula shapes is scored against every curve. The grid is the
same for every curve (its abscissa is normalised), so scoring all of it against all curves is three matrix
products. Where the score is lower than at all neighbours on the grid a basin begins: the lowest of these
local minima are the starts, diverse by construction and near the data.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array, taken

Array32 = NDArray[np.float32]

E_TOP = 1.25
C_LOW, C_HIGH = 1e-3, 4.0
E_LOW, E_HIGH = -20.0, 1.0
D_LIMIT, SV_LIMIT = 3.0, 1.0
SPAN_LOW, SPAN_HIGH = 0.05, 50.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Problems:
    """Normalised curves, padded to one length: ``u y sw`` (problems, points), ``low high`` (problems, 4).

    ``sw`` is the square root of the weight, zero for padding.
    """

    u: Array
    y: Array
    sw: Array
    low: Array
    high: Array

    def take(self, index: NDArray[np.intp] | slice) -> Problems:
        """Return the problems of an index, repeats allowed."""
        return taken(self, index)


@dataclass(slots=True, kw_only=True, eq=False)
class State:
    """Shapes ``p`` (problems, 4) with their best ``linear`` (D, Sv), cost and gradient.

    ``square`` (problems, 4, 4), ``cross`` (problems, 4, 2) and ``gram`` (problems, 2, 2) are the blocks of
    the normal matrix of shape and linear part; ``held`` (problems, 2) says which of D and Sv a step
    must take as constant.
    """

    p: Array
    linear: Array
    cost: Array
    gradient: Array
    square: Array
    cross: Array
    gram: Array
    held: NDArray[np.bool_]

    def take(self, index: NDArray[np.intp]) -> State:
        """Return the states of an index."""
        return taken(self, index)

    def put(self, where: NDArray[np.bool_], state: State) -> None:
        """Take over the other's entries where a mask is true."""
        for name in _FIELDS:
            getattr(self, name)[where] = getattr(state, name)[where]

    def put_at(self, index: NDArray[np.intp], state: State) -> None:
        """Write the other's entries to positions."""
        for name in _FIELDS:
            getattr(self, name)[index] = getattr(state, name)

    def curvature(self) -> Array:
        """Return the Gauss-Newton matrix of the shape (problems, 4, 4), the linear part eliminated."""
        free = ~self.held
        ss, s1, ww = self.gram[:, 0, 0], self.gram[:, 0, 1] * (free[:, 0] & free[:, 1]), self.gram[:, 1, 1]
        determinant = ss * ww - s1 * s1
        safe = np.where(determinant > 1e-13 * ss * ww + 1e-300, determinant, np.inf)
        by_s = np.where(free[:, 0], ww / safe, 0.0)
        by_one = np.where(free[:, 1], np.where(np.isinf(safe), 1.0 / ww, ss / safe), 0.0)
        mixed = s1 / safe
        # Two rank-one products written out: a product of such small matrices is all overhead.
        s, moment = self.cross[:, :, 0], self.cross[:, :, 1]
        left_s = s * by_s[:, None] - moment * mixed[:, None]
        left_one = moment * by_one[:, None] - s * mixed[:, None]
        eliminated = left_s[:, :, None] * s[:, None, :]
        eliminated += left_one[:, :, None] * moment[:, None, :]
        return np.asarray(np.subtract(self.square, eliminated, out=eliminated))


_FIELDS = ("p", "linear", "cost", "gradient", "square", "cross", "gram", "held")


def curvature_parameter(E: Array | float) -> Array:
    """Return q of E."""
    return np.log(E_TOP - np.asarray(E, dtype=np.float64))


def shape_of(p: Array) -> tuple[Array, Array, Array, Array]:
    """Return normalised (B, C, E, shift) of unknowns (..., 4)."""
    return np.exp(p[..., 0]), p[..., 1], E_TOP - np.exp(p[..., 2]), p[..., 3]


def theta_of(state: State) -> Array:
    """Return the six normalised parameters B, C, D, E, h, Sv of states (problems, 6)."""
    B, C, E, h = shape_of(state.p)
    return np.stack([B, C, state.linear[:, 0], E, h, state.linear[:, 1]], axis=1)


def sine(p: Array, u: Array) -> Array:
    """Return sin(C arctan(...)) for unknowns (problems, 4) at normalised slip angles (problems, points)."""
    B, C, E, h = (column[..., None] for column in shape_of(p))
    z = B * (u + h)
    result: Array = np.sin(C * np.arctan(z - E * (z - np.arctan(z))))
    return result


def assess(p: Array, problems: Problems) -> State:
    """Return cost, gradient and normal matrix of shapes, D and Sv solved within their bounds."""
    # In blocks that stay in the cache, on one set of scratch arrays: three times as fast as all at once.
    count, points = problems.u.shape
    size = min(max(_BLOCK // points, 1), count)
    scratch = _Scratch(size, points)
    if count <= size:
        return _assess(p, problems, scratch)
    blocks = [slice(first, first + size) for first in range(0, count, size)]
    parts = []
    for block in blocks:
        assessed = _assess(p[block], problems.take(block), scratch)
        parts.append(assessed)
    joined = {name: np.concatenate([getattr(part, name) for part in parts]) for name in _FIELDS[1:]}
    return State(p=p, **joined)


_BLOCK = 24_576  # points


class _Scratch:
    # Columns of the Jacobian (size, 6, points), the last one constant, and six arrays (size, points).
    __slots__ = ("columns", "rows")

    def __init__(self, size: int, points: int) -> None:
        self.columns = np.empty((size, 6, points))
        self.rows = np.empty((6, size, points))


def _assess(p: Array, problems: Problems, scratch: _Scratch) -> State:
    u, y, sw = problems.u, problems.y, problems.sw
    count = len(p)
    a = scratch.columns[:count]
    z, bend, psi, phi, sine, two = scratch.rows[:, :count]
    C, h = p[:, 1:2], p[:, 3:4]
    B, eq = np.exp(p[:, 0:1]), np.exp(p[:, 2:3])
    E = E_TOP - eq
    np.add(u, h, out=z)
    z *= B
    np.arctan(z, out=bend)
    np.subtract(z, bend, out=bend)
    np.multiply(bend, E, out=psi)
    np.subtract(z, psi, out=psi)
    np.arctan(psi, out=phi)
    # Sine and cosine from the tangent of the half angle: one quick function in place of two slow ones.
    np.multiply(phi, 0.5 * C, out=sine)
    np.tan(sine, out=sine)
    np.multiply(sine, sine, out=two)
    two += 1.0
    np.divide(2.0, two, out=two)
    sine *= two  # the sine
    two -= 1.0  # the cosine
    np.multiply(sine, sw, out=a[:, 4])
    two *= sw
    np.multiply(two, phi, out=a[:, 1])
    psi *= psi
    psi += 1.0
    two *= C
    two /= psi  # the derivative by psi
    bend *= two
    np.multiply(bend, eq, out=a[:, 2])
    np.multiply(z, z, out=sine)
    np.add(sine, 1.0, out=psi)
    sine /= psi
    sine *= E
    np.subtract(1.0, sine, out=sine)
    two *= sine
    np.multiply(two, z, out=a[:, 0])
    np.multiply(two, B, out=a[:, 3])
    a[:, 5] = sw
    target = np.multiply(y, sw, out=z)
    gram = a @ a.transpose(0, 2, 1)
    D, Sv = solve_linear(gram[:, 4:, 4:], np.matvec(a[:, 4:], target))
    np.multiply(a[:, 4], D[:, None], out=sine)
    residual = np.subtract(target, sine, out=bend)
    np.multiply(sw, Sv[:, None], out=sine)
    residual -= sine
    scale, linear = D[:, None, None], np.stack([D, Sv], axis=1)
    return State(
        p=p,
        linear=linear,
        cost=np.vecdot(residual, residual),
        gradient=-D[:, None] * np.matvec(a[:, :4], residual),
        square=gram[:, :4, :4] * (scale * scale),
        cross=gram[:, :4, 4:] * scale,
        gram=gram[:, 4:, 4:],
        held=at_limit(linear),
    )


def at_limit(linear: Array) -> NDArray[np.bool_]:
    """Return which of D and Sv (problems, 2) stand at a bound."""
    return np.abs(linear) >= (D_LIMIT, SV_LIMIT)


def solve_linear(gram: Array, right: Array) -> tuple[Array, Array]:
    """Return the best D and Sv within their bounds.

    Parameters
    ----------
    gram : (problems, 2, 2) weighted sums ss, s1, 11 of the sine s
    right : (problems, 2) weighted sums sy, 1y
    """
    ss, s1, ww = gram[:, 0, 0], gram[:, 0, 1], gram[:, 1, 1]
    sy, wy = right[:, 0], right[:, 1]
    determinant = ss * ww - s1 * s1
    regular = determinant > 1e-13 * ss * ww + 1e-300
    safe = np.where(regular, determinant, 1.0)
    D = np.where(regular, (sy * ww - wy * s1) / safe, 0.0)
    Sv = np.where(regular, (wy * ss - sy * s1) / safe, wy / ww)
    outside = (np.abs(D) > D_LIMIT) | (np.abs(Sv) > SV_LIMIT)
    if outside.any():
        # The cost is a convex parabola in (D, Sv): beyond the box its minimum lies on one of the edges.
        i = np.flatnonzero(outside)
        ss, s1, ww, sy, wy = ss[i], s1[i], ww[i], sy[i], wy[i]
        floor = np.maximum(ss, 1e-300)
        signs = np.array([[1.0], [-1.0]])
        d = np.empty((4, len(i)))
        v = np.empty((4, len(i)))
        d[:2], v[2:] = signs * D_LIMIT, signs * SV_LIMIT
        v[:2] = np.clip((wy - d[:2] * s1) / ww, -SV_LIMIT, SV_LIMIT)
        d[2:] = np.clip((sy - v[2:] * s1) / floor, -D_LIMIT, D_LIMIT)
        best = np.argmin(d * d * ss + 2 * d * v * s1 + v * v * ww - 2 * d * sy - 2 * v * wy, axis=0)
        D[i], Sv[i] = d[best, np.arange(len(i))], v[best, np.arange(len(i))]
    return D, Sv


_NODES = 40
_B = (0.08, 0.2, 0.5, 1.0, 1.8, 3.2, 6.0, 12.0, 24.0)
_C = (0.35, 0.7, 1.1, 1.6, 2.2, 2.9, 3.6)
_E = (-19.0, -6.0, -2.0, -0.3, 0.5, 0.9)
_H = (-3.0, -1.8, -1.2, -0.9, -0.6, -0.3, 0.0, 0.3, 0.6, 0.9, 1.2, 1.8, 3.0)
# Curves and shapes: 16 x 378 x 40 nodes is under 2^18, below which OpenBLAS stays alone.
_SHAPE_BLOCK = (16, 378)
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
    height, breadth = _SHAPE_BLOCK
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
