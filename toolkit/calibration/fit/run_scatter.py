"""Restricted likelihood of a session's scatter: within runs, between their zeros and between their gains.

The model is that of `records.scatter`. Its mean holds, beside the terms of the equation, what a curve may
miss smoothly (powers 2 to 4 of the load) and what loading and unloading may do apart (a parabola over the
load), so that neither passes for scatter: no levels of load are looked for, and reference loads need not
repeat. Variances are estimated together at the lowest restricted deviance

    (n - p) ln s^2 + ln |V / s^2| + ln |X^T V^-1 X s^2|

(Patterson and Thompson, Biometrika 58 (1971) 545); their covariance is the inverse of its expected
information, I_jk = tr(P V_j P V_k) / 2 with P = V^-1 - V^-1 X (X^T V^-1 X)^-1 X^T V^-1 (Searle, Casella and
McCulloch, Variance Components, 1992, 6.6).
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.records.scatter import RunScatter

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.calibration.session.table import Table

# Rows over which the mean may bend and rows may be correlated: with fewer, both take what is scatter.
ENOUGH_DOF = 20
HIGHEST_POWER = 4
MOST_GROUPS = 5000
_DENSE = 800
_LARGEST_RATIO = 1e3
_LARGEST_CORRELATION = 0.97
# None begins at 0: the deviance is even in a ratio, hence level there whatever lies beyond.
_GRID = (0.03, 0.3, 0.6, 0.9)
_DEPENDENT = 1e-9
# Scatter below this share of the largest load is rounding, which has no runs.
ROUNDING = 1e-13
# Fall of the deviance from which rows count as correlated: chi-square, one-sided 5 %.
CORRELATED = 2.71
# A stored optimum is held against its neighbours: a hundredth away none may be likelier by as much as a
# tenth of a standard error makes.
_NEIGHBOUR = 0.01
_GAIN = 0.01
_SAME = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mean:
    """Orthonormal columns of the mean (rows, columns): the terms', then ``misfit``, then ``direction``."""

    columns: NDArray[np.float64]
    misfit: slice
    direction: slice


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SessionRows:
    """The rows of one load: its reference loads (rows,), their mean, and the runs.

    ``relative`` (rows,) is the load that the equation gives, by the largest: an effect in proportion to the
    reference loads themselves could take them up whole.
    ``group`` numbers from 0 what tells the rows apart (``factor``: run or mounting); ``own_zeros``: the mean
    holds a zero of every run, so that differences of zeros are no scatter.
    """

    load: NDArray[np.float64]
    relative: NDArray[np.float64]
    mean: Mean
    factor: str
    group: NDArray[np.int64]
    own_zeros: bool

    @classmethod
    def of(
        cls, design: NDArray[np.float64], load: NDArray[np.float64], table: Table, zero: str
    ) -> SessionRows:
        """Return the rows of a load (rows,) with the terms of its equation (rows, terms)."""
        factor, group = groups_of(table)
        zeros = np.empty((len(load), 0))
        if zero == "run" and table.run is not None:
            run = _numbered(table.run)
            zeros = (run[:, None] == np.arange(int(run.max()) + 1)).astype(np.float64)
        terms = _orthonormal(design)
        relative = terms @ (terms.T @ load) / (float(np.abs(load).max()) or 1.0)
        mean = mean_of(np.column_stack([design, zeros]), relative, table.up)
        return cls(
            load=load, relative=relative, mean=mean, factor=factor, group=group, own_zeros=bool(zeros.size)
        )

    @property
    def groups(self) -> int:
        """Number of runs or mountings."""
        return int(self.group.max()) + 1

    @property
    def largest(self) -> float:
        """Largest absolute load."""
        return float(np.abs(self.load).max())

    @property
    def bounds(self) -> list[tuple[float, float]]:
        """Lowest and highest zero and gain by within, and correlation."""
        n, p = self.mean.columns.shape
        return [
            (0.0, 0.0 if self.own_zeros else _LARGEST_RATIO),
            (0.0, _LARGEST_RATIO),
            (0.0, _LARGEST_CORRELATION if n - p >= ENOUGH_DOF else 0.0),
        ]


def groups_of(table: Table) -> tuple[str, NDArray[np.int64]]:
    """Return what tells a session's rows apart, and each row's group from 0 (rows,).

    Mountings take the place of runs where the session has more than one rotation: ISO 376 takes
    reproducibility between rotated mountings, repeatability within one.
    """
    if table.rotation is not None and len(np.unique(table.rotation)) > 1:
        return "mounting", _numbered(table.rotation)
    run = np.zeros(table.rows) if table.run is None else table.run
    return "run", _numbered(run)


