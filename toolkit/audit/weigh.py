"""A recording's own evidence about both sides of a disagreement, and what its rows show of continuity.

Its Fy and Mz, its own or corrected ones, are judged by what they claim of the tire: by physics alone.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from toolkit.arrays import Array
from toolkit.audit.candidates import by_columns, cannot_correct, turned_against
from toolkit.audit.identify import recompute
from toolkit.audit.model import Columns, Identification, Segment
from toolkit.audit.sides import judge, sudden_step
from toolkit.calibration.records.record import CalibrationRecord
from toolkit.findings import Finding
from toolkit.recording.model import Recording
from toolkit.reduction.blocks import Block
from toolkit.reduction.physics import departures, of_sizes

# Load [N], slip angle [rad], FY [N], MZ [N·m] of a load block; None or NaN where the file has none.
BlockMeans = tuple[float, float | None, float | None, float | None]


def inclinations(recording: Recording, blocks: Sequence[tuple[int, int]]) -> tuple[float, ...]:
    """Return the mean inclination angle [rad] of each block, by first row and stop; 0 without it."""
    if not recording.has("IA"):
        return (0.0,) * len(blocks)
    return tuple(float(np.mean(recording["IA"].si_of(slice(*block)))) for block in blocks)


def impossible(
    where: str, rows: Sequence[str], blocks: Sequence[BlockMeans], *, values: str, IA: Sequence[float]
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


def weighed(
    identification: Identification,
    recording: Recording,
    columns: Columns,
    blocks: Sequence[Block],
    records: Sequence[CalibrationRecord],
    new: Mapping[str, Array] | None,
    in_force: CalibrationRecord | None,
) -> Identification:
    """Return an identification that says which side of a disagreement is wrong (`toolkit.audit.sides`).

    ``new`` are FY and MZ by the record in force, which stand for what no record explains, and beside those of
    a record that was not in force.
    """
    by_id = {record.id: record for record in records}
    explained = [by_id[s.record] for s in identification.segments if s.record in by_id]
    plain = by_id.get(identification.record or "") or (explained[0] if explained else None)
    computed = new
    if identification.grade != "stale" and plain is not None and cannot_correct(plain, columns) is None:
        computed = recompute(columns, plain)

    def could(segment: Segment) -> bool:
        if segment.grade == "stale":
            mine = by_id.get(segment.record or "")
            if mine is None or in_force is None:
                return False
            change = turned_against(mine, in_force, columns.loads)
        else:
            change = segment.variant
        return segment.grade == "unknown" or (change is not None and by_columns(change, columns.loads))

    recorded = {load: recording[load].si for load in columns.loads}
    return judge(
        identification,
        columns,
        blocks,
        conditions=conditions_of(recording),
        recorded=recorded,
        computed=computed,
        impossible=(
            _impossible(recording, blocks, recorded),
            computed is not None and _impossible(recording, blocks, computed),
        ),
        by_columns=could,
    )


def conditions_of(recording: Recording) -> dict[str, Array]:
    """Return the load and, where it is there, the slip angle of each row."""
    return {name: recording[name].si for name in ("FZ", "SA") if recording.has(name)}


def steps(recording: Recording, columns: Columns, blocks: Sequence[Block], where: str) -> tuple[Finding, ...]:
    """Return the forces or cells of a file that step where load and slip angle stand still."""
    values: dict[str, Array] = {load: recording[load].si for load in columns.loads}
    values |= {name: columns.x[:, place] for place, name in enumerate(columns.names)}
    return step_findings(recording, values, blocks, where)


def step_findings(
    recording: Recording, values: Mapping[str, Array], blocks: Sequence[Block], where: str
) -> tuple[Finding, ...]:
    """Return the value that steps most where load and slip angle stand still, as a finding; empty: none."""
    step = sudden_step(values, conditions_of(recording), blocks)
    if step is None:
        return ()
    name, row, before, after = step
    message = (
        f"{name} steps from {before:.5g} to {after:.5g} at row {row}, where load and slip angle stand still: "
        "it was changed from there on, or a cell failed"
    )
    return (Finding(rule="discontinuity", where=where, message=message, level="error"),)


def _impossible(recording: Recording, blocks: Sequence[Block], values: Mapping[str, Array]) -> bool:
    rows = [f"{block.start}" for block in blocks]
    SA = recording["SA"].si if recording.has("SA") else None

    def mean(series: Array | None, block: Block) -> float | None:
        return None if series is None else float(np.mean(series[block.rows]))

    FY, MZ = values.get("FY"), values.get("MZ")
    means = [(b.mean_FZ, mean(SA, b), mean(FY, b), mean(MZ, b)) for b in blocks]
    IA = inclinations(recording, [(block.start, block.stop) for block in blocks])
    return bool(impossible("", rows, means, values="", IA=IA))
