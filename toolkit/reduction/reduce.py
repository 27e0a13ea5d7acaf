"""Reduce a test: blocks to means, tare, calibration, axes, protocol, common load."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.calibration.records.record import CalibrationRecord
from toolkit.calibration.records.use import not_asked
from toolkit.calibration.uncertainty.common_errors import record_covariance
from toolkit.channels import Reversal, Rotation, seen_by_cells, signs
from toolkit.findings import Finding
from toolkit.machine import Machine, Protocol, TypeB
from toolkit.recording.model import Recording, TestInfo
from toolkit.reduction import protocol as plan
from toolkit.reduction import remarks
from toolkit.reduction.averaging import Window, means, turning
from toolkit.reduction.cells import physics_findings
from toolkit.reduction.common_load import at_one_angle, carry, slopes
from toolkit.reduction.corrections import choose_tares, correction_findings, few_rows_finding, zero_shifts
from toolkit.reduction.health import first_of_many, health_findings
from toolkit.reduction.hub import HubBlock, hub_findings, hub_means, load_findings, with_load
from toolkit.reduction.model import CalibrationUse, Condition, ReducedTest, Tare
from toolkit.reduction.prepare_rows import OpenedFile, check_record, open_file, split_rests
from toolkit.reduction.remarks import drift_findings
from toolkit.reduction.selection import CONDITIONS, Selection, of_one_condition, parted
from toolkit.reduction.strays import copied_findings, stray_findings
from toolkit.version import __version__

# Blocks at a load that the protocol does not know are one load while they lie within this part of each other.
_SAME_LOAD = 0.10
_RESOLVED = 0.008  # of a load: smaller gaps between loads are all alike


def reduce_test(
    *,
    info: TestInfo,
    machine: Machine,
    record: CalibrationRecord,
    recordings: Sequence[tuple[str, Recording, Rotation]],
    tare: Tare | None = None,
    use: CalibrationUse | None = None,
) -> ReducedTest:
    """Reduce the recordings of one test.

    Parameters
    ----------
    info, machine : what the test and the machine say of themselves; ``machine.protocol`` is the test's
    record : the calibration record that applies
    recordings : each file by its path inside the test, with its direction of rotation; in that order
    tare : the declared tare; without it, a tare block in a file serves that file
    use : how the record stands for the test (`Standing.use`); without it the result is a draft

    Raises
    ------
    RecordingError
        a file has no load block
    RecordError
        the record does not take the machine's indications in their units, or lacks FY or MZ
    """
    check_record(record, machine)
    own_load = all(recording.has("FZ") for _, recording, _ in recordings)
    loaded = _loaded(recordings, [tare] * len(recordings), machine=machine, record=record)
    blocks = [split_rests(recording, machine, info) for _, recording, _ in loaded]
    tares = choose_tares(
        [(recording, *parts) for (_, recording, _), parts in zip(loaded, blocks, strict=True)],
        declared=tare,
        machine=machine,
        record=record,
    )
    if not own_load:  # by the hub's cells, whose zeros are known now
        loaded = _loaded(recordings, tares, machine=machine, record=record)
        blocks = [split_rests(recording, machine, info) for _, recording, _ in loaded]
    files = [
        open_file(
            name, recording, rotation, blocks=loads, tare=tare, info=info, machine=machine, record=record
        )
        for (name, recording, rotation), (loads, _), tare in zip(loaded, blocks, tares, strict=True)
    ]
    selection = _selection(files)
    measured, placed, later = _conditions(
        files, machine=machine, record=record, reversal=info.reversal, used=selection.rows
    )
    conditions = _ordered(_at_common_load(_own_loads(measured)), machine)
    protocol = machine.protocol
    findings = [
        *physics_findings(
            conditions,
            record=record,
            machine=machine,
            info=info,
            tares={file.name: file.tare for file in files},
            inclinations={
                (file.name, window.rows.start + 1): float(np.mean(file.recording["IA"].si_of(window.rows)))
                for file in files
                if file.recording.has("IA")
                for window in file.windows
            },
        ),
        *channel_findings(files, machine=machine, record=record),
        *stray_findings(conditions),
        *first_of_many(copied_findings([(file.name, file.recording) for file in files])),
        *plan.check(placed, later, protocol, protocol.rotations or machine.rotations),
        *drift_findings(conditions, protocol),
        *correction_findings(machine),
        *load_findings([recording for _, recording, _ in recordings], record),
        *hub_findings(machine),
        *remarks.machine_findings(info, machine),
        *remarks.pressure_findings(info, machine),
        *remarks.speed_findings(files, machine),
        *remarks.swept_findings(files, machine),
        *remarks.condition_findings(files),
        *remarks.selection_findings(files, selection),
        *remarks.tare_findings(files, record),
        *few_rows_finding(files[0].tare),
        *remarks.angle_findings(files),
        *remarks.window_findings(files),
        *remarks.acquired_findings(files, record),
        *remarks.record_findings(record),
        *remarks.range_findings(conditions, record),
    ]
    return ReducedTest(
        info=info,
        calibration=use or not_asked(record),
        conditions=conditions,
        tare=files[0].tare,
        averaging=remarks.averaging_text(files, machine),
        findings=tuple(findings),
        code_version=__version__,
        protocol=protocol.source,
        machine_title=machine.title,
        stated=_stated(machine, info, files[0].tare),
    )


def channel_findings(
    files: Sequence[OpenedFile], *, machine: Machine, record: CalibrationRecord
) -> list[Finding]:
    """Return what the channels of the files show in the rows that are reduced."""
    counted = machine.protocol.acquisition == "continuous"
    return first_of_many(
        [
            finding
            for file in files
            for finding in health_findings(
                file.recording, file.name, stretches=[block.rows for block in file.blocks],
                read=record.indications, counted=counted,
            )
        ]
    )  # fmt: skip


def _loaded(
    recordings: Sequence[tuple[str, Recording, Rotation]],
    tares: Sequence[Tare | None],
    *,
    machine: Machine,
    record: CalibrationRecord,
) -> list[tuple[str, Recording, Rotation]]:
    """Return the recordings, each with a load: its own column, or the hub's by the record and its tare."""
    offsets = [None if tare is None or tare.source == "none" else dict(tare.values) for tare in tares]
    return [
        (name, with_load(recording, machine=machine, record=record, tare=offset), rotation)
        for (name, recording, rotation), offset in zip(recordings, offsets, strict=True)
    ]


