"""What `process` says of a test: the JSON of the files contract in SI and SAE axes, and tables for people."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NotRequired, TypedDict

from toolkit.calibration.records.use import UsedRecord
from toolkit.channels import CHANNELS
from toolkit.characteristics.characteristic import BOTH, TRANSIENT
from toolkit.declared.answers import entry_of
from toolkit.estimate import Estimate, plus_minus
from toolkit.findings import FindingEntry
from toolkit.lab.answers import (
    DraftKeys,
    EstimateEntry,
    Timing,
    draft_keys,
    finding_lines,
    mark_words,
    signature_words,
)
from toolkit.listing import one_line, table

if TYPE_CHECKING:
    from toolkit.characteristics.model import Point
    from toolkit.characteristics.sweep_fit import SweepFit
    from toolkit.lab.tire_tests.resolve import Resolved
    from toolkit.reduction.model import Condition as ReducedCondition
    from toolkit.reduction.model import HubLoad
    from toolkit.report.style import Style


class Tare(TypedDict):
    """What was taken off the indications."""

    source: Annotated[str, "where it comes from"]
    values: Annotated[Mapping[str, float], "by indication"]
    unit: str


class StatedComponent(TypedDict):
    """An uncertainty that the machine's definition states (type B)."""

    symbol: Annotated[str, "channel"]
    u: Annotated[float, "standard uncertainty"]
    unit: str
    relative: Annotated[float, "standard uncertainty as a part of the value"]
    effect: Annotated[float, "relative change of a force for a relative change of the condition"]
    common: Annotated[
        Literal["machine", "test"], "one error in all tests of the machine, or one in each test"
    ]
    source: str


class HubValue(TypedDict):
    """A calibrated load of the hub beside FY and MZ, SAE J670; MX and MY where [hub] puts them."""

    value: Annotated[float, "mean of the block, by the record"]
    u: Annotated[float, "standard uncertainty: scatter, record, zeros, arm"]
    U: Annotated[float, "expanded uncertainty"]
    k: Annotated[int, "coverage factor"]
    unit: Annotated[str, "N or N*m"]


class Condition(TypedDict):
    """The mean of one block of a recording: one slip angle under one load."""

    file: Annotated[str, "recording"]
    rotation: Annotated[str, "forward or reverse"]
    rows: Annotated[list[int], "first and last row, from 1 at the first row of data"]
    step_SA_rad: Annotated[float | None, "slip angle of the protocol's step"]
    step_FZ_N: Annotated[float | None, "load of the protocol's step"]
    SA_rad: Annotated[float, "measured slip angle"]
    FZ_N: Annotated[float, "measured load"]
    FY_N: Annotated[float, "lateral force by the record"]
    MZ_Nm: Annotated[float, "aligning moment by the record"]
    u_FY_N: Annotated[float | None, "standard uncertainty by every source; null where the block is not used"]
    u_FY_repeatability_N: Annotated[float | None, "the part of repeatability"]
    u_MZ_Nm: Annotated[float | None, "as u_FY_N"]
    u_MZ_repeatability_Nm: Annotated[float | None, "as u_FY_repeatability_N"]
    FY_file_N: Annotated[float | None, "what the file itself says"]
    MZ_file_Nm: Annotated[float | None, "what the file itself says"]
    FZ_common_N: Annotated[float, "load to which the values of one load are carried"]
    FY_common_N: Annotated[float, "FY at the common load"]
    MZ_common_Nm: Annotated[float, "MZ at the common load"]
    u_FY_common_N: Annotated[float, "standard uncertainty of carrying it there, and of the zero"]
    u_MZ_common_Nm: Annotated[float, "as u_FY_common_N"]
    used: Annotated[bool, "false where a later block of the same condition stands for it"]
    calibration_sha256: Annotated[str, "of the record that computed it"]
    hub: NotRequired[Annotated[Mapping[str, HubValue], "loads of the hub by symbol, where it has any"]]


