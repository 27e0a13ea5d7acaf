"""A smooth function of slip angle and load through known points: a Gaussian process with a tire's shape.

A tire's force and moment are nearly odd in the slip angle, change fast around zero and slowly far off, and
grow with the load. A covariance that knows this passes through a table of few slip angles without wiggles,
and leaving angles out says how well it knows the tire between them.

Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006: 2.2 prediction, 4.2.1 covariances,
5.4.1 likelihood, 5.4.2 leaving points out.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

_BENDS = tuple(float(np.radians(one)) for one in (0.5, 1.0, 2.0, 4.0))
_LENGTHS = (0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 4.0)
_LOADS = (0.7, 1.5, 3.0)  # of the loads' range
_EVENS = (1e-6, 1e-4, 1e-2, 1.0)
_NOISES = (1e-10, 1e-8, 1e-6, 1e-4, 1e-2)
_ANGLE = 0.02  # of the warped slip angle: points nearer than that are one angle
_PIECE = 0.1  # of the warped slip angle: no angle is wider
_CELL = (_ANGLE, 0.02)  # of the warped slip angle, and nominal loads


@dataclass(frozen=True, slots=True, kw_only=True)
class Shape:
    """Which functions are likely.

    ``bend`` is the slip angle [rad] up to which angles count in proportion, beyond it by their logarithm;
    ``length`` the distance in that measure over which a function changes, ``load`` the same over the load,
    in nominal loads; ``even`` the variance of the part that is even in the slip angle, and ``noise`` of
    what no function of the two explains, both of the odd part's.
    """

    bend: float
    length: float
    load: float
    even: float
    noise: float


def covariance(shape: Shape, one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the covariance of points (n, 2) and (m, 2) of slip angle and load, (n, m), without noise."""
    a, b = np.arcsinh(one[:, 0] / shape.bend), np.arcsinh(other[:, 0] / shape.bend)
    near = _matern((a[:, None] - b) / shape.length)
    mirrored = _matern((a[:, None] + b) / shape.length)
    loads = np.exp(-0.5 * ((one[:, 1][:, None] - other[:, 1]) / shape.load) ** 2)
    return np.asarray(((near - mirrored) + shape.even * (near + mirrored)) * loads)


def _matern(away: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return Matern's correlation of order 5/2 (4.17): no smoother, a tire begins to slide at a corner."""
    far = np.sqrt(5) * np.abs(away)
    return np.asarray((1 + far + far * far / 3) * np.exp(-far))


class Process:
    """The function through points (n, 2) of slip angle [rad] and load [nominal loads], values (n,)."""

    def __init__(self, shape: Shape, points: NDArray[np.float64], values: NDArray[np.float64]) -> None:
        from scipy.linalg import cho_solve, cholesky

        self.shape, self.points, self.values = shape, points, values
        K = covariance(shape, points, points) + shape.noise * np.eye(len(points))
        self._root = cholesky(K, lower=True)
        self._weights = cho_solve((self._root, True), values)
        self._variance = max(float(values @ self._weights) / len(values), 1e-300)

    @property
    def log_likelihood(self) -> float:
        """Logarithm of the marginal likelihood at the best variance, up to a constant."""
        logs = np.log(np.diag(self._root)).sum()
        return float(-0.5 * len(self.values) * np.log(self._variance) - logs)

    def mean(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the function at points (m, 2), (m,)."""
        return np.asarray(covariance(self.shape, points, self.points) @ self._weights)

    def left_out(self) -> NDArray[np.float64]:
        """Return by how much every point is missed by the others at other slip angles, (n,).

        An angle is left out on both sides: the other side of an odd function would tell it. The largest has
        no neighbour beyond it and is missed by more; without it the widest gap of all would not count.
        """
        from scipy.linalg import cho_solve

        inverse = cho_solve((self._root, True), np.eye(len(self.points)))
        angle = angles_of(np.abs(self.points[:, 0]))
        missed = np.zeros(len(angle))
        for group in range(angle.max() + 1):
            at = np.flatnonzero(angle == group)
            missed[at] = np.linalg.solve(inverse[np.ix_(at, at)], self._weights[at])
        return missed


def angles_of(SA: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return to which of the slip angles, counted from the least, every point belongs, (n,).

    A sweep has no angles; it is cut into pieces.
    """
    warped = np.arcsinh(SA / _BENDS[1])
    order = np.argsort(warped, kind="stable")
    made = np.empty(len(SA), dtype=np.int64)
    group, first, last = -1, -np.inf, -np.inf
    for i in order:
        if warped[i] - last > _ANGLE or warped[i] - first > _PIECE:
            group, first = group + 1, warped[i]
        made[i], last = group, warped[i]
    return made


def cells_of(points: NDArray[np.float64], coarser: float = 1.0) -> NDArray[np.int64]:
    """Return in which cell of slip angle and load each point (n, 2) lies, (n, 2)."""
    return np.round(_warped(points) / (coarser * np.array(_CELL))).astype(np.int64)


def thinned(points: NDArray[np.float64], most: int) -> NDArray[np.int64]:
    """Return the indices of at most so many of the points (n, 2), spread evenly over what they cover."""
    coarser = 1.0
    while True:
        cells = cells_of(points, coarser)
        _, which, count = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
        if len(count) <= most:
            break
        coarser *= 1.25
    which = which.ravel()
    away = ((_warped(points) / (coarser * np.array(_CELL)) - cells) ** 2).sum(axis=1)
    order = np.lexsort((away, which))
    return np.asarray(order[np.unique(which[order], return_index=True)[1]])


def _warped(points: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.column_stack([np.arcsinh(points[:, 0] / _BENDS[1]), points[:, 1]])


def likeliest(points: NDArray[np.float64], values: NDArray[np.float64]) -> Shape:
    """Return the shape of the highest likelihood, of those tried: parameter by parameter, twice."""
    reach = float(np.ptp(points[:, 1])) or 1.0
    tried = {
        "bend": _BENDS,
        "length": _LENGTHS,
        "load": tuple(load * reach for load in _LOADS),
        "even": _EVENS,
        "noise": _NOISES,
    }
    best = Shape(bend=_BENDS[1], length=1.0, load=1.5 * reach, even=1e-2, noise=1e-6)
    score = -np.inf
    for pair in (("bend", "length"), ("load", "noise"), ("even", "noise")) * 2:
        start = best
        for one in itertools.product(*(tried[name] for name in pair)):
            shape = Shape(**{**_told(start), **dict(zip(pair, one, strict=True))})
            try:
                made = Process(shape, points, values).log_likelihood
            except np.linalg.LinAlgError:
                continue
            if made > score:
                best, score = shape, made
    return best


def _told(shape: Shape) -> dict[str, float]:
    return {name: getattr(shape, name) for name in Shape.__slots__}
