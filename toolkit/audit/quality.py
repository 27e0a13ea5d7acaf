"""What the rows of one file show besides its calibration: dead and saturated channels, clock jumps, loads
that no tire has."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.findings import Finding
from toolkit.reduction.physics import departures, of_sizes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.recording.model import Recording, Series

_FEW_ROWS = 8  # fewer prove nothing
_STUCK = 6  # rows in a row at the very end of a channel's range
_JUMP = 10.0  # in median steps of the clock
_MEASURED = ("load", "indication", "slip_angle")


def quality(recording: Recording, where: str) -> tuple[Finding, ...]:
    """Return what the channels of a recording show, as notes.

    ``constant-channel``: a measured channel that never changes. ``saturated-channel``: at least six rows in
    a row stand exactly at its largest or smallest value, while elsewhere neighbouring rows differ.
    ``clock-jump``: a time channel that runs backwards, stands still, or leaps by over ten of its steps.
    """
    if recording.rows < _FEW_ROWS:
        return ()
    findings: list[Finding] = []
    for channel in recording.series:
        text = None
        if channel.role == "time":
            text, rule = _clock(channel), "clock-jump"
        elif channel.role in _MEASURED:
            first = channel.values[0]
            if bool(np.all(channel.values == first)):
                text = f"{channel.header} is {first:g} {channel.unit} in all {recording.rows} rows"
                rule = "constant-channel"
            else:
                text, rule = _saturated(channel), "saturated-channel"
        if text is not None:
            findings.append(Finding(rule=rule, where=where, message=text, level="note"))
    return tuple(findings)


def _saturated(series: Series) -> str | None:
    values = series.values
    repeated = values[1:] == values[:-1]
    if int(repeated.sum()) < _STUCK - 1:
        return None  # the usual case, and the cheap one
    for end in (float(values.max()), float(values.min())):
        start, length = _longest(values == end)
        # A channel printed so coarsely that it often repeats is not at an end of its range.
        elsewhere = int(repeated.sum()) - (length - 1)
        if length >= _STUCK and elsewhere < 0.2 * len(repeated):
            return (
                f"{series.header} stands at {end:g} {series.unit}, an end of its range, in "
                f"rows {start + 1} to {start + length}"
            )
    return None


def _longest(true: NDArray[np.bool_]) -> tuple[int, int]:
    # Start and length of the longest run of True.
    edges = np.flatnonzero(np.diff(np.concatenate([[False], true, [False]]).astype(np.int8)))
    starts, lengths = edges[::2], edges[1::2] - edges[::2]
    best = int(np.argmax(lengths))
    return int(starts[best]), int(lengths[best])


def _clock(series: Series) -> str | None:
    steps = np.diff(series.values)
    usual = float(np.median(steps))
    bad = np.flatnonzero((steps <= 0) | (steps > _JUMP * usual))
    if not len(bad):
        return None
    row = int(bad[0])
    return (
        f"{series.header} goes from {series.values[row]:g} to {series.values[row + 1]:g} {series.unit} after "
        f"row {row + 1}; the usual step is {usual:g}" + (f" ({len(bad)} such places)" if len(bad) > 1 else "")
    )


# What a file's Fy and Mz, its own or corrected ones, claim of the tire: judged by physics alone.

# Load [N], slip angle [rad], FY [N], MZ [N·m] of a load block; None or NaN where the file has none.
Block = tuple[float, float | None, float | None, float | None]


def impossible(
    where: str, rows: Sequence[str], blocks: Sequence[Block], *, values: str
) -> tuple[Finding, ...]:
    """Return what no tire can do among the load blocks of one file, as findings of level error.

    Only sizes are judged: one file does not say which way its axes point and its drum turned.

    Parameters
    ----------
    where : the file
    rows : name of each block in it
    blocks : their means
    values : what the values are, such as ``stored Fy and Mz``
    """
    loaded = [
        (name, block)
        for name, block in zip(rows, blocks, strict=True)
        if block[0] > 0 and block[2] is not None
    ]
    if not loaded:
        return ()
    table = np.array(
        [[math.nan if value is None else value for value in block] for _, block in loaded], dtype=np.float64
    )
    FZ, SA, FY, MZ = table.T
    broken = departures(
        of_sizes(
            [f"{where}, {name}" for name, _ in loaded], FZ=FZ, SA=SA, FY=FY, MZ=np.nan_to_num(MZ, nan=0.0)
        )
    )
    return tuple(departure.finding(level="error", of=values) for departure in broken)
