"""Loads of the hub beside FY and MZ: their signs in SAE J670, moments at the contact patch, uncertainty.

The hub's cells measure forces and moments about the spindle. With r = (0, 0, h) from the spindle down to the
contact patch (SAE J670, z down) the same forces have about the contact patch the moment

    M_C = M_H - r x F,    r x F = (-h FY, h FX, 0)

so that MX_C = MX_H + h FY and MY_C = MY_H - h FX. FY has the machine's corrections. A value's standard
uncertainty has four parts: the rows' scatter (of the carried moment as such), the record's coefficients with
what its session stated, the cells' zeros, and the arm's own.

Coefficients of two loads are taken as independent, as everywhere (`uncertainty.propagation`); the zero of a
cell moves all loads together, by its sign.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.apply import apply_record, coefficient_jacobian
from toolkit.calibration.records.record import CalibrationRecord
from toolkit.channels import Rotation, hub_signs, signs
from toolkit.errors import ColumnError, RecordError
from toolkit.findings import Finding
from toolkit.machine import Machine
from toolkit.recording.model import Recording, Series
from toolkit.reduction.averaging import means
from toolkit.reduction.corrections import zero_shifts
from toolkit.reduction.model import HubLoad
from toolkit.units import si_scale


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HubBlock:
    """The rows of one block: ``loads`` (rows,) SI and machine axes, FY among them; ``cells`` (cells,) tared.

    ``u_zero`` (cells,) is the standard uncertainty of each cell's zero, empty where it is known;
    ``explained`` (signals, rows) what the rows follow without its being an error of their mean.
    """

    loads: Mapping[str, Array]
    cells: Array
    u_zero: tuple[float, ...]
    tared: bool
    explained: Array


def check_hub(record: CalibrationRecord, machine: Machine) -> None:
    """Refuse a record without a load that the machine's hub measures.

    Raises
    ------
    RecordError
        ``record-loads``
    """
    fitted = [fit.load for fit in record.loads]
    missing = [load for load in (machine.hub.loads if machine.hub else ()) if load not in fitted]
    if missing:
        raise RecordError(
            f"the calibration record has no {' and no '.join(missing)}",
            where=f"record {record.id}",
            got=", ".join(fitted),
            expected=f"the loads of [hub] in the machine's definition: {', '.join(missing)} too",
            next_step="use a record that was fitted to them, or take them out of [hub]",
            rule="record-loads",
        )


def hub_means(
    block: HubBlock,
    *,
    machine: Machine,
    record: CalibrationRecord,
    covariance: Mapping[str, Array],
    seen: Rotation,
) -> tuple[HubLoad, ...]:
    """Return the mean of each load of the hub over a block, in SAE J670 axes that follow the travel.

    ``covariance`` of the record's coefficients by load (`record_covariance`); ``seen`` is the direction of
    the run as the cells see it. Empty where the machine has no [hub].
    """
    if machine.hub is None:
        return ()
    turn = hub_signs(machine.axes, seen) | {"FY": signs(machine.axes, "SAE", seen)["FY"]}
    zero = zero_shifts(record, block.cells[:, None], block.u_zero) if block.u_zero else {}
    hub_loads = []
    for load in machine.hub.loads:
        parts: dict[str, float] = {load: float(turn[load])}
        arm = machine.hub.arm_m
        source = _CARRIED.get(load)
        if arm is not None and source is not None:
            parts[source[0]] = source[1] * arm * turn[source[0]]
        rows = np.sum([factor * block.loads[name] for name, factor in parts.items()], axis=0)
        (mean,) = means(rows[None, :], explained=block.explained)
        variances = [mean.u**2]
        variances += [
            (factor * _u_fit(block, record, name, covariance)) ** 2 for name, factor in parts.items()
        ]
        if zero:
            moved = np.sum([factor * zero[name] for name, factor in parts.items()], axis=0)
            variances.append(float(np.sum(moved**2)))
        if len(parts) > 1 and source is not None:
            variances.append((machine.hub.u_arm_m * float(np.mean(block.loads[source[0]]))) ** 2)
        hub_loads.append(HubLoad(load=load, value=mean.value, u=math.sqrt(sum(variances))))
    return tuple(hub_loads)


def with_load(
    recording: Recording,
    *,
    machine: Machine,
    record: CalibrationRecord | None,
    tare: Mapping[str, float] | None = None,
) -> Recording:
    """Return a recording whose load is the hub's FZ by the record, where it has no column of the load.

    Raises
    ------
    ColumnError
        ``missing-column``: there is no record to compute it by
    """
    if recording.has("FZ") or machine.hub is None or "FZ" not in machine.hub.loads:
        return recording
    if record is None:
        raise ColumnError(
            "the load is that of the hub's cells, and no record computes it", where=recording.path,
            got="no column FZ, and no calibration record in force",
            expected="a record of the hub, or a column of the load",
            next_step="name the laboratory's home with --home, or approve a record",
            rule="missing-column",
        )  # fmt: skip
    indications = {name: recording[name].values for name in record.indications}
    units = {name: recording[name].unit for name in record.indications}
    values = apply_record(record, indications, units=units, tare=tare, only=("FZ",))["FZ"]
    load = Series(symbol="FZ", header="FZ by the record", unit="N", role="load", values=values)
    return dataclasses.replace(recording, series=(*recording.series, load))


def load_findings(recordings: Sequence[Recording], record: CalibrationRecord) -> list[Finding]:
    """Say that the load is the hub's, where no file has a column of it."""
    if any(recording.has("FZ") for recording in recordings):
        return []
    message = (
        f"no file has a column of the load: it is the hub's FZ by {record.id}; what [type_b] states of FZ "
        "enters uncertainties, U of the hub's FZ stands beside it"
    )
    return [Finding(rule="hub-load", where=recordings[0].machine.name, message=message, level="note")]


def hub_findings(machine: Machine) -> list[Finding]:
    """Say where the hub's moments stand; nothing where it measures none."""
    hub = machine.hub
    moments = [load for load in hub.loads if load.startswith("M")] if hub is not None else []
    if hub is None or not moments:
        return []
    names = " and ".join(moments)
    message = f"{names} about the spindle, as no arm is stated"
    if hub.arm_m is not None:
        message = (
            f"{names} about the contact patch, carried there by an arm of {1000 * hub.arm_m:g} mm, "
            f"u = {1000 * hub.u_arm_m:g} mm"
        )
    return [Finding(rule="hub-moments", where=machine.name, message=message, level="note")]


# The force that moves a moment with the arm, and its sign in SAE J670 (z down).
_CARRIED = {"MX": ("FY", 1.0), "MY": ("FX", -1.0)}


def _u_fit(block: HubBlock, record: CalibrationRecord, load: str, covariance: Mapping[str, Array]) -> float:
    """Return what the record's coefficients leave in a load at the mean indications [SI]."""
    if load not in covariance:
        return 0.0
    point = {name: block.cells[i : i + 1] for i, name in enumerate(record.indications)}
    tare = dict.fromkeys(record.indications, 0.0) if block.tared else None
    jacobian = coefficient_jacobian(record, load, point, tare)[0]
    variance = float(jacobian @ covariance[load] @ jacobian)
    return math.sqrt(max(variance, 0.0)) * si_scale(record.load(load).unit)
