"""Restricted likelihood of a session's scatter: within runs, between their zeros and between their gains.

The model is that of `records.scatter`, its mean that of `session_rows`. Variances are estimated together at
the lowest restricted deviance

    (n - p) ln s^2 + ln |V / s^2| + ln |X^T V^-1 X s^2|

(Patterson and Thompson, Biometrika 58 (1971) 545); their covariance is the inverse of its expected
information, I_jk = tr(P V_j P V_k) / 2 with P = V^-1 - V^-1 X (X^T V^-1 X)^-1 X^T V^-1 (Searle, Casella and
McCulloch, Variance Components, 1992, 6.6).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.records.scatter import MODEL, UNTOLD, WEIGHTED, RunScatter

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.calibration.fit.session_rows import SessionRows
    from toolkit.calibration.session.statements import BetweenRuns

_DENSE = 800
FEWEST_DOF = 3
# None begins at 0: the deviance is even in a ratio, hence level there whatever lies beyond.
_GRID = (0.03, 0.4, 1.5, 6.0, 40.0, 1000.0)
_CORRELATIONS = (0.1, 0.4, 0.8)
_STEP = 1e-5
# Scatter below this share of the largest load is rounding, which has no runs.
ROUNDING = 1e-13
# Fall of the deviance from which rows count as correlated: chi-square, one-sided 5 %.
CORRELATED = 2.71
# A stored optimum is held against its neighbours: a hundredth away none may be likelier by as much as a
# tenth of a standard error makes.
_NEIGHBOUR = 0.01
_GAIN = 0.01
_SAME = 1e-4
_MOST_STEPS = 1000


def estimate(rows: SessionRows) -> RunScatter | None:
    """Return the scatter of a load; None where one run cannot tell how runs differ, or nothing scatters."""
    n, p = rows.mean.columns.shape
    groups = rows.groups
    dof = rows.dof
    if groups < 2 or n - p < FEWEST_DOF:
        return None
    problem, size = _problem(rows)
    if size <= ROUNDING * rows.largest:
        return None
    zero, gain, correlation = ratios = _lowest(problem, rows.bounds)
    within = size * math.sqrt(float(problem.deviance(np.array([ratios]))[1][0]))
    return RunScatter(
        factor=rows.factor, groups=groups, within=within, zero=within * zero, gain=within * gain,
        correlation=correlation ** (1 / rows.stride), dof=dof,
        model=MODEL if rows.noise is None else WEIGHTED,
    )  # fmt: skip


def stated_scatter(
    factor: str, stated: BetweenRuns | None, *, residual_sd: float, dof: int
) -> RunScatter | None:
    """Return the scatter of one run and what its session states of the next; None where it states nothing."""
    if stated is None:
        return None
    return RunScatter(
        factor=factor,
        groups=1,
        within=residual_sd,
        zero=stated.zero,
        gain=stated.gain,
        correlation=0.0,
        dof=dof,
    )


def untold_scatter(factor: str, relative: Array, residuals: Array, *, within: float, dof: int) -> RunScatter:
    """Return the scatter of runs of so few rows that nothing tells their zeros and gains from noise.

    What cannot be told apart is taken whole for each: all of the scatter is noise, and zero^2 + gain^2
    relative^2 is fitted to the squares of the residuals (rows,), as if none of it were. How many runs there
    were is unknown as well: all rows are taken to share one zero and one gain, as those of a single run.
    """
    squares, rates = residuals**2 * (len(residuals) / dof), relative**2
    matrix = np.column_stack([np.ones_like(rates), rates])
    candidates = [matrix * chosen for chosen in ([1.0, 1.0], [1.0, 0.0], [0.0, 1.0])]
    solved = [np.linalg.lstsq(candidate, squares, rcond=None)[0] for candidate in candidates]
    sound = [variances for variances in solved if (variances >= 0).all()]
    zero, gain = min(sound, key=lambda variances: float(np.sum((squares - matrix @ variances) ** 2))).tolist()
    return RunScatter(
        factor=factor, groups=1, within=within, zero=math.sqrt(zero), gain=math.sqrt(gain), correlation=0.0,
        dof=dof, model=UNTOLD,
    )  # fmt: skip


def is_lowest(rows: SessionRows, scatter: RunScatter) -> bool:
    """Tell whether a stored scatter is the one that these rows have: no neighbour of it is likelier."""
    if (scatter.factor, scatter.groups, scatter.dof) != (rows.factor, rows.groups, rows.dof):
        return False
    if not scatter.within > 0:
        return False
    problem, size = _problem(rows)
    correlation = scatter.correlation**rows.stride
    ratios = np.array([scatter.zero / scatter.within, scatter.gain / scatter.within, correlation])
    low, high = np.array(rows.bounds).T
    if (ratios < low).any() or (ratios > high * (1 + _SAME)).any():
        return False
    deviance, variance = problem.deviance(_neighbours(ratios, rows.bounds))
    allowed = np.array([_GAIN, _GAIN, _GAIN if correlation else CORRELATED])
    return bool(
        abs(scatter.within / (size * math.sqrt(float(variance[0]))) - 1) <= _SAME
        and (deviance[1:] >= deviance[0] - np.tile(allowed, 2)).all()
    )


def spread(rows: SessionRows, scatter: RunScatter) -> Array:
    """Return the covariance (4, 4) of the estimates of within^2, zero^2, gain^2 and the correlation."""
    thin = max(math.ceil(len(rows.group) / _DENSE), 1)
    order = np.argsort(rows.group, kind="stable")[::thin]
    step = thin * rows.stride
    group, relative, mean = rows.group[order], rows.relative[order], rows.mean.columns[order]
    place = np.arange(len(group)) - np.searchsorted(group, group)
    together = group[:, None] == group
    lag = np.abs(place[:, None] - place) * step
    phi = scatter.correlation
    sizes = 1.0 if rows.noise is None else np.outer(rows.noise[order], rows.noise[order])
    R = np.where(together, phi**lag, 0.0) * sizes
    slope = (
        np.where(together & (lag > 0), lag * phi ** np.maximum(lag - 1, 0), 0.0) * scatter.within**2 * sizes
    )
    between = together.astype(np.float64)
    gains = between * np.outer(relative, relative)
    within, zero, gain = scatter.variances
    inverse = np.linalg.inv(within * R + zero * between + gain * gains)
    weights = inverse @ mean
    P = inverse - weights @ np.linalg.pinv(mean.T @ weights, hermitian=True) @ weights.T
    free = [True, *(high > 0 for _, high in rows.bounds)]
    projected = [P @ part for part, use in zip((R, between, gains, slope), free, strict=True) if use]
    # Variances in their own unit: the information of newtons and of a correlation differ by powers of ten.
    unit = np.array([within, within, within, 1.0])[free]
    information = np.array([[0.5 * np.sum(a * b.T) for b in projected] for a in projected]) * np.outer(
        unit, unit
    )
    expected = np.zeros((4, 4))
    expected[np.ix_(free, free)] = np.linalg.pinv(information, hermitian=True) * np.outer(unit, unit)
    return expected


def _problem(rows: SessionRows) -> tuple[_Problem, float]:
    """Return the products of the rows at unit scatter, and that scatter [the load's unit]."""
    columns, load, constant, relative = rows.mean.columns, rows.load, np.ones(len(rows.load)), rows.relative
    if rows.noise is not None:
        # Brought to one spread, rows are as those of a plain fit.
        constant, relative, load = constant / rows.noise, relative / rows.noise, load / rows.noise
        columns = np.linalg.qr(columns / rows.noise[:, None])[0]
    residual = load - columns @ (columns.T @ load)
    size = math.sqrt(float(residual @ residual) / len(residual))
    return _Problem.of(columns, constant, relative, residual / (size or 1.0), rows.group), size


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Problem:
    """Products of the rows of [mean, 1, relative load, load] in every run: no step needs the rows again.

    For rows correlated by phi, (first first^T + (A - phi B + phi^2 C) / (1 - phi^2)) are the products of the
    whitened rows: A of rows with themselves, B with the row before, C of the rows before.
    """

    first: Array
    own: Array
    crossed: Array
    before: Array
    counts: NDArray[np.int64]
    rows: int
    columns: int

    @classmethod
    def of(
        cls, mean: Array, constant: Array, relative: Array, load: Array, group: NDArray[np.int64]
    ) -> _Problem:
        order = np.argsort(group, kind="stable")
        # Orthonormal columns of unit mean square: products of one size.
        columns = np.column_stack([mean * math.sqrt(len(load)), constant, relative, load])[order]
        counts = np.bincount(group)
        starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
        # Of the first row of a run nothing stands before.
        before = np.concatenate([np.zeros((1, columns.shape[1])), columns[:-1]])
        before[starts] = 0.0
        products = np.add.reduceat(columns[:, :, None] * columns[:, None, :], starts)
        first = columns[starts][:, :, None] * columns[starts][:, None, :]
        crossed = np.add.reduceat(columns[:, :, None] * before[:, None, :], starts)
        return cls(
            first=first,
            own=products - first,
            crossed=crossed + crossed.transpose(0, 2, 1),
            before=np.add.reduceat(before[:, :, None] * before[:, None, :], starts),
            counts=counts,
            rows=len(load),
            columns=mean.shape[1],
        )

    def deviance(self, points: Array) -> tuple[Array, Array]:
        """Return the restricted deviance (points,) and within^2 (points,) of a number of points at once.

        ``points`` (points, 3) are zero and gain by within, and the correlation.
        """
        p, phi = self.columns, points[:, 2, None, None, None]
        white = 1 - phi * phi
        products = (self.first + self.own)[None]
        if phi.any():  # rows that are not correlated have the same products at every point
            products = self.first + (self.own - phi * self.crossed + phi * phi * self.before) / white
        root = points[:, None, None, :2]
        inner = np.eye(2) + root.transpose(0, 1, 3, 2) * products[:, :, p:-1, p:-1] * root
        across = products[:, :, :, p:-1] * root
        solved = np.linalg.solve(inner, across.transpose(0, 1, 3, 2))
        reduced = (products - across @ solved).sum(axis=1)
        lower = np.linalg.cholesky(reduced[:, :p, :p])
        reached = np.linalg.solve(lower, reduced[:, :p, -1:])[:, :, 0]
        dof = self.rows - p
        variance = np.maximum(reduced[:, -1, -1] - np.sum(reached**2, axis=1), 1e-300) / dof
        logs = np.linalg.slogdet(inner)[1].sum(axis=1)
        logs += 2 * np.log(np.diagonal(lower, axis1=1, axis2=2)).sum(axis=1)
        logs += (self.counts - 1).sum() * np.log(white[:, 0, 0, 0])
        return dof * np.log(variance) + logs, variance


def _lowest(problem: _Problem, bounds: list[tuple[float, float]]) -> tuple[float, float, float]:
    """Return the ratios of lowest deviance; a correlation only where it is likelier than none.

    Bounded below by 0 it would be positive by chance in half of all sessions, and take the scatter with it.
    """
    alone, without = _search(problem, [*bounds[:2], (0.0, 0.0)], [_GRID, _GRID, (0.0,)])
    if not bounds[2][1]:
        return alone
    near = [(max(ratio, _GRID[0]),) for ratio in alone[:2]]
    together, lowest = _search(problem, bounds, [*near, _CORRELATIONS])
    return together if lowest < without - CORRELATED else alone


def _search(
    problem: _Problem, bounds: list[tuple[float, float]], starts: list[tuple[float, ...]]
) -> tuple[tuple[float, float, float], float]:
    """Return the ratios of lowest deviance and that deviance, from the best point of a grid of ``starts``.

    A ratio of standard deviations r is searched as ln(1 + r): zeros of untared bridges differ by thousands
    of times the noise.
    """
    from scipy.optimize import Bounds, minimize

    low, high = np.array(bounds).T
    top = np.append(np.log1p(high[:2]), high[2])

    def ratios(values: Array) -> Array:
        clipped = np.clip(values, low, top)
        return np.column_stack([np.expm1(clipped[:, :2]), clipped[:, 2]])

    def slope(values: Array) -> tuple[float, Array]:
        # Inwards at an upper end: beyond it nothing is computed.
        step = np.where(values + _STEP <= top, _STEP, -_STEP)
        near = problem.deviance(ratios(values + np.vstack([np.zeros((1, 3)), np.diag(step)])))[0]
        return float(near[0]), (near[1:] - near[0]) / step

    scales = [np.log1p(starts[0]), np.log1p(starts[1]), np.asarray(starts[2])]
    axes = [np.unique(np.minimum(start, end)) for start, end in zip(scales, top, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    start = grid[int(np.argmin(problem.deviance(ratios(grid))[0]))]
    optimum = minimize(
        slope, start, jac=True, bounds=Bounds(low, top), method="L-BFGS-B", options={"ftol": 1e-13}
    ).x
    # A ratio that is not told apart from none is none.
    candidates = np.vstack(
        [
            np.where(optimum < _GRID[0], 0.0, optimum),
            *np.where(np.eye(3, dtype=bool), 0.0, optimum),
            optimum,
            start,
        ]
    )
    points = ratios(candidates)
    best = points[int(np.argmin(problem.deviance(points)[0]))]
    lowest = float(problem.deviance(best[None])[0][0])
    # Rounding may end a search early: what a stored optimum is held to is reached by steps of that size.
    for _ in range(_MOST_STEPS):
        near = _neighbours(best, bounds)
        deviance = problem.deviance(near)[0]
        at = int(np.argmin(deviance))
        if deviance[at] > lowest - _GAIN / 2:
            break
        best, lowest = near[at], float(deviance[at])
    zero, gain, correlation = best.tolist()
    return (zero, gain, correlation), lowest


def _neighbours(ratios: Array, bounds: list[tuple[float, float]]) -> Array:
    """Return a point and those a hundredth beside it within the bounds (7, 3)."""
    low, high = np.array(bounds).T
    steps = _NEIGHBOUR * np.maximum(ratios, 1.0) * np.vstack([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
    return np.clip(ratios + steps, low, high)
