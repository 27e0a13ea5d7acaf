"""Reduce a test: blocks to means, tare, calibration, axes, protocol, common load."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit import __version__
from toolkit.calibration.apply import apply_record
from toolkit.channels import Rotation, signs
from toolkit.errors import RecordError, RecordingError
from toolkit.findings import Finding
from toolkit.reduction import protocol as plan
from toolkit.reduction.acquired import Difference, compare
from toolkit.reduction.averaging import ROLLING_RATIO, Window, free_radius_m, mean, window
from toolkit.reduction.blocks import Block, find_blocks, is_tare
from toolkit.reduction.common_load import carry, slopes
from toolkit.reduction.model import CalibrationUse, Condition, ReducedTest, Tare
from toolkit.units import from_si

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.calibration.record import CalibrationRecord
    from toolkit.machine import Machine
    from toolkit.recording.model import Recording, TestInfo


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _File:
    # One recording on its way: corrected rows, its blocks, the rows of each that are averaged.
    recording: Recording
    rotation: Rotation
    indications: tuple[NDArray[np.float64], ...]
    loads: Mapping[str, NDArray[np.float64]]
    blocks: tuple[Block, ...]
    windows: tuple[Window, ...]
    differences: tuple[Difference, ...]
    tare: Tare


def reduce_test(
    *,
    info: TestInfo,
    machine: Machine,
    record: CalibrationRecord,
    recordings: Sequence[tuple[Recording, Rotation]],
    tare: Tare | None = None,
) -> ReducedTest:
    """Reduce the recordings of one test.

    Parameters
    ----------
    info, machine : what the test and the machine say of themselves
    record : the calibration record that applies
    recordings : each file with its direction of rotation, in the order of their names
    tare : the declared tare; without it, a tare block in a file serves that file

    Raises
    ------
    RecordingError
        a file has no load block
    RecordError
        the record does not take the machine's indications in their units, or lacks FY or MZ
    """
    _check_record(record, machine)
    files = [
        _open(recording, rotation, info=info, machine=machine, record=record, declared=tare)
        for recording, rotation in recordings
    ]
    conditions, placed, later = _conditions(files, machine=machine, record=record)
    findings = [
        *plan.check(placed, later, machine.protocol, machine.rotations),
        *_machine_findings(info, machine),
        *_tare_findings(files, record),
        *_window_findings(files),
        *_acquired_findings(files, record),
        *_record_findings(record),
    ]
    return ReducedTest(
        info=info,
        calibration=CalibrationUse(id=record.id, sha256=record.sha256, unverified=not record.verified),
        conditions=_ordered(_at_common_load(conditions), machine),
        tare=files[0].tare,
        averaging=_averaging_text(files, machine),
        findings=tuple(findings),
        code_version=__version__,
    )


def _check_record(record: CalibrationRecord, machine: Machine) -> None:
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


def _open(
    recording: Recording,
    rotation: Rotation,
    *,
    info: TestInfo,
    machine: Machine,
    record: CalibrationRecord,
    declared: Tare | None,
) -> _File:
    smallest = min(machine.protocol.loads_N)
    all_blocks = find_blocks(recording["FZ"].si)
    tare_blocks = [block for block in all_blocks if is_tare(block, smallest_load=smallest)]
    blocks = tuple(block for block in all_blocks if not is_tare(block, smallest_load=smallest))
    if not blocks or any(block.mean_FZ < 0 for block in blocks):
        raise RecordingError(
            "the file has no load block" if not blocks else "the load is negative",
            where=recording.path,
            got=f"FZ from {_lbf(np.min(recording['FZ'].si))} to {_lbf(np.max(recording['FZ'].si))} lbf",
            expected=f"loads such as {', '.join(_lbf(load) for load in machine.protocol.loads_N)} lbf",
            next_step="declare a tare file with '[tare] file' in test.toml; else check the load channel",
            rule="no-load-block",
        )
    indications = {name: recording[name].values for name in record.indications}
    units = {name: recording[name].unit for name in record.indications}
    tare = declared or _tare_of(recording, tare_blocks)
    offsets = dict(tare.values) if tare.source != "none" else None
    radius = free_radius_m(info.tire_size)
    windows = tuple(
        window(
            recording,
            block,
            machine=machine,
            rolling_radius_m=None if radius is None else ROLLING_RATIO * radius,
        )
        for block in blocks
    )
    return _File(
        recording=recording,
        rotation=rotation,
        indications=tuple(values - dict(tare.values).get(name, 0.0) for name, values in indications.items()),
        loads=apply_record(record, indications, units=units, tare=offsets),
        blocks=blocks,
        windows=windows,
        differences=compare(recording, record, indications=indications, units=units, tare=offsets),
        tare=tare,
    )


def _tare_of(recording: Recording, blocks: Sequence[Block]) -> Tare:
    indications = [one for one in recording.series if one.role == "indication"]
    unit = indications[0].unit
    if not blocks:
        return Tare(source="none", values=(), unit=unit)
    rows = np.concatenate([np.arange(block.start, block.stop) for block in blocks])
    values = tuple((one.symbol, float(np.mean(one.values[rows]))) for one in indications)
    return Tare(source="block", values=values, unit=unit)


def tare_of_file(recording: Recording) -> Tare:
    """Return the tare from a recording that holds nothing else: the mean of every row."""
    whole = Block(start=0, stop=recording.rows, mean_FZ=0.0)
    return dataclasses.replace(_tare_of(recording, [whole]), source=f"file {recording.name}")


def _conditions(
    files: Sequence[_File], *, machine: Machine, record: CalibrationRecord
) -> tuple[list[Condition], list[plan.Placed], tuple[int, ...]]:
    conditions: list[Condition] = []
    placed: list[plan.Placed] = []
    for order, file in enumerate(files):
        step = plan.nearest_step(float(np.mean(file.recording["SA"].si)), machine.protocol)
        for block, rows in zip(file.blocks, file.windows, strict=True):
            one = _condition(file, rows, step_SA=step, machine=machine, record=record)
            conditions.append(dataclasses.replace(one, step_FZ=plan.nearest_load(one.FZ, machine.protocol)))
            placed.append(
                plan.Placed(
                    file=file.recording.name,
                    file_order=order,
                    rotation=file.rotation,
                    SA=one.SA,
                    FZ=block.mean_FZ,
                    step_SA=step,
                    step_FZ=conditions[-1].step_FZ,
                )
            )
    later = plan.doubled(placed)
    for index in later:
        conditions[index] = dataclasses.replace(conditions[index], used=False)
    return conditions, placed, later


def _condition(
    file: _File, chosen: Window, *, step_SA: float | None, machine: Machine, record: CalibrationRecord
) -> Condition:
    recording, rows = file.recording, chosen.rows
    sign = signs(machine.axes, "SAE", file.rotation)
    SA, FZ = mean(recording["SA"].si[rows]), mean(recording["FZ"].si[rows])
    FY, MZ = mean(file.loads["FY"][rows]), mean(file.loads["MZ"][rows])
    return Condition(
        file=recording.name,
        file_sha256=recording.sha256,
        rotation=file.rotation,
        first_row=rows.start + 1,
        last_row=rows.stop,
        step_SA=step_SA,
        step_FZ=None,
        SA=sign["SA"] * SA.value,
        FZ=FZ.value,
        FY=sign["FY"] * FY.value,
        MZ=sign["MZ"] * MZ.value,
        sd_SA=SA.sd,
        sd_FZ=FZ.sd,
        u_FY=FY.u,
        u_MZ=MZ.u,
        indications=tuple(float(np.mean(values[rows])) for values in file.indications),
        FY_file=_acquired(recording, "FY", rows, sign["FY"]),
        MZ_file=_acquired(recording, "MZ", rows, sign["MZ"]),
        FZ_common=FZ.value,
        FY_common=sign["FY"] * FY.value,
        MZ_common=sign["MZ"] * MZ.value,
        u_FY_common=FY.u,
        u_MZ_common=MZ.u,
        used=True,
        calibration_sha256=record.sha256,
    )


def _acquired(recording: Recording, symbol: str, rows: slice, sign: int) -> float | None:
    return sign * float(np.mean(recording[symbol].si[rows])) if recording.has(symbol) else None


def _at_common_load(conditions: Sequence[Condition]) -> list[Condition]:
    """Carry every used condition to the median load of its nominal load, both directions together."""
    common = {
        step: float(np.median([c.FZ for c in conditions if c.used and c.step_FZ == step]))
        for step in {c.step_FZ for c in conditions if c.used}
        if step is not None
    }
    found = list(conditions)
    for file in dict.fromkeys(c.file for c in conditions):
        mine = [index for index, c in enumerate(conditions) if c.file == file and c.used]
        FZ = np.array([conditions[i].FZ for i in mine])
        for_FY = slopes(FZ, np.array([conditions[i].FY for i in mine]))
        for_MZ = slopes(FZ, np.array([conditions[i].MZ for i in mine]))
        for place, index in enumerate(mine):
            one = conditions[index]
            if one.step_FZ is None:
                continue
            delta = common[one.step_FZ] - one.FZ
            FY, u_FY = carry(one.FY, one.u_FY, slope=for_FY[place], delta_FZ=delta)
            MZ, u_MZ = carry(one.MZ, one.u_MZ, slope=for_MZ[place], delta_FZ=delta)
            moved = for_FY[place] is not None
            found[index] = dataclasses.replace(
                one,
                FZ_common=common[one.step_FZ] if moved else one.FZ,
                FY_common=FY,
                MZ_common=MZ,
                u_FY_common=u_FY,
                u_MZ_common=u_MZ,
            )
    return found


def _ordered(conditions: Sequence[Condition], machine: Machine) -> tuple[Condition, ...]:
    steps = {step: place for place, step in enumerate(machine.protocol.slip_angles_rad)}

    def key(c: Condition) -> tuple[bool, bool, int, float, str]:
        place = len(steps) if c.step_SA is None else steps[c.step_SA]
        return (not c.used, c.rotation == "reverse", place, c.FZ, c.file)

    return tuple(sorted(conditions, key=key))


def _machine_findings(info: TestInfo, machine: Machine) -> list[Finding]:
    if (
        info.speed_m_s is None
        or abs(info.speed_m_s - machine.drum.speed_m_s) <= machine.drum.speed_tolerance_m_s
    ):
        return []
    got, wanted, tolerance = from_si(
        [info.speed_m_s, machine.drum.speed_m_s, machine.drum.speed_tolerance_m_s], "km/h"
    )
    message = f"speed {got:.2f} km/h is outside {wanted:.2f} +- {tolerance:.0f} km/h"
    return [Finding(rule="speed", where="test.toml", message=message)]


def _tare_findings(files: Sequence[_File], record: CalibrationRecord) -> list[Finding]:
    bare = [file.recording.name for file in files if file.tare.source == "none"]
    if not bare:
        return []
    return [
        Finding(
            rule="no-tare",
            where=_some(bare),
            message="no tare was recorded or declared: the zero of the cells stays in FY and MZ"
            + ("" if record.zero == "included" else ", and the record was fitted on tared indications"),
        )
    ]


def _window_findings(files: Sequence[_File]) -> list[Finding]:
    short = [file.recording.name for file in files if any(w.short for w in file.windows)]
    if not short:
        return []
    message = "a block ends before settling and averaging are complete; its last revolution was averaged"
    return [Finding(rule="short-block", where=_some(short), message=message)]


def _acquired_findings(files: Sequence[_File], record: CalibrationRecord) -> list[Finding]:
    wrong = [d for file in files for d in file.differences if not d.explained]
    if not wrong:
        return []
    largest = {c: max((d.largest for d in wrong if d.channel == c), default=0.0) for c in ("FY", "MZ")}
    return [
        Finding(
            rule="acquired-differs",
            where=_some(list(dict.fromkeys(d.file for d in wrong))),
            message=f"FY and MZ in the file were not computed by {record.id}: they differ by up to "
            f"{largest['FY']:.1f} N and {largest['MZ']:.2f} N·m; the values here are recomputed from the "
            "cells (toolkit inspect tells which calibration wrote them)",
        )
    ]


def _record_findings(record: CalibrationRecord) -> list[Finding]:
    if record.verified:
        return []
    message = "the record is a legacy import without its reference data: nothing verifies its coefficients"
    return [Finding(rule="unverified", where=record.id, message=message)]


def _averaging_text(files: Sequence[_File], machine: Machine) -> str:
    turns = [w.revolutions for file in files for w in file.windows if w.revolutions is not None]
    settle, length = machine.protocol.settle_revolutions, machine.protocol.average_revolutions
    if not turns:
        return (
            f"whole blocks averaged, nothing discarded: the machine starts acquisition after {settle:g} tire "
            f"revolutions and records {length:g}; the files have no time or angle channel to count them"
        )
    return (
        f"the first {settle:g} tire revolutions of each block discarded, then averaged over "
        f"{min(turns):.2f} to {max(turns):.2f} revolutions"
    )


def _some(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{len(names)} files ({names[0]}, ...)"


def _lbf(force_N: float) -> str:
    return f"{float(from_si(force_N, 'lbf')):.4g}"
