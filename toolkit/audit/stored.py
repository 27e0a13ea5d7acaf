"""What a file's Fy and Mz, its own or corrected ones, claim of the tire: judged by physics alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.reduction.physics import departures, of_sizes

if TYPE_CHECKING:
    from toolkit.findings import Finding

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
