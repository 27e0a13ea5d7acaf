"""Recordings that are equal to the last digit: copies, or a coarse gauge that reads the same again."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np

from toolkit.arrays import Array
from toolkit.diagnosis.case.case import CaseChannel, Run

# Equal recordings that chance brings about less often than this, over all pairs of runs, are a copy.
LEAST_CHANCE = 0.01


def repeated_runs(runs: Sequence[Run]) -> dict[int, str]:
    """Return the runs whose file has the bytes of an earlier one, by their place, and that run's name."""
    first: dict[str, str] = {}
    repeats = {}
    for place, run in enumerate(runs):
        earlier = first.setdefault(run.sha256, run.name)
        if earlier != run.name:
            repeats[place] = earlier
    return repeats


def is_copy(run: Run, runs: Sequence[Run], channels: Sequence[CaseChannel]) -> bool:
    """Tell whether a repeated run is a copy: no noise repeats itself to the last digit.

    Readings in whole units do, and as often as the other runs say. An output that stands still may always.
    """
    outputs = [channel.name for channel in channels if channel.role == "output"]
    if all(len(set(run.columns.get(output, ()))) < 2 for output in outputs):
        return False
    inputs = [channel.name for channel in channels if channel.role == "input"]
    pairs = itertools.combinations([other for other in runs if other.sha256 != run.sha256], 2)
    same = [reading for pair in pairs for reading in _same_readings(*pair, inputs, outputs)]
    share = float(np.mean(same)) if same else 0.0
    return math.comb(len(runs), 2) * share**run.rows < LEAST_CHANCE


def _same_readings(run: Run, other: Run, inputs: Sequence[str], outputs: Sequence[str]) -> Array:
    """Return where two runs read the same, 1 or 0, of the rows in which their inputs are the same."""
    rows = min(run.rows, other.rows)

    def alike(names: Sequence[str]) -> Array:
        recorded = [name for name in names if name in run.columns and name in other.columns]
        columns = [run.columns[name][:rows] == other.columns[name][:rows] for name in recorded]
        return np.all(columns, axis=0) if columns else np.zeros(rows, dtype=bool)

    return np.asarray(alike(outputs)[alike(inputs)], dtype=float)
