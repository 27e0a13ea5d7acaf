"""What `inspect` says of a recording: its content, the calibration that computed it, corrected values."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from toolkit.lab.answers import finding_lines, table

if TYPE_CHECKING:
    from toolkit.audit.inspection import Inspection, LoadBlock
    from toolkit.audit.intervals import Interval

_SIGNS = {1: "+", -1: "-", 0: "open"}


def intervals_of(found: Inspection) -> tuple[Interval, ...]:
    """Return what the printed digits allow each coefficient of each load."""
    from toolkit.audit.intervals import coefficient_intervals

    return tuple(one for load in found.columns.loads for one in coefficient_intervals(found.columns, load))


def inspection_payload(found: Inspection, intervals: tuple[Interval, ...]) -> dict[str, Any]:
    """Return what a recording holds as the JSON answer."""
    recording, context = found.recording, found.context
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
        "blocks": [_block(block) for block in found.blocks],
        "slip_angle_deg": math.degrees(found.slip_angle_rad),
        "calibration": _calibration(found),
        "corrected_by": found.corrected_by,
        "unverified": found.unverified,
        "corrected_tared": False,
        "corrected": [_values(block) for block in found.blocks],
        "corrected_first_row": _values(found.first_row),
        "intervals": [
            {"load": i.load, "name": i.name, "low": i.low, "high": i.high, "sign": i.sign} for i in intervals
        ],
        "refused_records": [
            {"id": one.id, "rule": one.rule, "reason": one.reason}
            for one in (found.choice.refused if found.choice else ())
        ],
        "findings": [finding.as_dict() for finding in found.findings],
    }


def _block(block: LoadBlock) -> dict[str, Any]:
    return {
        "first_row": block.first_row,
        "last_row": block.last_row,
        "rows": block.last_row - block.first_row + 1,
        "tare": block.tare,
        "load_N": block.FZ_N,
        "load_lbf": _lbf(block.FZ_N),
        "slip_angle_deg": math.degrees(block.SA_rad),
    }


def _values(block: LoadBlock) -> dict[str, Any]:
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


def _calibration(found: Inspection) -> dict[str, Any] | None:
    from toolkit.audit.inspection import withdrawal, wrong_signs

    one = found.identification
    if one is None:
        return None
    withdrawn = withdrawal(found)
    return {
        "grade": one.grade,
        "record": one.record,
        "variant": one.variant,
        "issued_digits": one.issued,
        "candidates": one.candidates,
        "withdrawn": None if withdrawn is None else withdrawn.reason,
        "against_corrected_by": wrong_signs(found),
        "void_always": None if withdrawn is None else withdrawn.void_always,
        "segments": [
            {
                "first_row": s.first_row,
                "last_row": s.last_row,
                "record": s.record,
                "variant": s.variant,
                "grade": s.grade,
                **({"candidates": s.candidates} if s.candidates else {}),
            }
            for s in one.segments
        ],
        "in_force": one.in_force,
        "repair": None
        if one.repair is None
        else {"FY_max_abs_N": one.repair.FY_max_abs_N, "MZ_max_abs_Nm": one.repair.MZ_max_abs_Nm},
        "skipped": [{"id": s.id, "reason": s.reason} for s in one.skipped],
    }


def inspection_text(found: Inspection, intervals: tuple[Interval, ...]) -> str:
    """Return what a recording holds for people."""
    recording, context = found.recording, found.context
    by = {"option": "--machine", "test.toml": "test.toml", "file": "its own properties", "default": "default"}
    lines = [
        f"{recording.path}" + ("  SIMULATED" if recording.simulated else ""),
        f"  sha256     {recording.sha256}",
        f"  machine    {recording.machine.title} ({recording.machine.name}, by {by[context.machine_source]})",
        f"  test date  {context.date.isoformat() if context.date else 'unknown'}",
        f"  channels   {len(recording.series)}, {recording.rows} rows: "
        + ", ".join(f"{s.symbol} [{s.unit}]" for s in recording.series),
        f"  slip angle {math.degrees(found.slip_angle_rad):+.2f} deg, measured",
        "",
        _indented(_block_table(found)),
        "",
        *_calibration_lines(found),
        *_interval_lines(intervals),
    ]
    others = [finding for finding in found.findings if not finding.rule.startswith("identified-")]
    return "\n".join([*lines, *finding_lines(others)]).rstrip()


def _block_table(found: Inspection) -> str:
    head = ["load block", "FZ [lbf]", "FZ [N]", "SA [deg]", "Fy file [lbf]", "corrected", "Mz file [lbf·ft]"]
    rows = []
    for name, block in [("first row", found.first_row), *((_rows(b), b) for b in found.blocks)]:
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


def _calibration_lines(found: Inspection) -> list[str]:
    import textwrap

    from toolkit.audit.inspection import withdrawal, wrong_signs
    from toolkit.audit.model import TELLS

    one = found.identification
    if one is None:
        why = "no registry" if found.choice is None else "the file has no own Fy and Mz"
        return [f"  calibration not identified: {why}"]
    record = f"{one.record}{', ' + one.variant if one.variant else ''}" if one.record else "-"
    if one.candidates:
        record = " or ".join(one.candidates)
    withdrawn, signs = withdrawal(found), wrong_signs(found)
    how = TELLS[one.grade]
    if one.grade == "stale" and withdrawn is not None:
        how = "by a withdrawn calibration"
    if signs is not None:
        how += f": {signs} against {found.corrected_by}"
    lines = [f"  Fy and Mz  computed {how}", f"    record   {record}", f"    grade    {one.grade}"]
    if withdrawn is not None:
        void = "void on every day" if withdrawn.void_always else f"void from {withdrawn.void_from}"
        lines += textwrap.wrap(
            f"withdrawn, {void}: {withdrawn.reason}",
            106,
            initial_indent="    ",
            subsequent_indent="      ",
        )
    if len(one.segments) > 1:
        lines += [
            f"    rows {s.first_row}-{s.last_row}: {s.record or '-'}"
            f"{', ' + s.variant if s.variant else ''} ({s.grade})"
            for s in one.segments
        ]
    if found.corrected_by is not None:
        first = found.first_row
        when = "in force on the test's date" if one.in_force else "in force today"
        tare = "; tare not subtracted ('toolkit process' does)" if found.context.tare else ""
        mark = "  UNVERIFIED" if found.unverified else ""
        lines.append(f"    corrected by {found.corrected_by}, {when}{tare}{mark}")
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