def _stated(machine: Machine, info: TestInfo, tare: Tare) -> tuple[TypeB, ...]:
    """Return what the machine states and the test uses: a zero without a tare, a pressure it declares."""
    idle = set()
    if tare.source != "none":
        idle.add("zero")
    if info.pressure_Pa is None:
        idle.add("P")
    return tuple(
        source for source in machine.type_b if source.symbol not in idle and (source.u or source.relative)
    )


def _conditions(
    files: Sequence[OpenedFile],
    *,
    machine: Machine,
    record: CalibrationRecord,
    reversal: Reversal,
    used: NDArray[np.bool_],
) -> tuple[list[Condition], list[plan.Placed], tuple[int, ...]]:
    # What is placed in the protocol are the blocks of one condition.
    conditions: list[Condition] = []
    blocks: list[tuple[int, OpenedFile, float]] = []
    covariance = record_covariance(record) if machine.hub is not None else {}
    for order, file in enumerate(files):
        step = plan.nearest_step(float(np.mean(file.channels[0])), machine.protocol)
        for block, rows in zip(file.blocks, file.windows, strict=True):
            if machine.protocol.acquisition == "continuous":
                step = plan.nearest_step(float(np.mean(file.channels[0][rows.rows])), machine.protocol)
            condition = _condition(
                file,
                rows,
                step_SA=step,
                machine=machine,
                record=record,
                reversal=reversal,
                covariance=covariance,
            )
            conditions.append(condition)
            blocks.append((order, file, block.mean_FZ))
    conditions = _one_step_a_load(conditions, machine.protocol)
    used_blocks = np.flatnonzero(used).tolist()
    # A protocol, and what departs from it, is told in the slip angles that the machine shows.
    sense = machine.SA_to_SAE
    placed = [
        plan.Placed(
            file=file.name,
            file_order=order,
            rotation=file.rotation,
            SA=sense * condition.SA,
            FZ=mean_FZ,
            step_SA=None if condition.step_SA is None else sense * condition.step_SA,
            step_FZ=condition.step_FZ,
        )
        for condition, (order, file, mean_FZ) in ((conditions[index], blocks[index]) for index in used_blocks)
    ]
    later = plan.doubled(placed, machine.protocol)
    for index in {*np.flatnonzero(~used).tolist(), *(used_blocks[place] for place in later)}:
        conditions[index] = dataclasses.replace(conditions[index], used=False)
    return conditions, placed, later


