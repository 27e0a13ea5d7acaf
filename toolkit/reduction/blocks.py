"""How rows are parted: load blocks at one vertical load, and the rests of a continuous recording."""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array

# A jump is larger than the row-to-row noise and than a small part of the largest load. The upper limit
# keeps a file with one row a load in five blocks: there every step is a jump and noise cannot be seen.
_NOISE_FACTOR = 8.0
_LEAST_JUMP = 0.02
_LARGEST_JUMP = 0.08
_VALUES = 1 << 16  # values of blocks that are averaged at a time


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """Rows ``start`` to ``stop`` (0-based, stop excluded) at one load; ``mean_FZ`` [N]."""

    start: int
    stop: int
    mean_FZ: float

    @property
    def rows(self) -> slice:
        """The block as a slice of a recording's arrays."""
        return slice(self.start, self.stop)

    @property
    def n(self) -> int:
        """Number of rows."""
        return self.stop - self.start


def find_blocks(FZ: Array) -> tuple[Block, ...]:
    """Split rows where the load jumps.

    Parameters
    ----------
    FZ : (rows,) load [N], in the order of recording

    Returns
    -------
    blocks in the order of recording; they cover every row, a tare block included

    Examples
    --------
    >>> [block.n for block in find_blocks(np.array([250.0, 251, 567, 566, 567, 833]))]
    [2, 3, 1]
    """
    steps = np.abs(np.diff(FZ))
    largest = float(np.max(np.abs(FZ)))
    noise = 1.4826 * float(np.median(steps)) / np.sqrt(2) if steps.size else 0.0
    limit = min(max(float(_NOISE_FACTOR * noise), _LEAST_JUMP * largest), _LARGEST_JUMP * largest)
    edges = [0, *(np.flatnonzero(steps > limit) + 1).tolist(), len(FZ)]
    rows = list(itertools.pairwise(edges))
    means = block_means(FZ, rows).tolist()
    return tuple(Block(start=a, stop=b, mean_FZ=mean) for (a, b), mean in zip(rows, means, strict=True))


