"""What `inspect` says of a recording: its content, the calibration that computed it, corrected values."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NotRequired, TypedDict

from toolkit.audit.model import DisagreeingSides, Repair, SkippedRecord
from toolkit.calibration.registry.registry import RefusedRecord
from toolkit.declared.answers import entry_of, merged
from toolkit.findings import FindingEntry
from toolkit.lab.answers import finding_lines
from toolkit.listing import one_line, table

if TYPE_CHECKING:
    from toolkit.audit.estimate import Interval
    from toolkit.audit.inspection import Inspection, LoadBlock
from toolkit.audit.model import Segment


class SeriesEntry(TypedDict):
    """A column of a recording."""

    symbol: Annotated[str, "channel"]
    header: Annotated[str, "as the file has it"]
    unit: str
    role: Annotated[str, "indication, load, angle, ..."]


class Block(TypedDict):
    """Rows of one load and slip angle."""

    first_row: int
    last_row: int
    rows: int
    tare: Annotated[bool, "whether it is taken without load"]
    load_N: float
    load_lbf: float | None
    slip_angle_deg: Annotated[float, "measured"]


class BlockValues(TypedDict):
    """Fy and Mz of a block, as the file has them and as the record in force computes them."""

    first_row: int
    last_row: int
    FY_file_N: float | None
    FY_N: float | None
    FY_file_lbf: float | None
    FY_lbf: float | None
    MZ_file_Nm: float | None
    MZ_Nm: float | None
    MZ_file_lbf_ft: float | None
    MZ_lbf_ft: float | None


class IdentifiedSegment(TypedDict):
    """Rows that one record computed."""

    first_row: int
    last_row: int
    record: str | None
    variant: Annotated[str | None, "how the record was changed: E5 negative in FY, MZ"]
    grade: str
    candidates: NotRequired[Annotated[Sequence[str], "of an ambiguous segment"]]


class Identified(TypedDict):
    """Which calibration computed the Fy and Mz of a file."""

    grade: Annotated[str, "exact, rounding, undated, stale, sign_variant, column_swap, ambiguous or unknown"]
    record: str | None
    variant: str | None
    issued_digits: Annotated[bool | None, "whether the coefficients were those of the certificate"]
    candidates: Annotated[Sequence[str], "of an ambiguous file"]
    withdrawn: Annotated[str | None, "why the record was withdrawn"]
    against_corrected_by: Annotated[str | None, "signs that differ from the record in force, in words"]
    void_always: bool | None
    segments: list[IdentifiedSegment]
    sides: Annotated[DisagreeingSides | None, "where rows disagree with their cells: which side is wrong"]
    in_force: Annotated[str | None, "the record in force on the date of the test"]
    repair: Repair | None
    skipped: list[SkippedRecord]


class CoefficientInterval(TypedDict):
    """What the printed digits allow a coefficient."""

    load: str
    name: str
    low: float | None
    high: float | None
    sign: Annotated[int, "1 or -1 where the interval decides it, 0 where it does not"]


class UnreadFile(TypedDict):
    """A file of several that cannot be read."""

    file: Path
    error: Annotated[Mapping[str, str | None], "what, where, got, expected, next"]


class Inspected(TypedDict):
    """What a recording holds, and what computed it."""

    file: Path
    sha256: str
    format: str
    machine: Annotated[str, "name of the definition"]
    machine_source: Annotated[str, "option, test.toml, file or default"]
    simulated: bool
    date: str | None
    rows: int
    channels: list[SeriesEntry]
    blocks: list[Block]
    slip_angle_deg: float
    calibration: Annotated[Identified | None, "null where the file has no Fy and Mz"]
    corrected_by: Annotated[str | None, "record of the corrected values"]
    unverified: bool
    corrected_tared: Annotated[bool, "false: no zero is taken off here"]
    corrected: list[BlockValues]
    corrected_first_row: BlockValues
    intervals: list[CoefficientInterval]
    refused_records: Sequence[RefusedRecord]
    findings: list[FindingEntry]


class InspectAnswer(TypedDict):
    """What recordings hold."""

    files: Annotated[list[Inspected | UnreadFile], "in the order of the command"]
    findings: list[FindingEntry]


InspectForms = merged(InspectAnswer, Inspected, name="SingleInspectAnswer") | InspectAnswer
"""Of a single file its entries stand at the top too."""


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
    return entry_of(
        Inspected, inspection, context, recording,
        file=recording.path,
        machine=recording.machine.name,
        channels=[entry_of(SeriesEntry, series) for series in recording.series],
        blocks=[_block(block) for block in inspection.blocks],
        slip_angle_deg=math.degrees(inspection.slip_angle_rad),
        calibration=_calibration(inspection),
        corrected_tared=False,
        corrected=[_values(block) for block in inspection.blocks],
        corrected_first_row=_values(inspection.first_row),
        intervals=[entry_of(CoefficientInterval, interval) for interval in intervals],
        refused_records=inspection.choice.refused if inspection.choice else (),
    )  # fmt: skip


def _block(block: LoadBlock) -> Block:
    return entry_of(
        Block, block, rows=block.last_row - block.first_row + 1, load_N=block.FZ_N,
        load_lbf=_lbf(block.FZ_N), slip_angle_deg=math.degrees(block.SA_rad),
    )  # fmt: skip


def _values(block: LoadBlock) -> BlockValues:
    return entry_of(
        BlockValues, block,
        FY_file_lbf=_lbf(block.FY_file_N), FY_lbf=_lbf(block.FY_N),
        MZ_file_lbf_ft=_lbf_ft(block.MZ_file_Nm), MZ_lbf_ft=_lbf_ft(block.MZ_Nm),
    )  # fmt: skip


def _calibration(inspection: Inspection) -> Identified | None:
    from toolkit.audit.inspection import withdrawal, wrong_signs

    identified = inspection.identification
    if identified is None:
        return None
    withdrawn = withdrawal(inspection)
    return entry_of(
        Identified, identified,
        issued_digits=identified.issued,
        withdrawn=None if withdrawn is None else withdrawn.reason,
        against_corrected_by=wrong_signs(inspection),
        void_always=None if withdrawn is None else withdrawn.void_always,
        segments=[_segment(segment) for segment in identified.segments],
    )  # fmt: skip


def _segment(segment: Segment) -> IdentifiedSegment:
    entry = entry_of(IdentifiedSegment, segment)
    if not segment.candidates:
        del entry["candidates"]
    return entry


def inspection_text(inspection: Inspection, intervals: tuple[Interval, ...]) -> str:
    """Return what a recording holds for people."""
    recording, context = inspection.recording, inspection.context
    by = {"option": "--machine", "test.toml": "test.toml", "file": "its own properties", "default": "default"}
    lines = [
        one_line(recording.path) + ("  SIMULATED" if recording.simulated else ""),
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
    from toolkit.audit.model import TELLS, in_words
    from toolkit.audit.sides import WOULD_DECIDE

    identified = inspection.identification
    if identified is None:
        why = "no registry" if inspection.choice is None else "the file has no own Fy and Mz"
        return [f"  calibration not identified: {why}"]
    record = in_words(identified.record, identified.candidates, identified.variant) or "-"
    withdrawn, signs = withdrawal(inspection), wrong_signs(inspection)
    how = TELLS[identified.grade]
    side = None if identified.sides is None else identified.sides.side
    if identified.grade == "stale" and withdrawn is not None:
        how = "by a withdrawn calibration"
    if signs is not None:
        how += f": {signs} against {inspection.corrected_by}"
    computed = f"computed {how}"
    if identified.sides is not None and side == "cells":
        computed = "right; the cells beside them are not: a cell column was changed"
    elif identified.sides is not None and side == "open":
        computed = "disagree with the cells beside them, and nothing here says which side is wrong"
    lines = [f"  Fy and Mz  {computed}", f"    record   {record}", f"    grade    {identified.grade}"]
    if withdrawn is not None:
        void = "void on every day" if withdrawn.void_always else f"void from {withdrawn.void_from}"
        lines += textwrap.wrap(
            f"withdrawn, {void}: {withdrawn.reason}", 106, initial_indent="    ", subsequent_indent="      "
        )
    if len(identified.segments) > 1:
        lines += [
            f"    rows {s.first_row}-{s.last_row}: "
            f"{in_words(s.record, s.candidates, s.variant) or '-'} ({s.grade})"
            for s in identified.segments
        ]
    if identified.sides is not None:
        text = identified.sides.reason + (f"; {WOULD_DECIDE}" if side == "open" else "")
        lines += textwrap.wrap(text, 106, initial_indent="    why      ", subsequent_indent="             ")
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
