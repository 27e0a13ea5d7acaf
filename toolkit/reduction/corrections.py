"""What is taken off the rows of a recording before they are averaged: tare and the machine's corrections.

The tare is what the unloaded machine indicates. What an effect of the catalogue adds is taken away again, in
the machine's axes: the loads first, then the slip angle, which the corrected moment may turn.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.apply import apply_record
from toolkit.calibration.records.record import CalibrationRecord
from toolkit.effects import forward
from toolkit.findings import Finding
from toolkit.machine import Machine
from toolkit.recording.model import Recording
from toolkit.reduction.averaging import means
from toolkit.reduction.blocks import Block
from toolkit.reduction.health import tare_under_load
from toolkit.reduction.model import Tare

ENOUGH_ROWS = 20
"""Rows of a tare that tell its scatter: of fewer, twice the standard deviation is too short."""
_FEWEST_ROWS = 8  # of a load block that tells a scatter


def corrected(machine: Machine, channels: Mapping[str, Array]) -> dict[str, Array]:
    """Return SA, FZ, FY and MZ, each (n,), SI and machine axes, with every correction of the machine."""
    return forward.corrected([correction.in_SI for correction in machine.corrections], channels)


def u_SA(machine: Machine, MZ: Array) -> float:
    """Return the standard uncertainty [rad] that corrections leave in the slip angle.

    Where it goes with the moment, that at the largest moment (n,) [N·m] of the test: an upper bound for the
    other rows.
    """
    parts = [0.0]
    largest = float(np.max(np.abs(MZ))) if len(MZ) else 0.0
    for correction in machine.corrections:
        correctable = correction.applied.effect.correctable
        if correctable is not None and correctable.u_slip is not None:
            parts.append(correctable.u_slip(correction.u * correction.factor, largest))
    return math.hypot(*parts)


def correction_findings(machine: Machine) -> list[Finding]:
    """Name every correction that the rows have had; nothing for a machine without any."""
    return [
        Finding(
            rule="machine-corrected",
            where=f"{machine.name}, version {machine.version}",
            message=correction.as_text(),
            level="note",
        )
        for correction in machine.corrections
    ]


def tare_of_file(recording: Recording, machine: Machine) -> Tare:
    """Return the tare from a recording that holds nothing else: the mean of every row.

    Raises
    ------
    RecordingError
        ``tare-under-load``: a part of it is under load
    """
    if (error := tare_under_load(recording, machine)) is not None:
        raise error
    block = Block(start=0, stop=recording.rows, mean_FZ=0.0)
    return _tare([(recording, [block])], source=f"file {recording.name}")


def choose_tares(
    files: Sequence[tuple[Recording, Sequence[Block], Sequence[Block]]],
    *,
    declared: Tare | None,
    machine: Machine,
    record: CalibrationRecord,
) -> tuple[Tare, ...]:
    """Return the tare of every file of a test.

    Parameters
    ----------
    files : each recording with its load blocks and its tare blocks
    declared : the tare of ``test.toml``, which goes before every block

    Notes
    -----
    A block serves its own file only where every file has one. Otherwise the mean of the blocks serves all,
    so that one curve never holds tared and untared points.

    A tare of few rows, and one that is declared by its value, cannot tell how sure it is: the rows of the
    load blocks do (`_of_few_rows`).
    """
    if declared is not None:
        return (_of_few_rows(declared, files),) * len(files)
    having = [(recording, blocks) for recording, _, blocks in files if blocks]
    if not having:
        recordings = [recording for recording, _, _ in files]
        return (_open_zero(recordings, machine=machine, record=record),) * len(files)
    if len(having) == len(files):
        return tuple(_of_few_rows(_tare([block], source="block"), files) for block in having)
    shared = _tare(having, source=f"mean of the tare blocks in {len(having)} of {len(files)} files")
    return (_of_few_rows(shared, files),) * len(files)


def few_rows_finding(tare: Tare) -> list[Finding]:
    """Tell that the rows of the recordings say how sure a tare of few rows is."""
    if not tare.borrowed:
        return []
    rows = {0: "a tare that is declared by its value", 1: "a tare of one row"}.get(
        tare.rows, f"a tare of {tare.rows} rows"
    )
    message = (
        f"{rows} does not tell its own scatter: its uncertainty is that of as many rows of the load blocks; "
        f"{ENOUGH_ROWS} rows tell it"
    )
    return [Finding(rule="tare-rows", where=tare.source, message=message, level="note")]


def _tells(tare: Tare) -> bool:
    """Tell whether a tare says how sure it is: by enough rows, or by a u that is stated with its values."""
    return tare.rows >= ENOUGH_ROWS or (tare.rows == 0 and bool(tare.u))


def _of_few_rows(tare: Tare, files: Sequence[tuple[Recording, Sequence[Block], Sequence[Block]]]) -> Tare:
    """Return a tare whose uncertainty is at least that of as many rows of the load blocks.

    The rolling machine scatters more than the resting one, so that this is no less than the tare's own. A
    value without rows counts as one row.
    """
    if _tells(tare):
        return tare
    names = [name for name, _ in tare.values]
    tare_u = dict(tare.u)
    noises = []
    for recording, blocks, _ in files:
        for block in blocks:
            if block.n < _FEWEST_ROWS:
                continue
            values = np.stack([recording[name].values[block.rows] for name in names])
            explained = recording["FZ"].values[None, block.rows] if recording.has("FZ") else None
            noises.append(
                [(mean.u * np.sqrt(block.n), mean.sd) for mean in means(values, explained=explained)]
            )
    if not noises:
        return tare
    # A mean of n rows of a coloured noise: its long-run scatter over root n, never above that of one row.
    long_run, row = np.median(np.array(noises), axis=0).T
    u = np.minimum(long_run / np.sqrt(max(tare.rows, 1)), row)
    return dataclasses.replace(
        tare,
        borrowed=True,
        u=tuple((name, max(tare_u.get(name, 0.0), float(part))) for name, part in zip(names, u, strict=True)),
    )


def zero_shifts(record: CalibrationRecord, indications: Array, u: Sequence[float]) -> dict[str, Array]:
    """Return how far each cell's open zero moves each load [SI]: load -> (cells, rows).

    Parameters
    ----------
    indications : (cells, rows) untared, in the record's order and units
    u : (cells,) standard uncertainty of each cell's zero, in the same units
    """
    names = record.indications
    units = dict(zip(names, record.indication_units, strict=True))

    def loads(cell: int, sign: float) -> dict[str, Array]:
        moved = {name: indications[i] + sign * u[i] * (i == cell) for i, name in enumerate(names)}
        return apply_record(record, moved, units=units)

    pairs = [(loads(cell, 1.0), loads(cell, -1.0)) for cell in range(len(names))]
    return {
        fit.load: np.stack([(up[fit.load] - down[fit.load]) / 2 for up, down in pairs])
        for fit in record.loads
    }


def _tare(files: Sequence[tuple[Recording, Sequence[Block]]], *, source: str) -> Tare:
    """Return the mean of the tare rows and how sure it is.

    Of one file: from the scatter of its rows, their autocorrelation included. Of several files: from the
    scatter of the files' own tares, which a drift of the zero enters too, where that is the larger.
    """
    first = files[0][0]
    names = [channel.symbol for channel in first.series if channel.role == "indication"]
    rows = [
        np.stack([np.concatenate([recording[name].values[b.rows] for b in blocks]) for name in names])
        for recording, blocks in files
    ]
    every_row = np.concatenate(rows, axis=1)
    u = np.array([mean.u for mean in means(every_row)])
    if len(rows) > 1:
        block_means = np.array([row.mean(axis=1) for row in rows])
        u = np.maximum(u, block_means.std(axis=0, ddof=1) / np.sqrt(len(rows)))
    values = every_row.mean(axis=1)
    unit = next(channel.unit for channel in first.series if channel.role == "indication")
    return Tare(
        source=source,
        values=tuple(zip(names, values.tolist(), strict=True)),
        unit=unit,
        u=tuple(zip(names, u.tolist(), strict=True)) if every_row.shape[1] > 1 else (),
        rows=every_row.shape[1],
    )


def _open_zero(recordings: Sequence[Recording], *, machine: Machine, record: CalibrationRecord) -> Tare:
    """Return a missing tare: what the machine states of an untared zero, as a part of each cell's range."""
    relative = machine.stated_uncertainty("zero").relative
    u = []
    for cell in record.cells:
        ends = [abs(end) for end in (cell.minimum, cell.maximum) if end is not None]
        # A legacy record knows no range: the largest indication of the test stands for it.
        extent = max(ends) if ends else max(float(np.max(np.abs(r[cell.name].values))) for r in recordings)
        u.append((cell.name, relative * extent))
    return Tare(source="none", values=(), unit=record.indication_units[0], u=tuple(u))