class SweptLoad(TypedDict):
    """What a recording in time says at one load: by what distance FY lags the slip angle, delays among it."""

    file: Annotated[str, "recording"]
    rotation: Annotated[str, "forward or reverse"]
    rows: Annotated[list[int], "first and last row, from 1 at the first row of data"]
    FZ_N: Annotated[float, "mean load"]
    speed_m_s: Annotated[float, "mean speed of the road"]
    steer_rate_rad_s: Annotated[float, "rate at which the slip angle is steered"]
    apparent_length: Annotated[
        EstimateEntry, "relaxation length and V times the delay of FY, which one speed does not part"
    ]
    u_form_m: Annotated[float, "standard uncertainty by the form of the tire's answer, not among its u"]
    delay_s: Annotated[float | None, "of FY behind the slip angle, as the machine states it"]
    u_delay_s: Annotated[float | None, "its standard uncertainty"]


class ReducedTest(DraftKeys):
    """A reduced test: conditions, characteristics with their budgets, findings."""

    test: Annotated[str, "name"]
    machine: str
    simulated: Annotated[bool, "whether the virtual machine recorded it"]
    axes: Annotated[str, "axis system of all values"]
    averaging: Annotated[str, "what was averaged, in words"]
    protocol: Annotated[str | None, "the protocol that the test is held against"]
    reversal: Annotated[str, "what is turned for the reversed runs: drum or tire"]
    calibration: UsedRecord
    tare: Tare
    stated: list[StatedComponent]
    conditions: list[Condition]
    characteristics: Annotated[
        Mapping[str, list[dict[str, Any]]],
        "lists by the catalogue's tables (characteristics.md): load_N, rotation and SA_rad where the list "
        "has them, then each characteristic as value with uncertainty, or null; and budgets, as below",
    ]
    sweeps: Annotated[list[SweptLoad], "recordings in time, at each load"]
    impossible: Annotated[list[FindingEntry], "values that no tire has"]
    findings: list[FindingEntry]


class ProcessAnswer(ReducedTest):
    """A reduced test, and where it was written."""

    out: Annotated[Path | None, "file that was written"]
    content_sha256: Annotated[str | None, "of the file's content"]
    timing: Timing


def process_payload(resolved: Resolved) -> ReducedTest:
    """Return a reduced test as the JSON answer: SI units, SAE axes; names carry the units.

    ``u_FY_N`` and ``u_MZ_Nm`` of a condition hold every source of its budget, null where it is not used.
    """
    from toolkit.characteristics.model import answer_lists

    reduced, characteristics = resolved.result.reduced, resolved.result.characteristics
    points = {(p.file, p.first_row): p for p in characteristics.points}
    return entry_of(
        ReducedTest, resolved, reduced, reduced.info,
        test=reduced.info.name,
        machine=reduced.info.machine,
        stated=[
            entry_of(StatedComponent, c, unit=CHANNELS[c.symbol].si if c.symbol in CHANNELS else "1")
            for c in reduced.stated
        ],
        conditions=[_condition(c, points.get((c.file, c.first_row))) for c in reduced.conditions],
        characteristics={
            **{
                name: [_entry(entry) for entry in entries]
                for name, entries in answer_lists(characteristics.rows).items()
            },
            "budgets": [
                {
                    "load_N": row.load_N,
                    "rotation": row.rotation,
                    "name": row.name,
                    "unit": row.estimate.unit,
                    "standard_uncertainty": dict(row.sources),
                }
                for row in characteristics.rows
                if row.estimate is not None and row.SA_rad is None
            ],
        },
        sweeps=[_swept(sweep) for sweep in characteristics.sweeps],
        **draft_keys(reduced.calibration),
    )  # fmt: skip


def _swept(sweep: SweepFit) -> SweptLoad:
    apparent = Estimate(value=sweep.length_m, u=sweep.u_m, unit="m", dof=sweep.dof)
    return entry_of(
        SweptLoad, sweep, rows=[sweep.first_row, sweep.last_row], FZ_N=sweep.load_N,
        apparent_length=apparent.as_dict(), u_form_m=sweep.form_m, u_delay_s=sweep.delay_u_s,
    )  # fmt: skip


