"""What a file's Fy and Mz, its own or corrected ones, claim of the tire: judged by physics alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.findings import Finding
from toolkit.reduction.physics import departures, of_sizes

if TYPE_CHECKING:
    from toolkit.recording.model import Recording

# Load [N], slip angle [rad], FY [N], MZ [N·m] of a load block; None or NaN where the file has none.
Block = tuple[float, float | None, float | None, float | None]


def inclinations(recording: Recording, blocks: Sequence[tuple[int, int]]) -> tuple[float, ...]:
    """Return the mean inclination angle [rad] of each block, by first row and stop; 0 without it."""
    if not recording.has("IA"):
        return (0.0,) * len(blocks)
    return tuple(float(np.mean(recording["IA"].si_of(slice(*block)))) for block in blocks)


def impossible(
    where: str, rows: Sequence[str], blocks: Sequence[Block], *, values: str, IA: Sequence[float]
) -> tuple[Finding, ...]:
    """Return what no tire can do among the load blocks of one file, as findings of level error.

    Only sizes are judged: one file does not say which way its axes point and its drum turned.

    Parameters
    ----------
    where : the file
    rows : name of each block in it
    blocks : their means
    values : what the values are, such as ``stored Fy and Mz``
    IA : their inclination angles (`inclinations`)
    """
    loaded = [
        (name, block, lean)
        for name, block, lean in zip(rows, blocks, IA, strict=True)
        if block[0] > 0 and block[2] is not None
    ]
    if not loaded:
        return ()
    table = np.array(
        [[math.nan if value is None else value for value in block] for _, block, _ in loaded],
        dtype=np.float64,
    )
    FZ, SA, FY, MZ = table.T
    broken = departures(
        of_sizes(
            [f"{where}, {name}" for name, _, _ in loaded],
            FZ=FZ,
            SA=SA,
            FY=FY,
            MZ=np.nan_to_num(MZ, nan=0.0),
            IA=np.array([lean for _, _, lean in loaded]),
        )
    )
    return tuple(departure.finding(level="error", of=values) for departure in broken)