def _one_step_a_load(conditions: Sequence[Condition], protocol: Protocol) -> list[Condition]:
    """Give the blocks of one load one nominal load of the protocol, or none.

    A load that lies where the reach of a nominal one ends would be parted by its own scatter. Two blocks of
    one file are two loads, however near.
    """
    stepped = list(conditions)
    FZ = np.array([condition.FZ for condition in conditions])
    for rows in parted(FZ, gap=_SAME_LOAD, resolved=_RESOLVED, relative=True):
        group = [stepped[index] for index in rows]
        low, high = FZ[rows].min(), FZ[rows].max()
        if len({condition.step_FZ for condition in group}) < 2 or high - low > _SAME_LOAD * high:
            continue
        if len({(condition.file, condition.step_SA) for condition in group}) == len(group):
            step = plan.nearest_load(float(np.median(FZ[rows])), protocol)
            for index in rows:
                stepped[index] = dataclasses.replace(stepped[index], step_FZ=step)
    return stepped


def _selection(files: Sequence[OpenedFile]) -> Selection:
    """Return which load blocks are of one condition, by the means of what every file recorded of it.

    A speed counts by its size: the direction of a run is declared.
    """
    recorded = {
        symbol: np.array([
            np.mean(file.recording[symbol].si_of(window.rows)) for file in files for window in file.windows
        ])
        for symbol in CONDITIONS
        if all(file.recording.has(symbol) for file in files)
    }  # fmt: skip
    if "V" in recorded:
        recorded["V"] = np.abs(recorded["V"])
    return of_one_condition(recorded, (), rows=sum(len(file.windows) for file in files))


def _condition(
    file: OpenedFile,
    window: Window,
    *,
    step_SA: float | None,
    machine: Machine,
    record: CalibrationRecord,
    reversal: Reversal,
    covariance: Mapping[str, Array],
) -> Condition:
    recording, rows = file.recording, window.rows
    seen_rotation = seen_by_cells(file.rotation, reversal)
    sign = signs(machine.axes, "SAE", seen_rotation)
    load = file.channels[1, rows]
    SA, FZ = means(file.channels[:2, rows])
    # FY and MZ follow the load at which their means are stated, and the tire's own turn has no mean.
    turns = _revolutions(window, machine)
    explained = np.vstack([load / max(abs(FZ.value), 1e-300), turning(len(load), turns)])
    FY, MZ = means(file.channels[2:, rows], explained=explained)
    zero = {"FY": 0.0, "MZ": 0.0}
    cells = file.indications[:, rows].mean(axis=1)
    if file.tare.u:
        shifts = zero_shifts(record, cells[:, None], [u for _, u in file.tare.u])
        zero = {channel: float(np.linalg.norm(shifts[channel])) for channel in zero}
    return Condition(
        file=file.name,
        file_sha256=recording.sha256,
        rotation=file.rotation,
        first_row=rows.start + 1,
        last_row=rows.stop,
        step_SA=None if step_SA is None else sign["SA"] * step_SA + 0.0,
        step_FZ=plan.nearest_load(FZ.value, machine.protocol),
        SA=sign["SA"] * SA.value,
        FZ=FZ.value,
        FY=sign["FY"] * FY.value,
        MZ=sign["MZ"] * MZ.value,
        sd_SA=SA.sd,
        sd_FZ=FZ.sd,
        u_FY=FY.u,
        u_MZ=MZ.u,
        indications=tuple(cells.tolist()),
        FY_file=_acquired(recording, "FY", rows, sign["FY"]),
        MZ_file=_acquired(recording, "MZ", rows, sign["MZ"]),
        FZ_common=FZ.value,
        FY_common=sign["FY"] * FY.value,
        MZ_common=sign["MZ"] * MZ.value,
        u_FY_common=FY.u,
        u_MZ_common=MZ.u,
        u_FY_zero=zero["FY"],
        u_MZ_zero=zero["MZ"],
        used=True,
        calibration_sha256=record.sha256,
        hub=hub_means(
            HubBlock(
                loads={name: values[rows] for name, values in file.hub.items()},
                cells=cells,
                u_zero=tuple(u for _, u in file.tare.u),
                tared=file.tare.source != "none",
                explained=explained,
            ),
            machine=machine,
            record=record,
            covariance=covariance,
            seen=seen_rotation,
        ),
    )