def _condition(c: ReducedCondition, point: Point | None) -> Condition:
    entry: Condition = {
        "file": c.file,
        "rotation": c.rotation,
        "rows": [c.first_row, c.last_row],
        "step_SA_rad": c.step_SA,
        "step_FZ_N": c.step_FZ,
        "SA_rad": c.SA,
        "FZ_N": c.FZ,
        "FY_N": c.FY,
        "MZ_Nm": c.MZ,
        "u_FY_N": point.u_FY if point is not None and c.used else None,
        "u_FY_repeatability_N": c.u_FY,
        "u_MZ_Nm": point.u_MZ if point is not None and c.used else None,
        "u_MZ_repeatability_Nm": c.u_MZ,
        "FY_file_N": c.FY_file,
        "MZ_file_Nm": c.MZ_file,
        "FZ_common_N": c.FZ_common,
        "FY_common_N": c.FY_common,
        "MZ_common_Nm": c.MZ_common,
        "u_FY_common_N": math.hypot(c.u_FY_common, c.u_FY_zero),
        "u_MZ_common_Nm": math.hypot(c.u_MZ_common, c.u_MZ_zero),
        "used": c.used,
        "calibration_sha256": c.calibration_sha256,
    }
    if c.hub:
        entry["hub"] = {load.load: _hub_value(load) for load in c.hub}
    return entry


def _hub_value(entry: HubLoad) -> HubValue:
    unit = CHANNELS[entry.load].si
    return {"value": entry.value, "u": entry.u, "U": 2 * entry.u, "k": 2, "unit": unit}


def _entry(entry: dict[str, Any]) -> dict[str, Any]:
    return {key: value.as_dict() if isinstance(value, Estimate) else value for key, value in entry.items()}


def process_text(resolved: Resolved, out: Path | None, style: Style) -> str:
    """Return a reduced test for people: conditions, marks, the characteristics of each load, findings."""
    reduced = resolved.result.reduced
    mark = "  SIMULATED" if reduced.info.simulated else ""
    used = sum(c.used for c in reduced.conditions)
    files = len({c.file for c in reduced.conditions})
    lines = [
        f"{one_line(reduced.info.name)}: {used} conditions of {files} files{mark}",
        f"calibration {reduced.calibration.id} ({reduced.calibration.sha256[:12]}...)"
        + mark_words(reduced.calibration),
        signature_words(reduced.calibration),
        *(["IMPOSSIBLE VALUES: no tire has them, see the findings"] if reduced.impossible else []),
        f"averaging: {reduced.averaging}",
        f"tare: {reduced.tare.source}",
        *(["reversed runs: the tire turned round on the hub"] if reduced.info.reversal == "tire" else []),
        "",
        _characteristics_table(resolved, style),
    ]
    if resolved.findings:
        lines += ["", f"findings: {len(resolved.findings)} (toolkit explain RULE tells more)"]
        lines += finding_lines(resolved.findings)
    lines.append("")
    lines.append(
        f"written: {out}" if out else "nothing written; --out test.xlsx keeps the whole test in one file"
    )
    return "\n".join(lines)


def _characteristics_table(resolved: Resolved, style: Style) -> str:
    """Return the printed characteristics, one row a load; those of a direction with the drum forward."""
    from toolkit.characteristics.catalogue import columns, tables
    from toolkit.units import from_si

    characteristics = resolved.result.characteristics
    printed = [
        one
        for wide in tables()
        for one in columns(wide)
        if one.console_heading is not None and (characteristics.sweeps or wide != TRANSIENT)
    ]
    units = {characteristic.name: style.unit(characteristic.printed_unit) for characteristic in printed}
    lines = []
    for load in characteristics.loads_N:
        rotations = {row.rotation for row in characteristics.rows if row.load_N == load}
        direction = "forward" if "forward" in rotations else "reverse"
        cells = [f"{load:.0f}", f"{float(from_si(load, 'lbf')):.0f}"]
        for one in printed:
            row = characteristics.at(one.name, load, BOTH if one.scope == "load" else direction)
            factor = one.factor * units[one.name][1]
            cells.append(_shown(row.estimate if row is not None else None, factor, one.digits))
        lines.append(cells)
    head = ["FZ [N]", "FZ [lbf]"]
    head += [
        f"{characteristic.console_heading} [{str(units[characteristic.name][0]).replace('*', '·')}]"
        for characteristic in printed
    ]
    return table(head, lines, align=">" * len(head))


def _shown(estimate: Estimate | None, factor: float, digits: int) -> str:
    if estimate is None:
        return "-"
    shown = estimate.scaled(factor, "")
    return plus_minus(shown.value, shown.expanded()[0], spec=f".{digits}f")