def block_means(values: Array, rows: Sequence[tuple[int, int]]) -> Array:
    """Return the mean of the values (rows,) in each block (blocks,); ``rows``: first row and stop of each.

    Each is what ``mean`` gives of that block alone, to the last bit. Blocks of one length are taken at once:
    a file whose load jumps from row to row has as many blocks as rows.

    >>> block_means(np.array([1.0, 3.0, 5.0]), [(0, 2), (2, 3)]).tolist()
    [2.0, 5.0]
    """
    starts, stops = np.array(rows, dtype=np.int64).reshape(-1, 2).T
    means = np.empty(len(starts))
    lengths = stops - starts
    order = np.argsort(lengths, kind="stable")
    edges = np.flatnonzero(np.diff(lengths[order])) + 1
    for alike in np.split(order, edges) if len(order) else ():
        length = int(lengths[alike[0]])
        step = max(1, _VALUES // length)
        for first in range(0, len(alike), step):
            batch = alike[first : first + step]
            if len(batch) == 1:
                start = int(starts[batch[0]])
                means[batch] = values[start : start + length].mean()
            else:
                windows = np.lib.stride_tricks.sliding_window_view(values, length)
                means[batch] = windows[starts[batch]].mean(axis=1)
    return means


def is_tare(block: Block, *, smallest_load: float) -> bool:
    """Tell whether a block is a tare: under 5 % of the smallest load of the protocol [N]."""
    return abs(block.mean_FZ) < 0.05 * smallest_load


# Rests of a continuous recording: where slip angle and load stand still between the moves.

# The rows with which a move ends lie inside the bands too; a rest begins where both have come this near,
# as a part of the band, to their median over the rest.
_ARRIVED = 0.25


def find_rests(
    *, SA: Array, FZ: Array, turns: Array, band_SA: float, band_FZ: float, floor_FZ: float, least_turns: float
) -> tuple[Block, ...]:
    """Return the rests of a recording that holds the moves too, in the order of recording.

    Parameters
    ----------
    SA, FZ : (rows,) slip angle [rad] and load [N]
    turns : (rows,) revolutions since the first row, rising
    band_SA : range of the slip angle [rad] within one rest
    band_FZ : range of the load within one rest, as a part of its largest value; ``floor_FZ`` [N] is the
        range that is always allowed, so that a lifted wheel rests too
    least_turns : a rest lasts so many revolutions; what is shorter is part of a move

    Notes
    -----
    The longest run of rows inside both bands is a rest; then the longest of what is left on either side. A
    single row beyond a band ends a run, so that a band must be wider than the noise.

    Examples
    --------
    >>> SA = np.radians([0, 0, 0, 0, 1, 2, 2, 2, 2])
    >>> rests = find_rests(SA=SA, FZ=np.full(9, 1000.0), turns=np.arange(9) / 3, band_SA=0.01,
    ...     band_FZ=0.1, floor_FZ=50.0, least_turns=1.0)
    >>> [(rest.start, rest.stop) for rest in rests]
    [(0, 4), (5, 9)]
    """
    ends = _ends(SA, FZ, band_SA=band_SA, band_FZ=band_FZ, floor_FZ=floor_FZ)
    row = float(turns[-1] - turns[0]) / max(len(turns) - 1, 1)
    blocks: list[Block] = []
    open_parts = [(0, len(SA))]
    while open_parts:
        first, last = open_parts.pop()
        if last <= first or turns[last - 1] - turns[first] + row < least_turns * (1 - 1e-9):
            continue
        stops = np.minimum(ends[first:last], last)
        lengths = turns[stops - 1] - turns[first:last]
        start = first + int(np.argmax(lengths))
        stop = int(stops[start - first])
        a, b = _arrived(SA, FZ, start, stop, band_SA=band_SA, band_FZ=band_FZ, floor_FZ=floor_FZ)
        if lengths[start - first] + row < least_turns * (1 - 1e-9):
            continue
        if turns[b - 1] - turns[a] + row >= least_turns * (1 - 1e-9):
            blocks.append(Block(start=a, stop=b, mean_FZ=float(FZ[a:b].mean())))
        open_parts += [(first, start), (stop, last)]
    return tuple(sorted(blocks, key=lambda block: block.start))


def _ends(SA: Array, FZ: Array, *, band_SA: float, band_FZ: float, floor_FZ: float) -> NDArray[np.int64]:
    """Return for every row where the run that begins there leaves a band, (rows,), the row excluded."""
    angles, loads = _Extremes(SA.tolist()), _Extremes(FZ.tolist())
    ends = np.empty(len(SA), dtype=np.int64)
    start = 0
    for row in range(len(SA)):
        angles.add(row)
        loads.add(row)
        while start < row and (
            angles.range > band_SA or loads.range > max(band_FZ * loads.largest, floor_FZ)
        ):
            ends[start] = row
            start += 1
            angles.drop_before(start)
            loads.drop_before(start)
    ends[start:] = len(SA)
    return ends


class _Extremes:
    """Largest and smallest value of a window that moves over a list (monotone queues)."""

    def __init__(self, values: list[float]) -> None:
        self._values = values
        self._high: deque[int] = deque()
        self._low: deque[int] = deque()

    def add(self, row: int) -> None:
        values = self._values
        while self._high and values[self._high[-1]] <= values[row]:
            self._high.pop()
        while self._low and values[self._low[-1]] >= values[row]:
            self._low.pop()
        self._high.append(row)
        self._low.append(row)

    def drop_before(self, row: int) -> None:
        for queue in self._queues():
            while queue and queue[0] < row:
                queue.popleft()

    def _queues(self) -> Iterator[deque[int]]:
        yield self._high
        yield self._low

    @property
    def largest(self) -> float:
        return self._values[self._high[0]]

    @property
    def range(self) -> float:
        return self.largest - self._values[self._low[0]]


def _arrived(
    SA: Array, FZ: Array, start: int, stop: int, *, band_SA: float, band_FZ: float, floor_FZ: float
) -> tuple[int, int]:
    """Return the run without the rows at its ends in which the machine still moves."""
    stretch = slice(start, stop)
    middle_SA, middle_FZ = float(np.median(SA[stretch])), float(np.median(FZ[stretch]))
    room_FZ = max(band_FZ * middle_FZ, floor_FZ)
    near = (np.abs(SA[stretch] - middle_SA) <= _ARRIVED * band_SA) & (
        np.abs(FZ[stretch] - middle_FZ) <= _ARRIVED * room_FZ
    )
    rows = np.flatnonzero(near)
    return (start + int(rows[0]), start + int(rows[-1]) + 1) if rows.size else (start, stop)
