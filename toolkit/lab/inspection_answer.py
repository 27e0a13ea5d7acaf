"""What `inspect` says of a recording: its content, the calibration that computed it, corrected values."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from toolkit.lab.answers import finding_lines, table

if TYPE_CHECKING:
    from toolkit.audit.estimate import Interval
    from toolkit.audit.inspection import Inspection, LoadBlock
    from toolkit.audit.model import Segment as AuditSegment
    from toolkit.lab.record_answer_types import Block, BlockValues, Identified, Inspected, Segment

_SIGNS = {1: "+", -1: "-", 0: "open"}


def intervals_of(inspection: Inspection) -> tuple[Interval, ...]:
    """Return what the printed digits allow each coefficient of each load."""
    from toolkit.audit.estimate import coefficient_intervals

    return tuple(
        interval
        for load in inspection.columns.loads
        for interval in coefficient_intervals(inspection.columns, load)
    )


def inspection_payload(inspection: Inspection, intervals: tuple[Interval, ...]) -> Inspected:
    """Return what a recording holds as the JSON answer."""
    recording, context = inspection.recording, inspection.context
    return {
        "file": recording.path,
        "sha256": recording.sha256,
        "format": recording.format,
        "machine": recording.machine.name,
        "machine_source": context.machine_source,
        "simulated": recording.simulated,
        "date": context.date.isoformat() if context.date else None,
        "rows": recording.rows,
        "channels": [
            {"symbol": s.symbol, "header": s.header, "unit": s.unit, "role": s.role} for s in recording.series
        ],
        "blocks": [_block(block) for block in inspection.blocks],
        "slip_angle_deg": math.degrees(inspection.slip_angle_rad),
        "calibration": _calibration(inspection),
        "corrected_by": inspection.corrected_by,
        "unverified": inspection.unverified,
        "corrected_tared": False,
        "corrected": [_values(block) for block in inspection.blocks],
        "corrected_first_row": _values(inspection.first_row),
        "intervals": [
            {"load": i.load, "name": i.name, "low": i.low, "high": i.high, "sign": i.sign} for i in intervals
        ],
        "refused_records": [
            {"id": refusal.id, "rule": refusal.rule, "reason": refusal.reason}
            for refusal in (inspection.choice.refused if inspection.choice else ())
        ],
        "findings": [finding.as_dict() for finding in inspection.findings],
    }


def _block(block: LoadBlock) -> Block:
    return {
        "first_row": block.first_row,
        "last_row": block.last_row,
        "rows": block.last_row - block.first_row + 1,
        "tare": block.tare,
        "load_N": block.FZ_N,
        "load_lbf": _lbf(block.FZ_N),
        "slip_angle_deg": math.degrees(block.SA_rad),
    }


def _values(block: LoadBlock) -> BlockValues:
    return {
        "first_row": block.first_row,
        "last_row": block.last_row,
        "FY_file_N": block.FY_file_N,
        "FY_N": block.FY_N,
        "FY_file_lbf": _lbf(block.FY_file_N),
        "FY_lbf": _lbf(block.FY_N),
        "MZ_file_Nm": block.MZ_file_Nm,
        "MZ_Nm": block.MZ_Nm,
        "MZ_file_lbf_ft": _lbf_ft(block.MZ_file_Nm),
        "MZ_lbf_ft": _lbf_ft(block.MZ_Nm),
    }


def _calibration(inspection: Inspection) -> Identified | None:
    from toolkit.audit.inspection import withdrawal, wrong_signs

    identified = inspection.identification
    if identified is None:
        return None
    withdrawn = withdrawal(inspection)
    return {
        "grade": identified.grade,
        "record": identified.record,
        "variant": identified.variant,
        "issued_digits": identified.issued,
        "candidates": identified.candidates,
        "withdrawn": None if withdrawn is None else withdrawn.reason,
        "against_corrected_by": wrong_signs(inspection),
        "void_always": None if withdrawn is None else withdrawn.void_always,
        "segments": [_segment(segment) for segment in identified.segments],
        "in_force": identified.in_force,
        "repair": None
        if identified.repair is None
        else {
            "FY_max_abs_N": identified.repair.FY_max_abs_N,
            "MZ_max_abs_Nm": identified.repair.MZ_max_abs_Nm,
        },
        "skipped": [{"id": s.id, "reason": s.reason} for s in identified.skipped],
    }


def _segment(segment: AuditSegment) -> Segment:
    entry: Segment = {
        "first_row": segment.first_row,
        "last_row": segment.last_row,
        "record": segment.record,
        "variant": segment.variant,
        "grade": segment.grade,
    }
    if segment.candidates:
        entry["candidates"] = segment.candidates
    return entry


def inspection_text(inspection: Inspection, intervals: tuple[Interval, ...]) -> str:
    """Return what a recording holds for people."""
    recording, context = inspection.recording, inspection.context
    by = {"option": "--machine", "test.toml": "test.toml", "file": "its own properties", "default": "default"}
    lines = [
        f"{recording.path}" + ("  SIMULATED" if recording.simulated else ""),
        f"  sha256     {recording.sha256}",
        f"  machine    {recording.machine.title} ({recording.machine.name}, by {by[context.machine_source]})",
        f"  test date  {context.date.isoformat() if context.date else 'unknown'}",
        f"  channels   {len(recording.series)}, {recording.rows} rows: "
        + ", ".join(f"{s.symbol} [{s.unit}]" for s in recording.series),
        f"  slip angle {math.degrees(inspection.slip_angle_rad):+.2f} deg, measured",
        "",
        _indented(_block_table(inspection)),
        "",
        *_calibration_lines(inspection),
        *_interval_lines(intervals),
    ]
    remarks = [finding for finding in inspection.findings if not finding.rule.startswith("identified-")]
    return "\n".join([*lines, *finding_lines(remarks)]).rstrip()


def _block_table(inspection: Inspection) -> str:
    head = ["load block", "FZ [lbf]", "FZ [N]", "SA [deg]", "Fy file [lbf]", "corrected", "Mz file [lbf·ft]"]
    rows = []
    for name, block in [("first row", inspection.first_row), *((_rows(b), b) for b in inspection.blocks)]:
        rows.append(
            [
                name,
                f"{_lbf(block.FZ_N):.1f}",
                f"{block.FZ_N:.0f}",
                f"{math.degrees(block.SA_rad):+.3f}",
                _shown(_lbf(block.FY_file_N), 2),
                _shown(_lbf(block.FY_N), 2),
                _shown(_lbf_ft(block.MZ_file_Nm), 3),
                _shown(_lbf_ft(block.MZ_Nm), 3),
            ]
        )
    return table([*head, "corrected"], rows)


def _calibration_lines(inspection: Inspection) -> list[str]:
    import textwrap

    from toolkit.audit.inspection import withdrawal, wrong_signs
    from toolkit.audit.model import TELLS

    identified = inspection.identification
    if identified is None:
        why = "no registry" if inspection.choice is None else "the file has no own Fy and Mz"
        return [f"  calibration not identified: {why}"]
    record = (
        f"{identified.record}{', ' + identified.variant if identified.variant else ''}"
        if identified.record
        else "-"
    )
    if identified.candidates:
        record = " or ".join(identified.candidates)
    withdrawn, signs = withdrawal(inspection), wrong_signs(inspection)
    how = TELLS[identified.grade]
    if identified.grade == "stale" and withdrawn is not None:
        how = "by a withdrawn calibration"
    if signs is not None:
        how += f": {signs} against {inspection.corrected_by}"
    lines = [f"  Fy and Mz  computed {how}", f"    record   {record}", f"    grade    {identified.grade}"]
    if withdrawn is not None:
        void = "void on every day" if withdrawn.void_always else f"void from {withdrawn.void_from}"
        lines += textwrap.wrap(
            f"withdrawn, {void}: {withdrawn.reason}",
            106,
            initial_indent="    ",
            subsequent_indent="      ",
        )
    if len(identified.segments) > 1:
        lines += [
            f"    rows {s.first_row}-{s.last_row}: {s.record or '-'}"
            f"{', ' + s.variant if s.variant else ''} ({s.grade})"
            for s in identified.segments
        ]
    if inspection.corrected_by is not None:
        first = inspection.first_row
        when = "in force on the test's date" if identified.in_force else "in force today"
        tare = "; tare not subtracted ('toolkit process' does)" if inspection.context.tare else ""
        mark = "  UNVERIFIED" if inspection.unverified else ""
        lines.append(f"    corrected by {inspection.corrected_by}, {when}{tare}{mark}")
        if first.FY_N is not None and first.FY_file_N is not None:
            lines.append(
                f"    first row: Fy {_lbf(first.FY_N):.2f} lbf where the file has {_lbf(first.FY_file_N):.2f}"
            )
    return lines


def _interval_lines(intervals: tuple[Interval, ...]) -> list[str]:
    if not intervals:
        return []
    rows = [[f"{i.load} {i.name}", f"{i.low:.6g}", f"{i.high:.6g}", _SIGNS[i.sign]] for i in intervals]
    body = table(["coefficient", "from", "to", "sign"], rows)
    return ["", "  what the printed digits allow, in the file's units:", _indented(body)]


def _rows(block: LoadBlock) -> str:
    return f"rows {block.first_row}-{block.last_row}" + (" (tare)" if block.tare else "")


def _lbf(value: float | None) -> Any:
    from toolkit.units import si_scale

    return None if value is None else value / si_scale("lbf")


def _lbf_ft(value: float | None) -> Any:
    from toolkit.units import si_scale

    return None if value is None else value / si_scale("lbf*ft")


def _shown(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def _indented(text: str) -> str:
    return "\n".join(f"  {line}" for line in text.splitlines())
