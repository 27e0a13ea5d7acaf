"""New courses of an input: up and down through levels, no faster than it may go.

One family of few numbers: over how many levels, how often up and down, evenly or ever faster, with rests or
without. Steps, a staircase that rests, a slow way through zero and a sweep of frequencies are members of it.
Every move is the smoothest there is (of least jerk: Flash and Hogan, J. Neurosci. 5 (1985) 1688), so that
rates of change are continuous too. What cannot be reached in the time of a run is left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from toolkit.arrays import Array

_SHORTEST = 1 / 16  # of the first piece of a course that goes ever faster, its last one
_PEAK_RATE, _PEAK_ACCELERATION = 15 / 8, 10 / math.sqrt(3)  # of a move of least jerk, by the mean
_CROSSED = 0.1  # of an input's span: what it crosses by noise alone is less


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """A course: ``cycles`` up and down within a run over ``levels``, two at least.

    ``swept`` says that it goes ever faster, ``rests`` that each level is reached as fast as may be and held,
    else the moves follow each other.
    """

    cycles: float
    levels: int = 5
    swept: bool = False
    rests: bool = True

    def words(self) -> str:
        """Return the course for an operator.

        >>> Drive(cycles=2, levels=3).words()
        'up and down 2 times over 3 levels, each reached as fast as its limits allow and held'
        """
        way = "ever faster " * self.swept + f"up and down {self.cycles:g} times over {self.levels} levels"
        return way + (
            ", each reached as fast as its limits allow and held" if self.rests else ", without rest"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Pace:
    """How fast an input may change: its ``rate`` [1/s], and the rate's own [1/s^2]."""

    rate: float
    acceleration: float = math.inf

    def told_by_rows(self, seconds: float, miss: float) -> Pace:
        """Return a pace of which rows, so many ``seconds`` apart, miss no more than ``miss`` between them.

        A straight line misses a course by an eighth of its acceleration times the square of the time between
        rows. What is faster is no planned input: nobody could say afterwards what it was.
        """
        return Pace(rate=self.rate, acceleration=min(self.acceleration, 8 * miss / seconds**2))

    def farthest(self, seconds: float) -> float:
        """Return how far a move comes in a time."""
        return min(self.rate * seconds / _PEAK_RATE, self.acceleration * seconds**2 / _PEAK_ACCELERATION)

    def shortest(self, distance: float) -> float:
        """Return the time that a move takes at least [s].

        >>> pace = Pace(rate=2.0, acceleration=3.0)
        >>> round(pace.shortest(pace.farthest(0.7)), 12)
        0.7
        """
        if distance == 0:
            return 0.0
        by_rate = _PEAK_RATE * distance / self.rate if self.rate > 0 else math.inf
        return max(by_rate, math.sqrt(_PEAK_ACCELERATION * distance / self.acceleration))


def driven(t: Array, drive: Drive, start: float, ends: tuple[float, float], pace: Pace) -> Array:
    """Return a course (n,) from a start to the nearer of two ends and on over levels, at times (n,) [s]."""
    between = 2 * (drive.levels - 1)
    count = max(round(between * drive.cycles), 1) + 1
    order = drive.levels - 1 - np.abs(np.arange(count) % between - (drive.levels - 1))
    first, last = sorted(ends, key=lambda end: abs(end - start))
    targets = first + (last - first) * order / (drive.levels - 1)
    span = float(t[-1] - t[0])
    column, begin = np.full(len(t), start), float(t[0])
    if pace.rate <= 0 or span <= 0:
        return column
    lengths = _swept(targets, start, span, pace) if drive.swept else _even(targets, start, span, pace)
    for move, needed, length in lengths:
        seconds = needed if drive.rests else length
        share = np.clip((t - begin) / seconds, 0.0, 1.0) if seconds > 0 else (t > begin).astype(float)
        column += move * share**3 * (10 - 15 * share + 6 * share**2)
        begin += length
    return np.asarray(column)


def _even(targets: Array, start: float, span: float, pace: Pace) -> list[tuple[float, float, float]]:
    """Return moves, each with the time that it needs and has [s]: smaller ones where the time is too short.

    Each has what it needs and as much of what is left over as any other.
    """
    moves = np.diff(targets, prepend=start)

    def needed(share: float) -> Array:
        return np.array([pace.shortest(share * abs(move)) for move in moves.tolist()])

    share = 1.0
    if needed(1.0).sum() > span:
        low, high = 0.0, 1.0
        for _ in range(50):
            share = (low + high) / 2
            low, high = (share, high) if needed(share).sum() <= span else (low, share)
        share = low
    seconds = needed(share)
    lengths = seconds + (span - seconds.sum()) / len(moves)
    return list(zip((share * moves).tolist(), seconds.tolist(), lengths.tolist(), strict=True))


def _swept(targets: Array, start: float, span: float, pace: Pace) -> list[tuple[float, float, float]]:
    """Return moves in ever less time, each as far toward its level as the time lets it come."""
    lengths = np.geomspace(1.0, _SHORTEST, len(targets))
    moves, here = [], start
    for target, length in zip(targets.tolist(), (span * lengths / lengths.sum()).tolist(), strict=True):
        reach = pace.farthest(length)
        move = min(max(target - here, -reach), reach)
        moves.append((move, pace.shortest(abs(move)), length))
        here += move
    return moves


def fastest(t: Array, column: Array) -> float:
    """Return the largest rate [1/s] at which an input (n,) crosses a tenth of its span; 0 where it rests.

    Of neighbouring rows alone noise would be the rate.

    >>> t = np.arange(100) / 10
    >>> round(fastest(t, 3 * t), 9)
    3.0
    """
    least = _CROSSED * float(np.ptp(column))
    if least == 0:
        return 0.0
    for rows in range(1, len(t)):
        steps = np.abs(column[rows:] - column[:-rows])
        crossed = steps >= least * (1 - 1e-9)
        if crossed.any():
            return float(np.max(steps[crossed] / (t[rows:] - t[:-rows])[crossed]))
    return 0.0