def mean_of(design: NDArray[np.float64], relative: NDArray[np.float64], up: NDArray[np.bool_] | None) -> Mean:
    """Return the columns of the mean for a design (rows, terms) and relative loads (rows,)."""
    n = len(relative)
    blocks = [design]
    wide = n - design.shape[1] >= ENOUGH_DOF
    blocks.append(
        np.stack([relative**k for k in range(2, HIGHEST_POWER + 1)], axis=1) if wide else np.empty((n, 0))
    )
    if wide and up is not None and 0 < int(np.count_nonzero(up)) < n:
        side = np.where(up, 1.0, -1.0)
        blocks.append(np.stack([side, side * relative, side * relative**2], axis=1))
    else:
        blocks.append(np.empty((n, 0)))
    taken = [_orthonormal(np.column_stack(blocks[: k + 1])).shape[1] for k in range(2)]
    columns = _orthonormal(np.column_stack(blocks))
    return Mean(
        columns=columns, misfit=slice(taken[0], taken[1]), direction=slice(taken[1], columns.shape[1])
    )


def estimate(rows: SessionRows) -> RunScatter | None:
    """Return the scatter of a load; None where one run, or too many, cannot tell how runs differ."""
    n, p = rows.mean.columns.shape
    groups = rows.groups
    left = n - p - (groups - 1) * (1 if rows.own_zeros else 2)
    if not 1 < groups <= MOST_GROUPS or left < 1:
        return None
    problem, size = _problem(rows)
    if size <= ROUNDING * rows.largest:
        return None
    zero, gain, correlation = ratios = _lowest(problem, rows.bounds)
    within = size * math.sqrt(problem.deviance(ratios)[1])
    return RunScatter(
        factor=rows.factor, groups=groups, within=within, zero=within * zero, gain=within * gain,
        correlation=correlation, dof=left,
    )  # fmt: skip


def is_lowest(rows: SessionRows, scatter: RunScatter) -> bool:
    """Tell whether a stored scatter is the one that these rows have: no neighbour of it is likelier."""
    n, p = rows.mean.columns.shape
    left = n - p - (rows.groups - 1) * (1 if rows.own_zeros else 2)
    if (scatter.factor, scatter.groups, scatter.dof) != (rows.factor, rows.groups, left):
        return False
    if not scatter.within > 0:
        return False
    problem, size = _problem(rows)
    ratios = (scatter.zero / scatter.within, scatter.gain / scatter.within, scatter.correlation)
    if not all(low <= value <= high for value, (low, high) in zip(ratios, rows.bounds, strict=True)):
        return False
    lowest, variance = problem.deviance(ratios)
    if abs(scatter.within / (size * math.sqrt(variance)) - 1) > _SAME:
        return False
    for at, (low, high) in enumerate(rows.bounds):
        for step in (-_NEIGHBOUR, _NEIGHBOUR):
            near = list(ratios)
            near[at] = min(max(near[at] + step * max(near[at], 1.0), low), high)
            allowed = CORRELATED if at == 2 and not scatter.correlation else _GAIN
            if problem.deviance((near[0], near[1], near[2]))[0] < lowest - allowed:
                return False
    return True


def spread(rows: SessionRows, scatter: RunScatter) -> NDArray[np.float64]:
    """Return the covariance (4, 4) of the estimates of within^2, zero^2, gain^2 and the correlation.

    Of long sessions every so many rows are taken: a correlation from row to row becomes its power, and what
    is left out would only narrow a spread that is narrow already.
    """
    step = max(math.ceil(len(rows.group) / _DENSE), 1)
    order = np.argsort(rows.group, kind="stable")[::step]
    group, relative, mean = rows.group[order], rows.relative[order], rows.mean.columns[order]
    place = np.arange(len(group)) - np.searchsorted(group, group)
    same = group[:, None] == group
    lag = np.abs(place[:, None] - place) * step
    phi = scatter.correlation
    R = np.where(same, phi**lag, 0.0)
    slope = np.where(same & (lag > 0), lag * phi ** np.maximum(lag - 1, 0), 0.0) * scatter.within**2
    between = same.astype(np.float64)
    gains = between * np.outer(relative, relative)
    within, zero, gain = scatter.variances
    inverse = np.linalg.inv(within * R + zero * between + gain * gains)
    told = inverse @ mean
    P = inverse - told @ np.linalg.pinv(mean.T @ told, hermitian=True) @ told.T
    free = [True, *(high > 0 for _, high in rows.bounds)]
    seen = [P @ part for part, use in zip((R, between, gains, slope), free, strict=True) if use]
    # Variances in their own unit: the information of newtons and of a correlation differ by powers of ten.
    unit = np.array([within, within, within, 1.0])[free]
    information = np.array([[0.5 * np.sum(a * b.T) for b in seen] for a in seen]) * np.outer(unit, unit)
    found = np.zeros((4, 4))
    found[np.ix_(free, free)] = np.linalg.pinv(information, hermitian=True) * np.outer(unit, unit)
    return found


