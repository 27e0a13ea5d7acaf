"""Which rows of a block are averaged, and how sure their mean is."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from toolkit.reduction.blocks import Block

if TYPE_CHECKING:
    from toolkit.machine import Machine
    from toolkit.recording.model import Recording

# Effective rolling radius over free radius of a radial passenger tire: 0.96 to 0.98.
ROLLING_RATIO = 0.97


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """Rows to be averaged; ``revolutions`` that they span, None where the file cannot tell.

    Revolutions are those of the shaft that the protocol counts, tire or drum.

    ``short`` says that the block ended before settling and averaging were complete.
    """

    rows: slice
    revolutions: float | None
    short: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Mean:
    """Mean, standard deviation over the rows, and standard uncertainty of the mean."""

    value: float
    sd: float
    u: float


def free_radius_m(tire_size: str | None) -> float | None:
    """Return the free radius [m] of a metric tire size, None where the text is none.

    >>> round(free_radius_m("205/55 R16 091T"), 3)
    0.316
    >>> free_radius_m("unknown") is None
    True
    """
    found = re.search(r"(\d{3})\s*/\s*(\d{2,3})\s*[A-Z]*\s*R?\s*[DB-]?\s*(\d{2}(?:\.5)?)", tire_size or "")
    if found is None:
        return None
    width, aspect, rim = (float(part) for part in found.groups())
    return (rim * 25.4 / 2 + width * aspect / 100) / 1000


def window(recording: Recording, block: Block, *, machine: Machine, rolling_radius_m: float | None) -> Window:
    """Choose the rows of a block that are averaged.

    The machine's own files start after the settling revolutions: the whole block counts. Rows are
    discarded only where the recording itself can tell revolutions: by a tire or drum angle, a time channel,
    or by a sample rate of a machine that records continuously.
    """
    turns = revolutions(recording, block, machine=machine, rolling_radius_m=rolling_radius_m)
    if turns is None:
        return Window(rows=block.rows, revolutions=None, short=False)
    protocol = machine.protocol
    first, length = protocol.settle_revolutions, protocol.average_revolutions
    short = float(turns[-1]) < (first + length) * (1 - 1e-9)
    if short:
        # The last revolution that there is: the nearest to settled.
        first = max(0.0, float(turns[-1]) - length)
    start = int(np.searchsorted(turns, first))
    stop = int(np.searchsorted(turns, first + length, side="left")) + (1 if short else 0)
    stop = min(max(stop, start + 1), block.n)
    rows = slice(block.start + start, block.start + stop)
    return Window(rows=rows, revolutions=float(turns[stop - 1] - turns[start]), short=short)


def revolutions(
    recording: Recording, block: Block, *, machine: Machine, rolling_radius_m: float | None
) -> NDArray[np.float64] | None:
    """Return revolutions of the protocol's shaft since the block's first row (rows,), None if unknown.

    The tire rolls on the drum: what the drum's surface travels, the tire's does too. A turn of the other
    shaft is known by the ratio of the circumferences, for which the tire's size must be known.
    """
    tire = None if rolling_radius_m is None else 2 * np.pi * rolling_radius_m
    drum = machine.drum.circumference_m
    wanted = tire if machine.protocol.revolutions_of == "tire" else drum
    shafts = (("TIRE_ANGLE", tire, "tire"), ("DRUM_ANGLE", drum, "drum"))
    for symbol, around, shaft in sorted(shafts, key=lambda one: one[2] != machine.protocol.revolutions_of):
        if not recording.has(symbol):
            continue
        angle = np.unwrap(recording[symbol].si[block.rows])
        turns = np.asarray(np.abs(angle - angle[0]) / (2 * np.pi))
        if shaft == machine.protocol.revolutions_of:
            return turns
        if around is not None and wanted is not None:
            return np.asarray(turns * around / wanted)
    if wanted is None:
        return None
    protocol = machine.protocol
    per_second = (protocol.speed_m_s or machine.drum.speed_m_s) / wanted
    if recording.has("t"):
        time = recording["t"].si[block.rows]
        return np.asarray((time - time[0]) * per_second)
    if machine.sample_rate_Hz and protocol.acquisition == "continuous":
        return np.arange(block.n) / machine.sample_rate_Hz * per_second
    return None


def means(values: NDArray[np.float64]) -> tuple[Mean, ...]:
    """Return the mean of consecutive rows and its uncertainty, for each channel.

    Parameters
    ----------
    values : (channels, rows)

    Notes
    -----
    Rows of one revolution are not independent: filter and non-uniformity tie neighbours together. The
    variance of the mean is inflated for a first-order autocorrelation, and never below that of
    independent rows nor above the scatter of one row (a slow line can hide in one revolution).
    """
    n = values.shape[1]
    average = values.mean(axis=1)
    if n < 2:
        return tuple(Mean(value=value, sd=0.0, u=0.0) for value in average.tolist())
    rest = values - average[:, None]
    squares = np.einsum("ij,ij->i", rest, rest)
    products = np.einsum("ij,ij->i", rest[:, 1:], rest[:, :-1])
    sd = np.sqrt(squares / (n - 1))
    rho = np.clip(products / np.where(squares > 0, squares, 1.0), 0.0, 0.999)
    u = np.minimum(sd * np.sqrt((1 + rho) / (1 - rho) / n), sd)
    return tuple(
        Mean(value=v, sd=s, u=w) for v, s, w in zip(*np.stack([average, sd, u]).tolist(), strict=True)
    )
