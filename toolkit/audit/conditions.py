"""What the record in force would change, load block by load block: new minus old."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.reduction.protocol import nearest_load, nearest_step

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from toolkit.audit.model import Columns
    from toolkit.recording.model import Recording
    from toolkit.reduction.blocks import Block


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """One load block: its rows (from 1), its means as the file has them, and new minus old [N, N·m].

    In the machine's axes. ``SA_deg`` is None without that channel; ``FY_N`` and ``MZ_Nm`` without the
    file's own; the changes without a record in force. ``step_SA_deg`` and ``step_FZ_N`` are the nominal
    condition of the machine's protocol, None where it has none so near.
    """

    first_row: int
    last_row: int
    SA_deg: float | None
    FZ_N: float
    FY_N: float | None
    MZ_Nm: float | None
    FY_change_N: float | None
    MZ_change_Nm: float | None
    step_SA_deg: float | None
    step_FZ_N: float | None


def changes(
    recording: Recording,
    columns: Columns,
    blocks: Sequence[Block],
    new: Mapping[str, NDArray[np.float64]] | None,
    *,
    turn: int = 1,
) -> tuple[Change, ...]:
    """Return what the record in force would change in a recording's load blocks.

    ``new`` are FY [N] and MZ [N·m] by that record (`toolkit.audit.identify.recompute`), None without one.

    ``turn`` is the sign of the file's slip angle in SAE axes, in which the protocol's steps are.
    """
    if not blocks:
        return ()
    protocol = recording.machine.protocol
    rows: dict[str, NDArray[np.float64]] = {load: recording[load].si for load in columns.loads}
    if new is not None:
        rows |= {f"d{load}": new[load] - rows[load] for load in columns.loads}
    step = None
    if recording.has("SA"):
        rows["SA"] = recording["SA"].si
        step = nearest_step(turn * float(rows["SA"].mean()), protocol)
    stacked = np.stack(list(rows.values()))
    table = np.array([stacked[:, block.rows].mean(axis=1) for block in blocks])
    means = dict(zip(rows, table.T.tolist(), strict=True))
    nothing = [None] * len(blocks)
    return tuple(
        Change(
            first_row=block.start + 1,
            last_row=block.stop,
            SA_deg=None if SA is None else math.degrees(SA),
            FZ_N=block.mean_FZ,
            FY_N=FY,
            MZ_Nm=MZ,
            FY_change_N=dFY,
            MZ_change_Nm=dMZ,
            step_SA_deg=None if step is None else math.degrees(step),
            step_FZ_N=nearest_load(block.mean_FZ, protocol),
        )
        for block, SA, FY, MZ, dFY, dMZ in zip(
            blocks, *(means.get(name, nothing) for name in ("SA", "FY", "MZ", "dFY", "dMZ")), strict=True
        )
    )
