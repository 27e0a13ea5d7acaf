"""Tare: the indications of the unloaded machine, and what is open without one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.apply import apply_record
from toolkit.reduction.blocks import Block
from toolkit.reduction.model import Tare

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.machine import Machine
    from toolkit.recording.model import Recording


def tare_of_file(recording: Recording) -> Tare:
    """Return the tare from a recording that holds nothing else: the mean of every row."""
    whole = Block(start=0, stop=recording.rows, mean_FZ=0.0)
    return _tare(_means([(recording, [whole])]), recording, source=f"file {recording.name}")


def choose_tares(
    files: Sequence[tuple[Recording, Sequence[Block]]],
    *,
    declared: Tare | None,
    machine: Machine,
    record: CalibrationRecord,
) -> tuple[Tare, ...]:
    """Return the tare of every file of a test.

    Parameters
    ----------
    files : each recording with its tare blocks
    declared : the tare of ``test.toml``, which goes before every block

    Notes
    -----
    A block serves its own file only where every file has one. Otherwise the mean of the blocks serves all,
    so that one curve never holds tared and untared points.
    """
    if declared is not None:
        return (declared,) * len(files)
    having = [(recording, blocks) for recording, blocks in files if blocks]
    if not having:
        return (_open_zero([recording for recording, _ in files], machine=machine, record=record),) * len(
            files
        )
    if len(having) == len(files):
        return tuple(_tare(_means([one]), one[0], source="block") for one in having)
    shared = _tare(
        _means(having), having[0][0], source=f"mean of the tare blocks in {len(having)} of {len(files)} files"
    )
    return (shared,) * len(files)


def zero_shifts(
    record: CalibrationRecord, indications: NDArray[np.float64], u: Sequence[float]
) -> dict[str, NDArray[np.float64]]:
    """Return how far each cell's open zero moves each load [SI]: load -> (cells, rows).

    Parameters
    ----------
    indications : (cells, rows) untared, in the record's order and units
    u : (cells,) standard uncertainty of each cell's zero, in the same units
    """
    names = record.indications
    units = dict(zip(names, record.indication_units, strict=True))

    def loads(cell: int, sign: float) -> dict[str, NDArray[np.float64]]:
        moved = {name: indications[i] + sign * u[i] * (i == cell) for i, name in enumerate(names)}
        return apply_record(record, moved, units=units)

    pairs = [(loads(cell, 1.0), loads(cell, -1.0)) for cell in range(len(names))]
    return {
        fit.load: np.stack([(up[fit.load] - down[fit.load]) / 2 for up, down in pairs])
        for fit in record.loads
    }


def _means(files: Sequence[tuple[Recording, Sequence[Block]]]) -> dict[str, float]:
    rows = {
        one.symbol: np.concatenate([
            recording[one.symbol].values[block.rows] for recording, blocks in files for block in blocks
        ])
        for one in files[0][0].series
        if one.role == "indication"
    }  # fmt: skip
    return {name: float(np.mean(values)) for name, values in rows.items()}


def _tare(values: dict[str, float], recording: Recording, *, source: str) -> Tare:
    unit = next(one.unit for one in recording.series if one.role == "indication")
    return Tare(source=source, values=tuple(values.items()), unit=unit)


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
