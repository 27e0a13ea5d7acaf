"""Which rows of a block are averaged, and how sure their mean is."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from toolkit.arrays import Array
from toolkit.machine import Machine
from toolkit.recording.model import Recording
from toolkit.reduction.blocks import Block

# Effective rolling radius over free radius of a radial passenger tire: 0.96 to 0.98.
ROLLING_RATIO = 0.97

_WHOLE_TURN = 0.02  # of a turn
_ROWS_EACH = 8  # rows that each signal takes at least
_NO_SIGNAL = 1e-9


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
    match = re.search(r"(\d{3})\s*/\s*(\d{2,3})\s*[A-Z]*\s*R?\s*[DB-]?\s*(\d{2}(?:\.5)?)", tire_size or "")
    if match is None:
        return None
    width, aspect, rim = (float(part) for part in match.groups())
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
) -> Array | None:
    """Return revolutions of the protocol's shaft since the block's first row (rows,), None if unknown.

    The tire rolls on the drum: what the drum's surface travels, the tire's does too. A turn of the other
    shaft is known by the ratio of the circumferences, for which the tire's size must be known. A shaft or a
    clock that stands still or runs backwards counts nothing: the next source counts.
    """
    protocol = machine.protocol
    tire = None if rolling_radius_m is None else 2 * np.pi * rolling_radius_m
    drum = machine.drum.circumference_m
    source = tire if protocol.revolutions_of == "tire" else drum
    shafts = (("TIRE_ANGLE", tire, "tire"), ("DRUM_ANGLE", drum, "drum"))
    for symbol, around, shaft in sorted(shafts, key=lambda shaft: shaft[2] != protocol.revolutions_of):
        if not recording.has(symbol):
            continue
        turns = shaft_turns(recording[symbol].si_of(block.rows))
        if turns is None:
            continue
        if shaft == protocol.revolutions_of:
            return turns
        if around is not None and source is not None:
            return np.asarray(turns * around / source)
    if source is None:
        return None
    per_second = (protocol.speed_m_s or machine.drum.speed_m_s) / source
    elapsed = clock_of(recording["t"].si_of(block.rows)) if recording.has("t") else None
    if elapsed is not None:
        return np.asarray(elapsed * per_second)
    if machine.sample_rate_Hz and protocol.acquisition == "continuous":
        return np.arange(block.n) / machine.sample_rate_Hz * per_second
    return None


def clock_of(time: Array) -> Array | None:
    """Return what a clock counts since its first row (rows,), None where it stands still or runs backwards.

    >>> clock_of(np.array([5.0, 5.0, 5.1])).round(9).tolist()
    [0.0, 0.0, 0.1]
    >>> clock_of(np.array([5.0, 5.1, 5.0])) is None
    True
    """
    elapsed = time - time[0]
    if len(elapsed) > 1 and (elapsed[-1] <= 0 or np.any(np.diff(elapsed) < 0)):
        return None
    return np.asarray(elapsed)


def shaft_turns(angle: Array) -> Array | None:
    """Return the turns of a shaft since its first row (rows,), None where it does not turn in one direction.

    An encoder's jitter is no turn backwards.
    """
    travelled = np.unwrap(angle) - angle[0]
    turns = np.abs(travelled) / (2 * np.pi)
    rising = np.maximum.accumulate(turns)
    if len(turns) > 1 and (rising[-1] < _WHOLE_TURN or np.any(rising - turns > _WHOLE_TURN)):
        return None
    return np.asarray(rising)


def means(values: Array, *, explained: Array | None = None) -> tuple[Mean, ...]:
    """Return the mean of consecutive rows and its uncertainty, for each channel.

    Parameters
    ----------
    values : (channels, rows)
    explained : (signals, rows) what the rows follow without its being an error of their mean, as the load
        at which that mean is stated does; what is left about it counts. Few rows are taken as they are.

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
    centred = values - average[:, None]
    sd = np.sqrt(np.einsum("ij,ij->i", centred, centred) / (n - 1))
    residual, explained_dof = _unexplained(centred, explained)
    squares = np.einsum("ij,ij->i", residual, residual)
    products = np.einsum("ij,ij->i", residual[:, 1:], residual[:, :-1])
    noise = np.minimum(np.sqrt(squares / (n - 1 - explained_dof)), sd)
    rho = np.clip(products / np.where(squares > 0, squares, 1.0), 0.0, 0.999)
    u = np.minimum(noise * np.sqrt((1 + rho) / (1 - rho) / n), noise)
    return tuple(
        Mean(value=v, sd=s, u=w) for v, s, w in zip(*np.stack([average, sd, u]).tolist(), strict=True)
    )


def turning(rows: int, revolutions: float | None) -> Array:
    """Return the first two harmonics of the tire's revolution (4, rows), none where its turns are not whole.

    Over whole revolutions a non-uniformity of the tire has no mean: its swing is no error.
    """
    turns = round(revolutions or 0.0)
    if revolutions is None or turns < 1 or abs(revolutions - turns) > _WHOLE_TURN:
        return np.zeros((0, rows))
    phase = 2 * np.pi * turns * np.arange(rows) / rows
    return np.stack([wave(order * phase) for order in (1, 2) for wave in (np.cos, np.sin)])


def _unexplained(residual: Array, explained: Array | None) -> tuple[Array, int]:
    """Return what signals leave of rows about their mean (channels, rows), and the freedoms that it took."""
    count = 0 if explained is None else len(explained)
    if explained is None or not count or residual.shape[1] < _ROWS_EACH * (count + 1):
        return residual, 0
    centred = explained - explained.mean(axis=1, keepdims=True)
    basis, size, _ = np.linalg.svd(centred.T, full_matrices=False)
    basis = basis[:, size > _NO_SIGNAL * max(float(size[0]), 1e-300)]
    return residual - (residual @ basis) @ basis.T, basis.shape[1]
