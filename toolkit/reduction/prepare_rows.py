"""Open a recording: blocks, tare, corrected rows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.apply import apply_record
from toolkit.calibration.records.record import CalibrationRecord
from toolkit.channels import Rotation
from toolkit.errors import RecordError, RecordingError
from toolkit.machine import Machine
from toolkit.recording.digits import rounding
from toolkit.recording.model import Recording, TestInfo
from toolkit.reduction.averaging import ROLLING_RATIO, Window, free_radius_m, revolutions, window
from toolkit.reduction.blocks import Block, find_blocks, find_rests, is_tare
from toolkit.reduction.corrections import corrected
from toolkit.reduction.hub import check_hub
from toolkit.reduction.model import Tare
from toolkit.units import from_si, si_scale

# Compare the acquisition program's own FY and MZ with ours, row by row.


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """Largest |acquired - ours| of one channel of one file [SI], and whether rounding explains it."""

    file: str
    channel: str
    largest: float
    explained: bool


def compare(
    recording: Recording,
    record: CalibrationRecord,
    *,
    file: str,
    indications: Mapping[str, Array],
    units: Mapping[str, str],
    tare: Mapping[str, float] | None,
) -> tuple[Difference, ...]:
    """Return one `Difference` for each acquired channel that the record also computes.

    The program may use the full or the issued coefficients and may or may not have tared: the nearest of
    these readings counts. The bound propagates the printed digits of every value of the row.
    """
    channels = [s for s in recording.series if s.role == "acquired" and _computes(record, s.symbol)]
    if not channels:
        return ()
    symbols = [channel.symbol for channel in channels]

    def reading(offset: Mapping[str, float] | None, *, issued: bool) -> Mapping[str, Array]:
        return apply_record(record, indications, units=units, tare=offset, issued=issued, only=symbols)

    readings = [
        reading(offset, issued=issued)
        for offset in ((None, tare) if tare else (None,))
        for issued in (False, True)
    ]
    halves = {name: rounding(recording[name]) for name in indications}
    differences = []
    for channel in channels:
        bound = _moved(record, channel.symbol, indications, units, halves, plain=readings[0][channel.symbol])
        bound = bound + rounding(channel) * si_scale(channel.unit) + 1e-9 * np.abs(channel.si)
        misses = [np.abs(reading[channel.symbol] - channel.si) for reading in readings]
        differences.append(
            Difference(
                file=file,
                channel=channel.symbol,
                largest=float(np.max(misses[0])),
                explained=any(bool(np.all(miss <= bound)) for miss in misses),
            )
        )
    return tuple(differences)


def _moved(
    record: CalibrationRecord,
    load: str,
    indications: Mapping[str, Array],
    units: Mapping[str, str],
    halves: Mapping[str, Array],
    *,
    plain: Array,
) -> Array:
    """Return how far half a printed digit of every indication may move a load [SI], summed."""
    fit = record.load(load)
    coefficients = dict(zip(fit.terms, fit.coefficients, strict=True))
    if coefficients.keys() <= {*indications, "intercept"}:
        total = np.zeros_like(plain)
        for name, half in halves.items():
            total += abs(coefficients.get(name, 0.0)) * half
        return total * si_scale(fit.unit)
    moved = [
        apply_record(record, {**indications, name: indications[name] + half}, units=units, only=(load,))
        for name, half in halves.items()
    ]
    return np.asarray(np.sum([np.abs(values[load] - plain) for values in moved], axis=0))


def _computes(record: CalibrationRecord, symbol: str) -> bool:
    return any(fit.load == symbol for fit in record.loads)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OpenedFile:
    """One recording on its way to conditions.

    ``name`` is its path inside the test's folder, which tells it from every other file; ``channels``
    (4, rows) SI: SA, FZ, and FY and MZ by the record, in machine axes with the machine's corrections;
    ``indications`` minus tare, in the record's order and units; ``blocks`` its load blocks and ``windows``
    the rows of each that are averaged; ``differences`` what the acquisition program computed otherwise;
    ``hub`` the loads of the hub by the record, SI and machine axes, FY among them, each (rows,).
    """

    name: str
    recording: Recording
    rotation: Rotation
    indications: Array
    channels: Array
    blocks: tuple[Block, ...]
    windows: tuple[Window, ...]
    differences: tuple[Difference, ...]
    tare: Tare
    hub: Mapping[str, Array]


def check_record(record: CalibrationRecord, machine: Machine) -> None:
    """Refuse a record that does not take the machine's indications or does not give FY and MZ."""
    units = {column.symbol: column.unit for column in machine.indications}
    for name, unit in zip(record.indications, record.indication_units, strict=True):
        if units.get(name) != unit:
            raise RecordError(
                "the calibration record does not fit the machine",
                where=f"record {record.id}, indication {name}",
                got=f"{name} in {unit}",
                expected=", ".join(f"{symbol} in {text}" for symbol, text in units.items()),
                next_step="use a record of this machine (toolkit calibration list)",
                rule="record-units",
            )
    for needed in ("FY", "MZ"):
        if all(fit.load != needed for fit in record.loads):
            raise RecordError(
                f"the calibration record has no {needed}",
                where=f"record {record.id}",
                got=", ".join(fit.load for fit in record.loads),
                expected="FY and MZ",
                next_step="use a record that was fitted to FY and MZ",
                rule="record-loads",
            )
    check_hub(record, machine)


_NEGATIVE = (
    "check the load channel and its zero; a machine whose vertical force is negative has axes = 'SAE' in its "
    "definition"
)