def _revolutions(window: Window, machine: Machine) -> float | None:
    """Return the tire's revolutions that a window spans; None where they are not known to be the tire's."""
    protocol = machine.protocol
    if protocol.revolutions_of != "tire" or window.short:
        return None
    if window.revolutions is None:
        return protocol.average_revolutions if protocol.acquisition == "after_settling" else None
    return window.revolutions


def _acquired(recording: Recording, symbol: str, rows: slice, sign: int) -> float | None:
    return sign * float(np.mean(recording[symbol].si_of(rows))) if recording.has(symbol) else None


def _own_loads(conditions: Sequence[Condition]) -> list[Condition]:
    """Give blocks at loads that the protocol does not know the nominal load of their own group.

    Groups are runs of the sorted loads; a new one begins at a gap, and where a file comes again: two
    blocks of one file are two loads, however near.
    """
    own_loads = list(conditions)
    groups: list[list[int]] = []
    for index in sorted(range(len(own_loads)), key=lambda i: own_loads[i].FZ):
        condition = own_loads[index]
        if condition.step_FZ is not None or not condition.used:
            continue
        last = groups[-1] if groups else []
        near = bool(last) and condition.FZ - own_loads[last[-1]].FZ <= _SAME_LOAD * condition.FZ
        if near and all(
            (own_loads[place].file, own_loads[place].step_SA) != (condition.file, condition.step_SA)
            for place in last
        ):
            last.append(index)
        else:
            groups.append([index])
    for group in groups:
        nominal = float(np.median([own_loads[index].FZ for index in group]))
        for index in group:
            own_loads[index] = dataclasses.replace(own_loads[index], step_FZ=nominal)
    return own_loads


def _at_common_load(conditions: Sequence[Condition]) -> list[Condition]:
    """Carry every used condition to the median load of its nominal load, both directions together."""
    common = {
        step: float(np.median([c.FZ for c in conditions if c.used and c.step_FZ == step]))
        for step in {c.step_FZ for c in conditions if c.used}
        if step is not None
    }
    at_load = list(conditions)
    used_rows = [index for index, c in enumerate(conditions) if c.used]
    for group in at_one_angle([conditions[index] for index in used_rows]):
        mine = [used_rows[place] for place in group]
        FZ = np.array([conditions[i].FZ for i in mine])
        for_FY = slopes(FZ, np.array([conditions[i].FY for i in mine]))
        for_MZ = slopes(FZ, np.array([conditions[i].MZ for i in mine]))
        for place, index in enumerate(mine):
            condition = conditions[index]
            if condition.step_FZ is None:
                continue
            delta = common[condition.step_FZ] - condition.FZ
            FY, u_FY = carry(condition.FY, condition.u_FY, slope=for_FY[place], delta_FZ=delta)
            MZ, u_MZ = carry(condition.MZ, condition.u_MZ, slope=for_MZ[place], delta_FZ=delta)
            moved = for_FY[place] is not None
            at_load[index] = dataclasses.replace(
                condition,
                FZ_common=common[condition.step_FZ] if moved else condition.FZ,
                FY_common=FY,
                MZ_common=MZ,
                u_FY_common=u_FY,
                u_MZ_common=u_MZ,
            )
    return at_load


def _ordered(conditions: Sequence[Condition], machine: Machine) -> tuple[Condition, ...]:
    steps = {machine.SA_to_SAE * step: place for place, step in enumerate(machine.protocol.slip_angles_rad)}

    def key(c: Condition) -> tuple[bool, bool, int, float, str]:
        place = len(steps) if c.step_SA is None else steps[c.step_SA]
        return (not c.used, c.rotation == "reverse", place, c.FZ, c.file)

    return tuple(sorted(conditions, key=key))
