"""How often the rows of a sound session are left alone by the search for those that contradict the others."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np
from numpy.typing import NDArray

from tests.coverage.rows import CoverageRow, row_of
from toolkit.calibration.fit.robust import contradicting

SHAPES = ((12, 2), (20, 4), (81, 4), (81, 8), (120, 13))
"""Rows and terms of a session."""
SESSIONS = 5
"""For each repetition of the other tables: what is counted happens twice in a thousand."""


def plane(rows: int, terms: int, seed: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the design and the load of a sound session with noise of 1."""
    rng = np.random.default_rng(seed)
    design = np.column_stack([rng.uniform(-1, 1, (rows, terms - 1)), np.ones(rows)])
    return design, design @ np.full(terms, 50.0) + rng.normal(0, 1, rows)


def names_a_row(rows: int, terms: int, seed: int) -> bool:
    """Tell whether some row of a sound session is named."""
    return bool(contradicting(*plane(rows, terms, seed)))


def table(repetitions: int, seed: int, workers: int) -> list[CoverageRow]:
    """Return a row for each shape: the share of sessions of which no row is named."""
    seeds = [100_000 * seed + i for i in range(SESSIONS * repetitions)]
    rows = []
    with ProcessPoolExecutor(workers) as pool:
        for shape in SHAPES:
            named = list(pool.map(partial(names_a_row, *shape), seeds, chunksize=10))
            row = row_of(
                "sound rows left alone",
                f"{shape[0]} rows, {shape[1]} terms",
                errors=[float(one) for one in named],
                u=[1.0] * len(named),
                U=[0.5] * len(named),
            )
            rows.append(row.without_widths())
    return rows
