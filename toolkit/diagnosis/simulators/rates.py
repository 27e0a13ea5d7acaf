"""The rate of a recorded position: the velocity that was not recorded beside it.

A slope of straight lines through some rows, as few as leave its noise small beside the motion: what a
position shows of its sensor's noise in its quickest differences, and the steps in which it was recorded. A
rate that stays within its noise has no sign and is none: friction would follow the noise of a slide that
stands still.

Source: Savitzky and Golay, Anal. Chem. 36 (1964) 1627, the slope of the first order; Rice, Ann. Statist. 12
(1984) 1215, variance from differences.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.policy import NOISE, RATES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from toolkit.arrays import Array


_ORDER = 3  # of the differences: a parabola leaves none
_ROBUST = 1.4826  # standard deviation of a normal distribution over its median absolute deviation


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """A recorded position: its time [s], its values, the stretches without a gap, and how it is unsure.

    ``noise`` is the standard deviation of a value, ``step`` that in which it was recorded, zero for none.
    """

    t: Array
    x: Array
    pieces: tuple[slice, ...]
    noise: float
    step: float

    @staticmethod
    def of(t: Array, x: Array, turn: float | None = None) -> Track:
        """Return the track of a position that is the same again after a ``turn``, None for never."""
        there = np.isfinite(x)
        if not there.any():
            return Track(t, np.zeros(len(t)), (slice(0, len(t)),), 0.0, 0.0)
        x = np.interp(t, t[there], x[there])
        if turn is not None:
            x = np.unwrap(x, period=turn)
        usual = float(np.median(np.diff(t))) if len(t) > 1 else 1.0
        edges = [0, *(np.flatnonzero(np.diff(t) > NOISE.gap * usual) + 1).tolist(), len(t)]
        pieces = tuple(slice(first, last) for first, last in itertools.pairwise(edges))
        quick = [np.diff(x[piece], _ORDER) for piece in pieces]
        quickest = np.abs(np.concatenate(quick))
        weight = math.comb(2 * _ORDER, _ORDER)
        noise = _ROBUST * float(np.median(quickest)) / math.sqrt(weight) if len(quickest) else 0.0
        return Track(t, x, pieces, noise, _step(x))

    def noise_of_rate(self, reach: int) -> float:
        """Return the standard deviation of a rate over so many rows to each side.

        White noise is averaged away; the error of a step stays as large while the position stands on it.
        """
        row = float(np.median(np.diff(self.t))) if len(self.t) > 1 else 1.0
        white = self.noise / (row * math.sqrt(reach * (reach + 1) * (2 * reach + 1) / 3))
        return max(white, self.step / math.sqrt(12) / (row * reach))

    @property
    def longest(self) -> int:
        """The most rows to each side over which the motion of its longest stretch is still seen."""
        rows = max(piece.stop - piece.start for piece in self.pieces)
        return max(1, int(rows / RATES.windows - 1) // 2)

    def rate(self, reach: int) -> Array:
        """Return the rate over so many rows to each side, (n,), zero where it stays within its noise.

        For longer than a window: a motion that turns goes through its noise, and turns in the middle of it.
        """
        rates = np.zeros(len(self.t))
        for piece in self.pieces:
            rates[piece] = _slopes(self.t[piece], self.x[piece], reach)
        within = np.abs(rates) < RATES.within * self.noise_of_rate(reach)
        edges = np.flatnonzero(np.diff(within, prepend=False, append=False))
        for first, last in edges.reshape(-1, 2).tolist():
            if last - first > 2 * reach + 1:
                rates[first:last] = 0.0
        return rates


def reach_of(track: Track, speed: float) -> int | None:
    """Return the fewest rows to each side over which a rate is sure beside a usual speed, None for none."""
    for reach in range(1, track.longest + 1):
        if track.noise_of_rate(reach) <= RATES.noise * speed:
            return reach
    return None


def usual_speed(tracks: Sequence[Track]) -> float:
    """Return the root mean square of the rates of some tracks, of what is seen of them beyond their noise."""
    rates = [track.rate(track.longest) for track in tracks]
    return math.sqrt(float(np.mean(np.concatenate(rates) ** 2))) if rates else 0.0


def _step(x: Array) -> float:
    """Return the step in which a position was recorded; zero where it has values of every size.

    That of a lattice, or of one that stands still on most rows, by how far it then goes.
    """
    moved = np.abs(np.diff(x))
    size = float(np.abs(x).max(initial=0.0)) or 1.0
    moved = moved[moved > 1e-12 * size]
    if not len(moved):
        return 0.0
    held = float(np.median(moved)) if len(moved) < 0.5 * (len(x) - 1) else 0.0
    least = float(moved.min())
    on_lattice = np.allclose(moved / least, np.round(moved / least), atol=1e-3) and size / least < 1e7
    return max(held, least if on_lattice else 0.0)


def _slopes(t: Array, x: Array, reach: int) -> Array:
    """Return slopes of lines through rows to both sides; near the ends, those of a parabola there."""
    rows = 2 * reach + 1
    if len(t) < rows:
        return np.gradient(x, t) if len(t) > 1 else np.zeros(len(t))
    windows = np.arange(len(t) - rows + 1)[:, None] + np.arange(rows)
    times, places = t[windows], x[windows]
    times = times - times.mean(axis=1, keepdims=True)
    inside = (times * places).sum(axis=1) / (times**2).sum(axis=1)
    ends = []
    for part, at in ((slice(0, rows), slice(0, reach)), (slice(-rows, None), slice(-reach, None))):
        middle = t[part].mean()
        bent, slope, _ = np.polyfit(t[part] - middle, x[part], 2)
        ends.append(slope + 2 * bent * (t[at] - middle))
    return np.concatenate([ends[0], inside, ends[1]])