def _problem(rows: SessionRows) -> tuple[_Problem, float]:
    """Return the products of the rows at unit scatter, and that scatter [the load's unit]."""
    columns, load = rows.mean.columns, rows.load
    rest = load - columns @ (columns.T @ load)
    size = math.sqrt(float(rest @ rest) / len(rest))
    return _Problem.of(columns, rows.relative, rest / (size or 1.0), rows.group), size


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Problem:
    """Products of the rows of [mean, 1, relative load, load] in every run: no step needs the rows again.

    For rows correlated by phi, (first first^T + (A - phi B + phi^2 C) / (1 - phi^2)) are the products of the
    whitened rows: A of rows with themselves, B with the row before, C of the rows before.
    """

    first: NDArray[np.float64]
    own: NDArray[np.float64]
    crossed: NDArray[np.float64]
    before: NDArray[np.float64]
    counts: NDArray[np.int64]
    rows: int
    columns: int

    @classmethod
    def of(
        cls,
        mean: NDArray[np.float64],
        relative: NDArray[np.float64],
        load: NDArray[np.float64],
        group: NDArray[np.int64],
    ) -> _Problem:
        order = np.argsort(group, kind="stable")
        # Orthonormal columns of unit mean square: products of one size.
        whole = np.column_stack([mean * math.sqrt(len(load)), np.ones(len(load)), relative, load])[order]
        ends = np.cumsum(np.bincount(group))[:-1]
        runs = np.split(whole, ends)
        crossed = [run[1:].T @ run[:-1] for run in runs]
        return cls(
            first=np.stack([np.outer(run[0], run[0]) for run in runs]),
            own=np.stack([run[1:].T @ run[1:] for run in runs]),
            crossed=np.stack([one + one.T for one in crossed]),
            before=np.stack([run[:-1].T @ run[:-1] for run in runs]),
            counts=np.array([len(run) for run in runs]),
            rows=len(load),
            columns=mean.shape[1],
        )

    def deviance(self, ratios: tuple[float, float, float]) -> tuple[float, float]:
        """Return the restricted deviance and within^2 at (zero, gain) / within and the correlation."""
        *effects, phi = ratios
        p, white = self.columns, 1 - phi * phi
        products = self.first + (self.own - phi * self.crossed + phi * phi * self.before) / white
        root = np.array(effects)
        inner = np.eye(2) + root[:, None] * products[:, p:-1, p:-1] * root
        across = products[:, :, p:-1] * root
        reduced = (products - across @ np.linalg.solve(inner, across.transpose(0, 2, 1))).sum(axis=0)
        lower = np.linalg.cholesky(reduced[:p, :p])
        told = np.linalg.solve(lower, reduced[:p, -1])
        dof = self.rows - p
        variance = max(float(reduced[-1, -1] - told @ told), 1e-300) / dof
        logs = float(np.linalg.slogdet(inner)[1].sum()) + 2 * float(np.log(np.diag(lower)).sum())
        logs += float((self.counts - 1).sum()) * math.log(white)
        return dof * math.log(variance) + logs, variance


def _lowest(problem: _Problem, bounds: list[tuple[float, float]]) -> tuple[float, float, float]:
    """Return the ratios of lowest deviance; a correlation only where it is likelier than none.

    Bounded below by 0 it would be positive by chance in half of all sessions, and take the scatter with it.
    """
    alone, without = _search(problem, [*bounds[:2], (0.0, 0.0)])
    if not bounds[2][1]:
        return alone
    together, lowest = _search(problem, bounds)
    return together if lowest < without - CORRELATED else alone


def _search(problem: _Problem, bounds: list[tuple[float, float]]) -> tuple[tuple[float, float, float], float]:
    """Return the ratios of lowest deviance and that deviance, from the best point of a grid.

    A ratio of standard deviations r is searched as r / (1 + r): half of the way is where runs differ by as
    much as the rows of a run do.
    """
    from scipy.optimize import Bounds, minimize

    low, high = np.array(bounds).T
    top = np.array([high[0] / (1 + high[0]), high[1] / (1 + high[1]), high[2]])

    def ratios(values: NDArray[np.float64]) -> tuple[float, float, float]:
        zero, gain, correlation = np.clip(values, low, top).tolist()
        return zero / (1 - zero), gain / (1 - gain), correlation

    def deviance(values: NDArray[np.float64]) -> float:
        return problem.deviance(ratios(values))[0]

    grid = itertools.product(*(sorted({min(x, end) for x in _GRID}) for end in top.tolist()))
    start = min((np.array(point) for point in grid), key=deviance)
    found = minimize(deviance, start, bounds=Bounds(low, top), method="L-BFGS-B")
    # A ratio that is not told apart from none is none.
    nothing = [np.where(np.arange(3) == at, 0.0, found.x) for at in range(3)]
    best = min((np.where(found.x < _GRID[0], 0.0, found.x), *nothing, found.x, start), key=deviance)
    return ratios(best), deviance(best)


def _orthonormal(columns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what each column has beyond those before it, at unit length; none where it has nothing."""
    basis = np.empty((len(columns), 0))
    for column in columns.T:
        rest = column / (float(np.sqrt(column @ column)) or 1.0)
        for _ in range(2):  # the second time takes out what rounding left
            rest = rest - basis @ (basis.T @ rest)
        length = float(np.sqrt(rest @ rest))
        if length > _DEPENDENT:
            basis = np.column_stack([basis, rest / length])
    return basis


def _numbered(values: NDArray[np.float64]) -> NDArray[np.int64]:
    return np.asarray(np.unique(values, return_inverse=True)[1].ravel(), dtype=np.int64)
