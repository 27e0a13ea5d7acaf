"""Runs: which rows of a file the same candidates fit, from its first row to its last.

A file that changes in the middle is parted greedily: each run is as long as any candidate reaches. Files come
in parts of some thousand rows, and of a part only the rows where a group may fit are looked at, so that time
is linear in the rows and memory that of one part; what is kept of a run is a few bytes for each group in it.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_LUCKY = 3  # rows


@dataclass(frozen=True, slots=True, kw_only=True)
class Hit:
    """A candidate: ``group`` by its index, and the sign variant of each load by its index."""

    group: int
    signs: tuple[tuple[str, int], ...]


def products(group: int, variants: Mapping[str, NDArray[np.bool_]]) -> list[Hit]:
    """Return the candidates of a group: each load's variants (variants,) with each of the other's."""
    choices = [[(load, int(v)) for v in np.flatnonzero(mask)] for load, mask in variants.items()]
    return [Hit(group=group, signs=signs) for signs in itertools.product(*choices)] if choices else []


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Runs:
    """Runs that some candidate fits, in the order of the rows; what lies between them no candidate fits.

    ``starts`` and ``stops`` (runs,) 0-based, stop excluded. Each run has one pair or more: ``run`` (pairs,)
    rising, ``group`` (pairs,), and by load which sign variants fit all of its rows (pairs, variants).
    """

    rows: int
    starts: NDArray[np.int64]
    stops: NDArray[np.int64]
    run: NDArray[np.int64]
    group: NDArray[np.int64]
    variants: Mapping[str, NDArray[np.bool_]]

    @property
    def unknown(self) -> int:
        """How many rows no candidate fits."""
        return self.rows - int((self.stops - self.starts).sum())

    @property
    def parts(self) -> int:
        """How many parts the file has, those that no candidate fits included."""
        edges = np.concatenate([[0], self.stops]) != np.concatenate([self.starts, [self.rows]])
        return len(self.starts) + int(edges.sum())

    def where(self, mask: NDArray[np.bool_]) -> Runs:
        """Return some of the runs (runs,)."""
        pairs = mask[self.run]
        return Runs(
            rows=self.rows,
            starts=self.starts[mask],
            stops=self.stops[mask],
            run=(np.cumsum(mask) - 1)[self.run[pairs]],
            group=self.group[pairs],
            variants={load: masks[pairs] for load, masks in self.variants.items()},
        )

    def bounds(self) -> list[tuple[int, int, int | None]]:
        """Return every part of the file: first row, stop, and its place among the runs or None."""
        parts: list[tuple[int, int, int | None]] = []
        row = 0
        for place, (start, stop) in enumerate(zip(self.starts.tolist(), self.stops.tolist(), strict=True)):
            if row < start:
                parts.append((row, start, None))
            parts.append((start, stop, place))
            row = stop
        return [*parts, (row, self.rows, None)] if row < self.rows else parts

    def signatures(self) -> list[bytes]:
        """Return what tells the candidates of each run from those of another."""
        columns = [np.packbits(masks, axis=1) for masks in self.variants.values()]
        table = np.hstack([np.ascontiguousarray(self.group[:, None]).view(np.uint8), *columns])
        ends = np.searchsorted(self.run, np.arange(len(self.starts) + 1)).tolist()
        return [table[a:b].tobytes() for a, b in itertools.pairwise(ends)]

    def hits(self, place: int) -> tuple[Hit, ...]:
        """Return the candidates of one run."""
        first, last = np.searchsorted(self.run, [place, place + 1]).tolist()
        return tuple(
            hit
            for pair in range(first, last)
            for hit in products(
                int(self.group[pair]), {load: masks[pair] for load, masks in self.variants.items()}
            )
        )


def without_chance(runs: Runs) -> Runs:
    """Return the runs without those that a file of unknown origin has by chance.

    Thousands of candidates meet a few rows of any file. Where over half of the rows have no candidate, a run
    of one to three rows counts only if one of its candidates explains three rows and a fiftieth of the file.
    """
    if 2 * runs.unknown <= runs.rows or not len(runs.starts):
        return runs
    lengths = runs.stops - runs.starts
    enough = max(_LUCKY, runs.rows / 50)
    often = lengths > _LUCKY
    loads = [masks.astype(np.float64) for masks in runs.variants.values()]
    first = loads[0]
    second = loads[1] if len(loads) > 1 else np.ones((len(first), 1))
    order = np.argsort(runs.group, kind="stable")
    edges = np.flatnonzero(np.diff(runs.group[order])) + 1
    for pairs in np.split(order, edges):  # of one group
        weights = first[pairs] * lengths[runs.run[pairs], None]
        explained = weights.T @ second[pairs]  # rows of each candidate, first load's variants x second's
        many = (explained >= enough).astype(np.float64)
        often[runs.run[pairs[((first[pairs] @ many) * second[pairs]).any(axis=1)]]] = True
    return runs.where(often)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reach:
    """How far one group fits from each of the rows (k,) at which it may, rising.

    ``stops`` has by load the row at which each variant that begins there breaks off (variants, k), that row
    itself where it does not fit; ``stop`` (k,) is that of the longest candidate.
    """

    group: int
    rows: NDArray[np.int64]
    stops: Mapping[str, NDArray[np.int64]]
    stop: NDArray[np.int64]


def reach_of(group: int, rows: NDArray[np.int64], fits: Mapping[str, NDArray[np.bool_]]) -> Reach:
    """Return the reach of a group; ``fits`` (variants, k) for each load, at the rows (k,)."""
    last = np.append(np.diff(rows) != 1, True)  # the next row is none of these
    after = np.where(last, rows + 1, np.iinfo(np.int64).max)
    stops = {
        load: np.minimum.accumulate(np.where(fit, after, rows)[:, ::-1], axis=1)[:, ::-1]
        for load, fit in fits.items()
    }
    # A pair of variants fits as long as the shorter of the two; the longest pair is wanted.
    stop = np.minimum.reduce([of_load.max(axis=0) for of_load in stops.values()])
    return Reach(group=group, rows=rows, stops=stops, stop=stop)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Pairs:
    # Which groups explain which runs; see `Runs`.
    run: NDArray[np.int64]
    group: NDArray[np.int64]
    variants: dict[str, NDArray[np.bool_]]

    def where(self, mask: NDArray[np.bool_]) -> _Pairs:
        return _Pairs(
            run=self.run[mask],
            group=self.group[mask],
            variants={load: masks[mask] for load, masks in self.variants.items()},
        )


def _joined(parts: Sequence[_Pairs]) -> _Pairs:
    return _Pairs(
        run=np.concatenate([pairs.run for pairs in parts]),
        group=np.concatenate([pairs.group for pairs in parts]),
        variants={
            load: np.concatenate([pairs.variants[load] for pairs in parts]) for load in parts[0].variants
        },
    )


class Partition:
    """Parts a file into runs; its rows are added from the first to the last."""

    def __init__(self, loads: Sequence[str], variants: int) -> None:
        nothing = np.zeros(0, dtype=np.int64)
        empty = {load: np.zeros((0, variants), dtype=np.bool_) for load in loads}
        self._rows = 0
        self._start: int | None = None  # of a run that may go on in the rows to come
        self._open = _Pairs(run=nothing, group=nothing, variants=empty)  # its candidates so far
        self._starts, self._stops, self._pairs = [nothing], [nothing], [self._open]
        self._count = 0

    def add(self, stop: int, reaches: Sequence[Reach]) -> None:
        """Add the rows up to ``stop`` (excluded), with every group that fits any of them."""
        first, self._rows = self._rows, stop
        longest = np.zeros(stop - first, dtype=np.int64)
        for reach in reaches:
            at = reach.rows - first
            longest[at] = np.maximum(longest[at], reach.stop - reach.rows)
        row = self._extended(first, stop, {reach.group: reach for reach in reaches})
        starts = first + _jumps(longest, row - first)
        if not len(starts):
            return
        stops = starts + longest[starts - first]
        pairs = _at(starts, stops, reaches)
        if int(stops[-1]) == stop:
            last = pairs.run == len(starts) - 1
            self._start, self._open = int(starts[-1]), pairs.where(last)
            starts, stops, pairs = starts[:-1], stops[:-1], pairs.where(~last)
        self._close(starts, stops, pairs)

    def runs(self) -> Runs:
        """Return the runs of all rows that were added."""
        self._end(self._rows)
        pairs = _joined(self._pairs)
        return Runs(
            rows=self._rows,
            starts=np.concatenate(self._starts),
            stops=np.concatenate(self._stops),
            run=pairs.run,
            group=pairs.group,
            variants=pairs.variants,
        )

    def _extended(self, first: int, stop: int, reaches: Mapping[int, Reach]) -> int:
        # The row at which the open run ends, or would go on.
        if self._start is None:
            return first
        stops = {load: np.full(masks.shape, first) for load, masks in self._open.variants.items()}
        for pair, group in enumerate(self._open.group.tolist()):
            reach = reaches.get(group)
            if reach is not None and reach.rows[0] == first:
                for load, of_load in stops.items():
                    fits = self._open.variants[load][pair]
                    of_load[pair] = np.where(fits, reach.stops[load][:, 0], first)
        reached = np.minimum.reduce([of_load.max(axis=1) for of_load in stops.values()])
        end = int(reached.max())
        if end > first:
            self._open = _Pairs(
                run=self._open.run,
                group=self._open.group,
                variants={load: of_load >= end for load, of_load in stops.items()},
            ).where(reached == end)
        if end < stop:
            self._end(end)
        return end

    def _end(self, stop: int) -> None:
        if self._start is not None:
            alive = _Pairs(
                run=np.zeros_like(self._open.run), group=self._open.group, variants=self._open.variants
            )
            self._close(np.array([self._start]), np.array([stop]), alive)
            self._start = None

    def _close(self, starts: NDArray[np.int64], stops: NDArray[np.int64], pairs: _Pairs) -> None:
        self._starts.append(starts)
        self._stops.append(stops)
        self._pairs.append(_Pairs(run=pairs.run + self._count, group=pairs.group, variants=pairs.variants))
        self._count += len(starts)


def _jumps(longest: NDArray[np.int64], row: int) -> NDArray[np.int64]:
    # From run to run: the first row that is explained, and of each run the next one behind its last row.
    rows = np.arange(len(longest))
    explained = np.append(np.where(longest > 0, rows, len(rows)), len(rows))
    following = np.minimum.accumulate(explained[::-1])[::-1]
    after = following[rows + longest].tolist()
    starts: list[int] = []
    at = int(following[row])
    while at < len(rows):
        starts.append(at)
        at = after[at]
    return np.array(starts, dtype=np.int64)


def _at(starts: NDArray[np.int64], stops: NDArray[np.int64], reaches: Sequence[Reach]) -> _Pairs:
    # What explains runs that are as long as anything reaches.
    parts = []
    for reach in reaches:
        run = np.minimum(np.searchsorted(starts, reach.rows), len(starts) - 1)
        column = np.flatnonzero((starts[run] == reach.rows) & (reach.stop == stops[run]))
        parts.append(
            _Pairs(
                run=run[column],
                group=np.full(len(column), reach.group),
                variants={
                    load: (of_load[:, column] >= stops[run[column]]).T
                    for load, of_load in reach.stops.items()
                },
            )
        )
    pairs = _joined(parts)
    order = np.argsort(pairs.run, kind="stable")
    return _Pairs(
        run=pairs.run[order],
        group=pairs.group[order],
        variants={load: masks[order] for load, masks in pairs.variants.items()},
    )
