"""Rows of a table without a time: in the order of its inputs, where their own order tells nothing.

Such a table is a set of readings, and no answer may hang on how somebody has sorted it: neighbours, from
which noise is read, are neighbours in the inputs. A table has an order where a load goes up and down in it,
as a cell is loaded: there what remembers its way can show.

Source: Kendall and Stuart, The Advanced Theory of Statistics, vol. 3, ch. 45: of n values in any order
2 (n - 2) / 3 are turning points, with the variance (16 n - 29) / 90.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.policy import ROWS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.arrays import Array
    from toolkit.diagnosis.case.case import Case, Run


def by_inputs(case: Case) -> tuple[Case, tuple[NDArray[np.intp], ...]] | None:
    """Return a case with the rows of each run in the order of its inputs, and where they stood, (n,) each.

    None where the order of the rows is one: of time, or of a load that goes up and down. Rows of the same
    inputs stand in an order that hangs on nothing but their own numbers.
    """
    if case.has_time or case.simulation.kind not in ("python", "columns"):
        return None
    drivers = [drivers_of(case, run) for run in case.runs]
    names = dict.fromkeys(name for columns in drivers for name in columns)
    if any(_goes_up_and_down([each[name] for each in drivers if name in each]) for name in names):
        return None
    orders = tuple(_order(run, columns) for run, columns in zip(case.runs, drivers, strict=True))
    runs = tuple(_ordered(run, order) for run, order in zip(case.runs, orders, strict=True))
    return replace(case, runs=runs, has_order=False), orders


def seed_of(case: Case) -> int:
    """Return the seed of a case's draws: of its hash; where rows have no order, of the readings themselves.

    A file that was sorted in another way has another hash.
    """
    if case.has_order:
        return int(case.sha256[:12], 16)
    mark = hashlib.blake2b(digest_size=6)
    for run in case.runs:
        for name, column in (*run.columns.items(), *run.simulated.items()):
            mark.update(name.encode() + column.tobytes())
    return int.from_bytes(mark.digest())


def drivers_of(case: Case, run: Run) -> Mapping[str, Array]:
    """Return what drives a run; of another program's output, beside which no input stands, that output."""
    columns = {driver.name: run.columns[driver.name] for driver in case.drivers if driver.name in run.columns}
    return columns or run.simulated


def _order(run: Run, drivers: Mapping[str, Array]) -> NDArray[np.intp]:
    everything = np.column_stack([*run.columns.values(), *run.simulated.values()])
    marks = np.array([hashlib.blake2b(row.tobytes(), digest_size=8).digest() for row in everything])
    ranks = np.unique(marks, return_inverse=True)[1]
    return np.lexsort([ranks, *reversed(list(drivers.values()))])


def _ordered(run: Run, order: NDArray[np.intp]) -> Run:
    return replace(
        run,
        columns={name: column[order] for name, column in run.columns.items()},
        simulated={name: column[order] for name, column in run.simulated.items()},
        file_rows=np.column_stack([order, order]),
    )


def _goes_up_and_down(columns: list[Array]) -> bool:
    """Tell whether a driver goes both ways, over several rows each, and turns less often than by chance."""
    turns, expected, variance, ways = 0, 0.0, 0.0, set[float]()
    for column in columns:
        values = _moved(column)
        signs = np.sign(np.diff(values))
        same = signs[1:] == signs[:-1]
        ways.update(signs[1:][same].tolist())
        if len(values) > 2:
            turns += int((~same).sum())
            expected += 2 * (len(values) - 2) / 3
            variance += (16 * len(values) - 29) / 90
    return len(ways) == 2 and turns < expected - ROWS.fewer_turns * math.sqrt(variance)


def _moved(column: Array) -> Array:
    """Return the values of a driver each of which is a step from the one before: a dwell is one of them."""
    least = ROWS.step * float(np.ptp(column))

    def steps() -> Iterator[float]:
        last = math.inf
        for value in column.tolist():
            if abs(value - last) > least:
                last = value
                yield value

    return np.array(list(steps()))


def dealt(rows: slice, drivers: list[Array], folds: int) -> list[NDArray[np.intp]]:
    """Return the rows of each fold of a run without an order: groups of neighbours, dealt out in turn.

    The outer fifth of a table asks what nobody recorded; of groups between others every fit knows both sides.
    Rows of the same inputs stay together.

    Parameters
    ----------
    drivers : of all rows, in whose order they stand
    """
    at = np.arange(rows.start, rows.stop)
    new = np.zeros(len(at), dtype=bool)
    for column in drivers:
        new[1:] |= column[at[1:]] != column[at[:-1]]
    levels = np.cumsum(new)
    count = int(levels[-1]) + 1 if len(at) else 0
    groups = folds * max(1, min(ROWS.groups, count // (ROWS.group * folds)))
    parts = np.array_split(np.arange(count), groups)
    return [at[np.isin(levels, np.concatenate(parts[fold::folds]))] if count else at for fold in range(folds)]