def split_blocks(recording: Recording, machine: Machine) -> tuple[tuple[Block, ...], tuple[Block, ...]]:
    """Return the load blocks and the tare blocks of a recording.

    Raises
    ------
    RecordingError
        the file has no load block, or its load is negative
    """
    smallest = min(machine.protocol.loads_N)
    FZ = recording["FZ"].si
    blocks = find_blocks(FZ)
    tare = tuple(block for block in blocks if is_tare(block, smallest_load=smallest))
    loads = tuple(block for block in blocks if not is_tare(block, smallest_load=smallest))
    if not loads or any(block.mean_FZ < 0 for block in loads):
        raise RecordingError(
            "the file has no load block" if not loads else "the load is negative",
            where=recording.path,
            got=f"FZ from {_lbf(np.min(FZ))} to {_lbf(np.max(FZ))} lbf",
            expected=f"loads such as {', '.join(_lbf(load) for load in machine.protocol.loads_N)} lbf",
            next_step=_NEGATIVE
            if loads
            else "declare a tare file with '[tare] file' in test.toml; else check the load channel",
            rule="no-load-block",
        )
    return loads, tare


def split_rests(
    recording: Recording, machine: Machine, info: TestInfo
) -> tuple[tuple[Block, ...], tuple[Block, ...]]:
    """Return the blocks at a load and the tare blocks of a recording, by the protocol's acquisition.

    A file that is recorded continuously holds the moves too, at any number of slip angles: its blocks are
    the rests between them. Where its revolutions cannot be counted, and in the machine's own files, a block
    is what lies between two jumps of the load.

    Raises
    ------
    RecordingError
        the file has no load block, its load is negative, or nothing in it rests long enough
    """
    protocol = machine.protocol
    block = Block(start=0, stop=recording["FZ"].si.size, mean_FZ=0.0)
    turns = (
        revolutions(recording, block, machine=machine, rolling_radius_m=rolling_radius_m(info))
        if protocol.acquisition == "continuous"
        else None
    )
    if turns is None:
        return split_blocks(recording, machine)
    smallest = min(protocol.loads_N)
    rests = find_rests(
        SA=recording["SA"].si,
        FZ=recording["FZ"].si,
        turns=turns,
        band_SA=protocol.slip_angle_tolerance_rad,
        band_FZ=2 * protocol.load_tolerance,
        floor_FZ=protocol.load_tolerance * smallest,
        least_turns=protocol.average_revolutions,
    )
    tare = tuple(stretch for stretch in rests if is_tare(stretch, smallest_load=smallest))
    loads = tuple(stretch for stretch in rests if not is_tare(stretch, smallest_load=smallest))
    if not loads or any(load.mean_FZ < 0 for load in loads):
        low, high = from_si([np.min(recording["SA"].si), np.max(recording["SA"].si)], "deg")
        raise RecordingError(
            "the load is negative" if loads else "the recording does not rest at any slip angle and load",
            where=recording.path,
            got=f"{float(turns[-1]):.3g} {protocol.revolutions_of} revolutions, slip angle {low:.2f} to "
            f"{high:.2f} deg, FZ from {_lbf(recording['FZ'].si.min())} to "
            f"{_lbf(recording['FZ'].si.max())} lbf",
            expected=f"rests of {protocol.average_revolutions:g} {protocol.revolutions_of} revolutions or "
            f"more, in which the slip angle stays within "
            f"{float(from_si(protocol.slip_angle_tolerance_rad, 'deg')):g} deg and the load within "
            f"+-{protocol.load_tolerance:.0%}",
            next_step=_NEGATIVE
            if loads
            else "hold each condition longer, or give a protocol with wider tolerances or a shorter "
            "averaging; else check the load channel",
            rule="no-rest" if not loads else "no-load-block",
        )
    return loads, tare


def rolling_radius_m(info: TestInfo) -> float | None:
    """Return the effective rolling radius [m] by the tire's size, None where that is not known."""
    radius = free_radius_m(info.tire_size)
    return None if radius is None else ROLLING_RATIO * radius


def open_file(
    name: str,
    recording: Recording,
    rotation: Rotation,
    *,
    blocks: tuple[Block, ...],
    tare: Tare,
    info: TestInfo,
    machine: Machine,
    record: CalibrationRecord,
) -> OpenedFile:
    """Correct a recording's rows and choose those of each block that are averaged."""
    indications = {name: recording[name].values for name in record.indications}
    units = {name: recording[name].unit for name in record.indications}
    offsets = dict(tare.values) if tare.source != "none" else None
    hub = () if machine.hub is None else machine.hub.loads
    loads = apply_record(record, indications, units=units, tare=offsets, only=("FY", "MZ", *hub))
    channels = corrected(
        machine,
        {"SA": recording["SA"].si, "FZ": recording["FZ"].si, "FY": loads["FY"], "MZ": loads["MZ"]},
    )
    rolling = rolling_radius_m(info)
    return OpenedFile(
        name=name,
        recording=recording,
        rotation=rotation,
        indications=np.stack(
            [values - (offsets or {}).get(cell, 0.0) for cell, values in indications.items()]
        ),
        channels=np.stack([channels[name] for name in ("SA", "FZ", "FY", "MZ")]),
        blocks=blocks,
        windows=tuple(
            window(recording, block, machine=machine, rolling_radius_m=rolling) for block in blocks
        ),
        differences=compare(recording, record, file=name, indications=indications, units=units, tare=offsets),
        tare=tare,
        hub={"FY": channels["FY"]} | {load: loads[load] for load in hub},
    )


def _lbf(force_N: float) -> str:
    return f"{float(from_si(force_N, 'lbf')):.4g}"
