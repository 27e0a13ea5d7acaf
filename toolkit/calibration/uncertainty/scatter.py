"""Scatter of a session taken apart: within runs, between runs, with direction, about the curve.

The residuals e of a load's fit are split by the method of moments, so that no part is counted twice:

    e = misfit(level) + reversal(level, direction) + offset(run) + gain(run) * load / largest + scatter

A level is a set of reference loads that was applied more than once (`fit.levels`). Of offset and gain the
run's *variance* is wanted: each is adjusted for the other and for the levels (Searle, Casella and McCulloch,
Variance Components (1992), 5.5, Henderson's method III), and is 0 where runs differ by no more than the
scatter within them. Mountings take the place of runs where the session has more than one rotation (ISO 376:
reproducibility is taken between rotated mountings, repeatability within one).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.fit.levels import load_levels
from toolkit.errors import SessionError

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from toolkit.calibration.session.table import Table

    Off = Callable[[NDArray[np.float64]], NDArray[np.float64]]

LARGEST_DESIGN = 50_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Scatter:
    """Standard deviations in the load's unit, each with its degrees of freedom (0: not determined).

    ``within`` of single readings; ``offset`` and ``gain`` (at the largest load) between ``groups`` runs or
    mountings (``factor``); ``reversal`` half the root mean square difference of the directions; ``misfit``
    the root mean square distance of the level means from the curve. ``levels``: loads were repeated, so
    that ``within`` is free of the misfit.
    """

    within: float
    within_dof: int
    factor: str
    groups: int
    offset: float
    offset_dof: int
    gain: float
    gain_dof: int
    reversal: float
    reversal_dof: int
    misfit: float
    misfit_dof: int
    levels: bool


def split_scatter(
    *,
    residuals: NDArray[np.float64],
    design: NDArray[np.float64],
    load: NDArray[np.float64],
    loads: NDArray[np.float64],
    table: Table,
) -> Scatter:
    """Return the scatter of one load.

    Parameters
    ----------
    residuals : of the load's fit (rows,)
    design : its terms (rows, terms)
    load, loads : the load's reference values (rows,), and those of all loads (rows, loads)
    table : for run, direction and rotation

    Raises
    ------
    SessionError
        ``budget``: so many runs of so many rows that their design does not fit into memory
    """
    n, p = design.shape
    factor, group = _groups(table, n)
    groups = int(group.max()) + 1
    level = load_levels(loads)
    cell, off, taken = _fixed(level, table, design)
    if n - taken < 1:
        level, (cell, off, taken) = None, _fixed(None, table, design)
    rest = off(residuals[:, None])[:, 0]
    total = float(rest @ rest)
    offset = gain = _Part(square=0.0, dof=0, trace=0.0)
    explained, rank = 0.0, 0
    if groups > 1:
        if n * groups > LARGEST_DESIGN:
            raise SessionError(
                "the session has too many runs for a budget", where="loads", got=f"{groups} runs, {n} rows",
                expected=f"at most {LARGEST_DESIGN:_} rows times runs",
                next_step="number the runs as they were mounted and loaded, one number a run", rule="budget",
            )  # fmt: skip
        explained, rank, offset, gain = _between(rest, off, group, groups, load)
        if n - taken - rank < 1:  # the runs take up everything: nothing is left to judge them by
            offset = gain = _Part(square=0.0, dof=0, trace=0.0)
            explained, rank = 0.0, 0
    dof = n - taken - rank
    variance = max(total - explained, 0.0) / dof
    reversal, reversal_dof = _reversal(residuals, level, table, variance)
    misfit, misfit_dof = _misfit(residuals, level, p, variance)
    return Scatter(
        within=variance**0.5,
        within_dof=dof,
        factor=factor,
        groups=groups,
        offset=offset.sd(variance),
        offset_dof=offset.dof,
        gain=gain.sd(variance),
        gain_dof=gain.dof,
        reversal=reversal,
        reversal_dof=reversal_dof,
        misfit=misfit,
        misfit_dof=misfit_dof,
        levels=cell is not None,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Part:
    """Sum of squares of one random effect, adjusted for everything else; E = dof s^2 + trace sd^2."""

    square: float
    dof: int
    trace: float

    def sd(self, variance: float) -> float:
        found = (self.square - self.dof * variance) / self.trace if self.trace > 0 and self.dof else 0.0
        return math.sqrt(max(found, 0.0))


def _groups(table: Table, rows: int) -> tuple[str, NDArray[np.int64]]:
    for name, values in (("mounting", table.rotation), ("run", table.run)):
        if values is None:
            continue
        found = np.unique(values % 360 if name == "mounting" else values, return_inverse=True)[1].ravel()
        if name == "run" or found.max() > 0:
            return name, np.asarray(found, dtype=np.int64)
    return "run", np.zeros(rows, dtype=np.int64)


def _fixed(
    level: NDArray[np.int64] | None, table: Table, design: NDArray[np.float64]
) -> tuple[NDArray[np.int64] | None, Off, int]:
    """Return the cells of level and direction, what takes their means off columns, and their number.

    Without levels the curve itself is taken off.
    """
    if level is None:
        basis = np.linalg.qr(design / np.maximum(np.abs(design).max(axis=0), 1e-300))[0]
        return None, lambda columns: columns - basis @ (basis.T @ columns), design.shape[1]
    down = np.zeros(len(level), dtype=np.int64) if table.up is None else (~table.up).astype(np.int64)
    cell = np.asarray(np.unique(2 * level + down, return_inverse=True)[1].ravel(), dtype=np.int64)
    count = np.bincount(cell)

    def off(columns: NDArray[np.float64]) -> NDArray[np.float64]:
        means = np.stack([np.bincount(cell, weights=one) / count for one in columns.T], axis=1)
        centred: NDArray[np.float64] = columns - means[cell]
        return centred

    return cell, off, len(count)


def _between(
    rest: NDArray[np.float64], off: Off, group: NDArray[np.int64], groups: int, load: NDArray[np.float64]
) -> tuple[float, int, _Part, _Part]:
    """Return what offset and gain explain together (squares, rank), and each adjusted for the other."""
    dummy = (group[:, None] == np.arange(groups)).astype(np.float64)
    relative = load / max(float(np.abs(load).max()), 1e-300)
    both = off(np.hstack([dummy, dummy * relative[:, None]]))
    gram, right = both.T @ both, both.T @ rest
    one, other = slice(0, groups), slice(groups, 2 * groups)
    whole, rank = _explained(gram, right)

    def part(mine: slice, others: slice) -> _Part:
        square, less = _explained(gram[others, others], right[others])
        cross = gram[mine, others]
        left = np.trace(
            gram[mine, mine] - cross @ np.linalg.pinv(gram[others, others], hermitian=True) @ cross.T
        )
        return _Part(square=whole - square, dof=rank - less, trace=float(left))

    return whole, rank, part(one, other), part(other, one)


def _explained(gram: NDArray[np.float64], right: NDArray[np.float64]) -> tuple[float, int]:
    values, vectors = np.linalg.eigh(gram)
    kept = values > 1e-9 * max(float(values[-1]), 1e-300)
    projected = vectors[:, kept].T @ right
    return float(projected @ (projected / values[kept])), int(kept.sum())


def _reversal(
    residuals: NDArray[np.float64], level: NDArray[np.int64] | None, table: Table, variance: float
) -> tuple[float, int]:
    """Return half the root mean square difference of the directions, freed of the scatter within."""
    if level is None or table.up is None:
        return 0.0, 0
    size = int(level.max()) + 1
    sides = (table.up, ~table.up)
    n = [np.bincount(level[side], minlength=size) for side in sides]
    sums = [np.bincount(level[side], weights=residuals[side], minlength=size) for side in sides]
    both = (n[0] > 0) & (n[1] > 0)
    count = int(both.sum())
    if not count:
        return 0.0, 0
    difference = sums[0][both] / n[0][both] - sums[1][both] / n[1][both]
    weight = n[0][both] * n[1][both] / (n[0][both] + n[1][both])
    square = float(weight @ difference**2) - count * variance
    return (max(square, 0.0) / float(weight.sum())) ** 0.5 / 2, count


def _misfit(
    residuals: NDArray[np.float64], level: NDArray[np.int64] | None, terms: int, variance: float
) -> tuple[float, int]:
    if level is None:
        return 0.0, 0
    count = np.bincount(level)
    dof = len(count) - terms
    if dof < 1:
        return 0.0, 0
    means = np.bincount(level, weights=residuals) / count
    square = float(count @ means**2) - dof * variance
    return (max(square, 0.0) / len(residuals)) ** 0.5, dof
