"""The rows of a session as their scatter is judged: their mean, their runs, and which rows stand for all.

The mean holds, beside the terms of the equation, what a curve may miss smoothly (powers 2 to 4 of the load)
and what loading and unloading may do apart (a parabola over the load), so that neither passes for scatter: no
levels of load are looked for, and reference loads need not repeat.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.arrays import Array

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.calibration.session.table import Table

# Rows over which the mean may bend and rows may be correlated: with fewer, both take what is scatter.
ENOUGH_DOF = 20
HIGHEST_POWER = 4
MOST_GROUPS = 60
# Rows of a run on average, beyond its zero and its gain: with fewer, both take up what is noise.
SPARE_ROWS = 0.5
MOST_ROWS = 2000
# Beyond it products of zeros leave nothing of the scatter within runs in double precision.
_LARGEST_RATIO = 1e4
_LARGEST_CORRELATION = 0.97
_DEPENDENT = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mean:
    """Orthonormal columns of the mean (rows, columns): the terms', then ``misfit``, then ``direction``."""

    columns: Array
    misfit: slice
    direction: slice


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SessionRows:
    """The rows of one load: its reference loads (rows,), their mean, and the runs.

    ``relative`` (rows,) is the load that the equation gives, by the largest: an effect in proportion to the
    reference loads themselves could take them up whole. ``group`` numbers from 0 what tells the rows apart
    (``factor``: run or mounting); ``own_zeros``: the mean holds a zero of every run, so that differences of
    zeros are no scatter. Of long sessions a sample stands for all: `MOST_GROUPS` runs, and of each every
    ``stride``-th row, so that rows are `MOST_ROWS` at most; more would narrow estimates that are narrow.
    ``noise`` (rows,) is the size of each row's scatter by their root mean square, None where they are alike.
    """

    load: Array
    relative: Array
    mean: Mean
    factor: str
    group: NDArray[np.int64]
    own_zeros: bool
    stride: int = 1
    noise: Array | None = None

    @classmethod
    def of(
        cls,
        design: Array,
        load: Array,
        table: Table,
        zero: str,
        *,
        noise: Array | None = None,
        every: bool = False,
    ) -> SessionRows:
        """Return the rows of a load (rows,) with the terms of its equation (rows, terms).

        ``noise`` (rows,) and ``every`` (see `groups_of`) as the method and the record have them.
        """
        factor, group = groups_of(table, zero, every=every)
        sample, stride = _sample(group)
        group = _numbered(group[sample])
        design, load = design[sample], load[sample]
        up = None if table.up is None else table.up[sample]
        zeros = np.empty((len(load), 0))
        if zero == "run" and table.run is not None:
            run = _numbered(table.run[sample])
            zeros = (run[:, None] == np.arange(int(run.max()) + 1)).astype(np.float64)
        terms = _basis([design])[0]
        relative = terms @ (terms.T @ load) / (float(np.abs(load).max()) or 1.0)
        mean = mean_of(np.column_stack([design, zeros]), relative, up)
        return cls(
            load=load, relative=relative, mean=mean, factor=factor, group=group,
            own_zeros=bool(zeros.size), stride=stride, noise=None if noise is None else noise[sample],
        )  # fmt: skip

    @property
    def groups(self) -> int:
        """Number of runs or mountings."""
        return int(self.group.max()) + 1

    @property
    def dof(self) -> int:
        """Degrees of freedom that the mean and the runs leave for the scatter within them, one at least.

        Runs of two rows share theirs between scatter and gain: half of them are taken for either.
        """
        n, p = self.mean.columns.shape
        effects = 1 if self.own_zeros else 2
        return max(int(n - p - (self.groups - 1) * effects), int(n - p) // (1 + effects), 1)

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


def groups_of(table: Table, zero: str, *, every: bool = False) -> tuple[str, NDArray[np.int64]]:
    """Return what tells a session's rows apart, and each row's group from 0 (rows,).

    Mountings take the place of runs where the session has more than one rotation: ISO 376 takes
    reproducibility between rotated mountings, repeatability within one. Where fewer than two of them
    have two rows, or all of them hardly more than their own zero and gain take (the gain alone where ``zero``
    is "run": it is read), they tell nothing of each other: all rows are one group, but for ``every``, which
    numbers them as they stand (as records made before did).
    """
    factor, group = "run", np.zeros(table.rows, dtype=np.int64)
    if table.rotation is not None and len(np.unique(table.rotation)) > 1:
        factor, group = "mounting", _numbered(table.rotation)
    elif table.run is not None:
        group = _numbered(table.run)
    counts = np.bincount(group)
    if not every and (
        np.count_nonzero(counts > 1) < 2 or counts.mean() < (1 if zero == "run" else 2) + SPARE_ROWS
    ):
        group = np.zeros_like(group)
    return factor, group


def are_untold(table: Table, zero: str) -> bool:
    """Tell whether rows are numbered as of several runs, of too few to show zeros and gains."""
    return bool(groups_of(table, zero, every=True)[1].any()) and not groups_of(table, zero)[1].any()


def mean_of(design: Array, relative: Array, up: NDArray[np.bool_] | None) -> Mean:
    """Return the columns of the mean for a design (rows, terms) and relative loads (rows,)."""
    n = len(relative)
    misfit, direction = np.empty((n, 0)), np.empty((n, 0))
    if n - design.shape[1] >= ENOUGH_DOF:
        misfit = np.stack([relative**k for k in range(2, HIGHEST_POWER + 1)], axis=1)
        if up is not None and 0 < int(np.count_nonzero(up)) < n:
            side = np.where(up, 1.0, -1.0)
            direction = np.stack([side, side * relative, side * relative**2], axis=1)
    columns, sizes = _basis([design, misfit, direction])
    ends = np.cumsum(sizes).tolist()
    return Mean(columns=columns, misfit=slice(ends[0], ends[1]), direction=slice(ends[1], ends[2]))


def _sample(group: NDArray[np.int64]) -> tuple[NDArray[np.int64], int]:
    """Return which rows stand for all (rows,), and how many rows of a run each of them stands for."""
    groups = int(group.max()) + 1
    places = np.arange(len(group))
    if groups <= MOST_GROUPS and len(group) <= MOST_ROWS:
        return places, 1
    picked = np.unique(np.linspace(0, groups - 1, min(groups, MOST_GROUPS)).round().astype(np.int64))
    rows = places[np.isin(group, picked)]
    stride = max(math.ceil(len(rows) / MOST_ROWS), 1)
    order = rows[np.argsort(group[rows], kind="stable")]
    sorted_group = group[order]
    place = np.arange(len(order)) - np.searchsorted(sorted_group, sorted_group)
    return np.sort(order[place % stride == 0]), stride


def _basis(blocks: list[Array]) -> tuple[Array, list[int]]:
    """Return an orthonormal basis of columns in their order (rows, columns), and how many each block gave.

    A column that those before it make up gives none.
    """
    columns = np.column_stack(blocks)
    owner = np.repeat(np.arange(len(blocks)), [block.shape[1] for block in blocks])
    while True:
        length = np.sqrt(np.einsum("ij,ij->j", columns, columns))
        q, r = np.linalg.qr(columns / np.where(length > 0, length, 1.0))
        spare = np.abs(np.diag(r)) <= _DEPENDENT
        if not spare.any():
            return q, np.bincount(owner, minlength=len(blocks)).tolist()
        # One at a time: those behind it were judged against a direction that is none.
        keep = np.arange(columns.shape[1]) != int(np.argmax(spare))
        columns, owner = columns[:, keep], owner[keep]


def _numbered(values: NDArray[Any]) -> NDArray[np.int64]:
    return np.asarray(np.unique(values, return_inverse=True)[1].ravel(), dtype=np.int64)
