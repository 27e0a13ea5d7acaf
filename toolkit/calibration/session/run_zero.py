"""``zero = "run"``: each run of a session has a zero of its own, and its indications are read from there.

Bridges that are not tared before every run, or that drift between runs, leave each run with another zero. It
is the run's own unknown in a plane of the indications over the loads, the same plane for all runs:

    x_i = B load_i + zero_r,   r the run of row i

by least squares over all rows. Runs need no row at zero load for it; check loads do, since a zero that was
computed from a check load would agree with whatever it reads.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.errors import SessionError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.calibration.session.table import Table

# Of the largest load: what a standard reads of nothing.
_UNLOADED = 1e-4


def without_run_zeros(table: Table, indications: Sequence[str], loads: Sequence[str]) -> Table:
    """Return reference loads with the zero of each run taken off its indications."""
    run = _runs(table)
    applied = table.matrix(loads)
    size = np.abs(applied).max(axis=0)
    design = _off_means(applied / np.where(size > 0, size, 1.0), run)
    cells = table.matrix(indications)
    plane = np.linalg.lstsq(design, _off_means(cells, run), rcond=None)[0]
    # Of a run that loads one axis alone, the plane of all runs tells what that load makes.
    zeros = _means(cells - (applied / np.where(size > 0, size, 1.0)) @ plane, run)
    return _less(table, indications, zeros[run])


def without_read_zeros(
    check: Table, indications: Sequence[str], loads: Sequence[str], where: object
) -> Table:
    """Return check loads with the zero of each run, as its rows at zero load read it, taken off.

    Raises
    ------
    SessionError
        ``zero``: a run without a row at zero load
    """
    run = _runs(check)
    applied = check.matrix(loads)
    size = np.abs(applied).max(axis=0)
    unloaded = (np.abs(applied) <= _UNLOADED * size).all(axis=1)
    missing = sorted(set(run.tolist()) - set(run[unloaded].tolist()))
    if missing:
        which = "" if check.run is None else f" of run {np.unique(check.run)[missing[0]]:g}"
        raise SessionError(
            f'the check loads{which} have no zero, and with zero = "run" each run has its own',
            where=where, got="no row with every load at zero",
            expected="at least one row at zero load in each run of the check file",
            next_step="read the unloaded cells with the check loads and add that row; nothing was written",
            rule="zero",
        )  # fmt: skip
    cells = check.matrix(indications)
    return _less(check, indications, _means(cells[unloaded], run[unloaded])[run])


def _runs(table: Table) -> NDArray[np.int64]:
    run = np.zeros(table.rows) if table.run is None else table.run
    return np.asarray(np.unique(run, return_inverse=True)[1].ravel(), dtype=np.int64)


def _means(values: NDArray[np.float64], run: NDArray[np.int64]) -> NDArray[np.float64]:
    count = np.bincount(run)[:, None]
    return np.stack([np.bincount(run, weights=column) for column in values.T], axis=1) / count


def _off_means(values: NDArray[np.float64], run: NDArray[np.int64]) -> NDArray[np.float64]:
    return np.asarray(values - _means(values, run)[run])


def _less(table: Table, names: Sequence[str], zeros: NDArray[np.float64]) -> Table:
    values = table.values.copy()
    values[:, [table.names.index(name) for name in names]] -= zeros
    return dataclasses.replace(table, values=values)
