"""Segments: which candidate fits which rows of a file that changes in the middle.

A row fits a candidate where FY and MZ both do. From the first row on, the candidate that fits longest takes
the rows; rows that none fits form a segment of their own, be it a single one.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.audit.candidates import Group


_LUCKY = 3  # rows


@dataclass(frozen=True, slots=True, kw_only=True)
class Hit:
    """A candidate: ``group`` by its index, and the sign variant of each load by its index."""

    group: int
    signs: tuple[tuple[str, int], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """Rows ``start`` to ``stop`` (0-based, stop excluded) and the candidates that fit all of them."""

    start: int
    stop: int
    hits: tuple[Hit, ...]


def whole_file(fits: Sequence[dict[str, NDArray[np.bool_]]]) -> tuple[Hit, ...]:
    """Return the candidates that fit every row; ``fits`` has (variants, rows) a load for each group."""
    hits: list[Hit] = []
    for index, by_load in enumerate(fits):
        choices = [[(load, int(v)) for v in np.flatnonzero(fit.all(axis=1))] for load, fit in by_load.items()]
        hits += _products(index, choices)
    return tuple(hits)


def partition(fits: Sequence[dict[str, NDArray[np.bool_]]], rows: int) -> tuple[Run, ...]:
    """Split a file into runs of rows that the same candidates fit."""
    lengths = [{load: _run_lengths(fit) for load, fit in by_load.items()} for by_load in fits]
    # A pair of variants fits as long as the shorter of the two; the longest pair is wanted.
    reaches = np.zeros((len(fits), rows), dtype=np.int64)
    for reach, by_load in zip(reaches, lengths, strict=True):
        if by_load:
            reach[:] = np.minimum.reduce([length.max(axis=0) for length in by_load.values()])
    runs: list[Run] = []
    row = 0
    while row < rows:
        reach_here = reaches[:, row]
        longest = int(reach_here.max(initial=0))
        hits: list[Hit] = []
        for index in np.flatnonzero(reach_here == longest).tolist() if longest else ():
            choices = [
                [(load, int(v)) for v in np.flatnonzero(length[:, row] >= longest)]
                for load, length in lengths[index].items()
            ]
            hits += _products(index, choices)
        if longest == 0 and runs and not runs[-1].hits:
            runs[-1] = Run(start=runs[-1].start, stop=row + 1, hits=())
        else:
            runs.append(Run(start=row, stop=row + max(longest, 1), hits=tuple(hits)))
        row += max(longest, 1)
    return tuple(runs)


def without_chance(runs: Sequence[Run]) -> tuple[Run, ...]:
    """Return the runs without those that a file of unknown origin has by chance.

    Thousands of candidates meet a few rows of any file. Where over half of the rows have no candidate, a run
    of one to three rows counts only if one of its candidates explains three rows and a fiftieth of the file.
    """
    unknown = sum(run.stop - run.start for run in runs if not run.hits)
    if 2 * unknown <= runs[-1].stop:
        return tuple(runs)
    explained: Counter[Hit] = Counter()
    for run in runs:
        explained.update(dict.fromkeys(run.hits, run.stop - run.start))
    enough = max(_LUCKY, runs[-1].stop / 50)
    kept_runs: list[Run] = []
    for run in runs:
        lucky = run.stop - run.start <= _LUCKY and all(explained[hit] < enough for hit in run.hits)
        if run.hits and not lucky:
            kept_runs.append(run)
        elif kept_runs and not kept_runs[-1].hits:
            kept_runs[-1] = Run(start=kept_runs[-1].start, stop=run.stop, hits=())
        else:
            kept_runs.append(Run(start=run.start, stop=run.stop, hits=()))
    return tuple(kept_runs)


def _run_lengths(fit: NDArray[np.bool_]) -> NDArray[np.int64]:
    # How many rows from this one on fit without a break, variants x rows.
    rows = fit.shape[1]
    position = np.arange(rows)
    breaks = np.where(fit, rows, position)
    next_break = np.minimum.accumulate(breaks[:, ::-1], axis=1)[:, ::-1]
    return np.asarray(next_break - position)


def _products(index: int, choices: list[list[tuple[str, int]]]) -> list[Hit]:
    import itertools

    if not choices:
        return []
    return [Hit(group=index, signs=signs) for signs in itertools.product(*choices)]


def distinct_rivals(groups: Sequence[Group], accepted: Hit, *, slack: bool) -> tuple[Hit, ...]:
    """Return the candidates that this file cannot tell from the accepted one, itself included.

    Two candidates are told apart where their predictions differ, in some row of FY or MZ, by more than the
    sum of their two bounds (twice the bound): then not both could fit.
    """
    accepted_group = groups[accepted.group]
    close: list[Hit] = []
    for index, group in enumerate(groups):
        choices = []
        for load, variant in accepted.signs:
            mine, rival = accepted_group.families[load], group.families[load]
            limit = mine.bound + rival.bound
            if slack:
                limit = limit + mine.slack + rival.slack
            apart = np.abs(rival.predicted - mine.predicted[variant]) > limit
            choices.append([(load, int(v)) for v in np.flatnonzero(~apart.any(axis=1))])
        close += _products(index, choices)
    return tuple(close)
