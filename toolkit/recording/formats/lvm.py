"""LVM: LabVIEW's text measurement files.

By National Instruments' "Specification for the LabVIEW Measurement File (.lvm)": a header of tagged lines
gives the separator and the decimal sign; each segment has a header of its own (or the first alone has one),
a line of channel names and rows of values; special blocks are passed over. A channel's unit is its
``Y_Unit_Label``. The x values are a channel where the file saves them: time, unless ``X_Dimension`` says
otherwise. With ``X_Columns No`` they are not saved, and none is made up.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from toolkit.errors import ColumnError, RecordingError, UnreadableError
from toolkit.machine import Machine
from toolkit.recording.csvfile import number_or_text
from toolkit.recording.formats.vectors import Vector, Vectors, Written, damaged, one_table, truncated
from toolkit.recording.table import judge, refuse_cell

_END = "***End_of_Header***"
_SPECIAL, _SPECIAL_END = "***Start_Special***", "***End_Special***"
_X = "X_Value"
_COMMENT = "Comment"
_UNNAMED_UNIT = "default si unit"  # the specification's word for a label that says nothing
_SEPARATORS = {"tab": "\t", "comma": ",", "semicolon": ";"}


@dataclass(slots=True)
class _Segment:
    """One segment: its tags, the fields of its line of names, and (line number, fields) of its rows."""

    tags: dict[str, list[str]]
    names: list[str] = field(default_factory=list)
    rows: list[tuple[int, list[str]]] = field(default_factory=list)

    def tag(self, name: str, column: int) -> str:
        values = self.tags.get(name, [])
        return values[column].strip() if 0 <= column < len(values) else ""


def read_lvm(data: bytes, where: object, machine: Machine) -> Vectors:
    """Return the channels of an LVM file, its segments one after the other.

    Raises
    ------
    UnreadableError
        rule ``unreadable truncated damaged no-data``
    ColumnError
        rule ``doubled-column``: channels with time columns that differ
    CellError
        rule ``text-cell empty-cell nan-cell``: with the line of the file
    RecordingError
        rule ``several-sheets``: segments with other channels than the first
    """
    lines = _text(data).splitlines()
    head, start, separator = _header(lines, where)
    decimal = head.get("Decimal_Separator", ".")[:1] or "."
    segments = _segments(lines, start, separator, head.get("Multi_Headings", "No"), where)
    filled = [segment for segment in segments if segment.rows]
    if not filled:
        raise UnreadableError(
            "the LVM file has no data", where=where, got=f"{len(segments)} segments without rows",
            expected="a line of channel names and rows of numbers",
            next_step="repeat the recording, or leave the file out of the test", rule="no-data",
        )  # fmt: skip
    columns = _columns(filled[0], head.get("X_Columns", "One"), where)
    for table in filled[1:]:
        if _columns(table, head.get("X_Columns", "One"), where) != columns:
            raise RecordingError(
                "the segments of the LVM file have different channels",
                where=f"{where}, line {table.rows[0][0] - 1}",
                got=", ".join(table.names)[:300],
                expected=", ".join(filled[0].names)[:300],
                next_step="save each segment as a file of its own",
                rule="several-sheets",
            )
    rows = [row for filled_table in filled for row in filled_table.rows]
    vectors = [
        Vector(name=name, unit=unit, values=_values(rows, place, name, decimal, where))
        for place, name, unit in columns
    ]
    return one_table([Vectors(where=str(where), vectors=_one_time(vectors, where))], machine, where=where)


def _text(data: bytes) -> str:
    # The specification says ASCII; LabVIEW writes names and units in the system's own code page.
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("cp1252", "replace")


def _header(lines: list[str], where: object) -> tuple[dict[str, str], int, str]:
    end = next((number for number, line in enumerate(lines) if line.startswith(_END)), None)
    if end is None:
        truncated(where, "the LVM file ends within its header", f"{len(lines)} lines", _END)
    separator = "\t"
    for line in lines[:end]:
        if line.startswith("Separator"):
            mark = line.removeprefix("Separator")
            separator = mark[:1] or "\t"
            word = mark[1:].strip(mark[:1] + " ").casefold()
            if _SEPARATORS.get(word, separator) != separator or separator not in _SEPARATORS.values():
                raise UnreadableError(
                    "the LVM file has a separator that is not read", where=where, got=repr(mark),
                    expected="a tab, comma or semicolon",
                    next_step="save it again with tabs", rule="unreadable",
                )  # fmt: skip
    head = {}
    for line in lines[1:end]:
        name, _, value = line.partition(separator)
        # The decimal sign may be the separator itself: then nothing but its place tells it.
        head[name] = value if name == "Decimal_Separator" else value.partition(separator)[0].strip()
    return head, end + 1, separator


def _segments(lines: list[str], place: int, separator: str, multi: str, where: object) -> list[_Segment]:
    segments: list[_Segment] = []
    while (place := _skip(lines, place, separator, where)) < len(lines):
        fields = _split(lines[place], separator)
        if fields[0] == "Channels" or (not segments and _ahead(lines, place)):
            segment = _Segment({})
            while not lines[place].startswith(_END):
                fields = _split(lines[place], separator)
                segment.tags[fields[0]] = fields[1:]
                place += 1
                if place == len(lines):
                    truncated(where, "the LVM file ends within a segment's header", f"line {place}", _END)
            place += 1
            if place == len(lines):
                truncated(where, "the LVM file ends before a segment's names", f"line {place}", _X)
            segment.names = [name.strip() for name in _split(lines[place], separator)]
            segments.append(segment)
            place += 1
        elif not segments:
            segments.append(
                _Segment({}, [name.strip() for name in fields])
            )  # names without a segment's header
            place += 1
        else:
            segments[-1].rows.append((place + 1, fields))
            place += 1
    for member in segments:
        _check_rows(member, exact=multi.casefold() == "yes", where=where)
    return segments


def _ahead(lines: Sequence[str], place: int) -> bool:
    return any(line.startswith(_END) for line in lines[place : place + 40])


def _skip(lines: list[str], place: int, separator: str, where: object) -> int:
    while place < len(lines):
        if lines[place].startswith(_SPECIAL):
            begin = place
            while place < len(lines) and not lines[place].startswith(_SPECIAL_END):
                place += 1
            if place == len(lines):
                truncated(where, "a special block of the LVM file does not end", f"line {begin + 1}",
                          _SPECIAL_END)  # fmt: skip
        elif lines[place].strip(separator + " \t"):
            return place
        place += 1
    return place


def _check_rows(segment: _Segment, *, exact: bool, where: object) -> None:
    claims = [text.strip() for text in segment.tags.get("Samples", [])]
    longest = max((int(text) for text in claims if re.fullmatch("[0-9]{1,9}", text)), default=None)
    if longest is None:
        return
    if len(segment.rows) < longest:
        truncated(where, "the LVM file has fewer rows than it says", len(segment.rows), f"{longest} samples")
    if exact and len(segment.rows) > longest:
        damaged(where, "the LVM file has more rows than it says", len(segment.rows), f"{longest} samples")


def _columns(segment: _Segment, saved: str, where: object) -> list[tuple[int, str, str | None]]:
    """Return (place in the row, name, unit) of the channels of a segment."""
    columns: list[tuple[int, str, str | None]] = []
    channels = 0
    for place, name in enumerate(segment.names):
        # The tags of a channel stand in its column; one field, the tag's own name, was taken off.
        if name == _X:
            if saved.casefold() != "no":
                dimension = segment.tag("X_Dimension", place) or "Time"
                label = _label(segment.tag("X_Unit_Label", place))
                is_time = dimension.casefold() == "time"
                columns.append((place, "t" if is_time else dimension, label or ("s" if is_time else None)))
        elif name and name != _COMMENT:
            channels += 1
            columns.append((place, name, _label(segment.tag("Y_Unit_Label", place - 1))))
    count = segment.tag("Channels", 0)
    if count and count != str(channels):
        damaged(where, "the LVM file names more or fewer channels than it says", channels, count)
    return columns


def _label(text: str) -> str | None:
    return None if not text or text.casefold() == _UNNAMED_UNIT else text


def _values(
    rows: list[tuple[int, list[str]]], place: int, name: str, decimal: str, where: object
) -> np.ndarray:
    values = []
    for line, fields in rows:
        text = fields[place] if place < len(fields) else ""
        value = number_or_text(text, decimal)
        rule, reading = judge(value)
        if rule is not None:
            refuse_cell(rule, reading, str(where), line, place + 1, name)
        values.append(value)
    return np.array(values, dtype=np.float64)


def _one_time(vectors: list[Vector], where: object) -> list[Vector]:
    # With `X_Columns Multi` every channel brings its own; they must be the same to be one recording's rows.
    times = [vector for vector in vectors if vector.name == "t"]
    for time in times[1:]:
        if time.unit != times[0].unit or not np.array_equal(time.values, times[0].values):
            raise ColumnError(
                "the channels of the LVM file were not sampled together",
                where=where,
                got="columns of x values that differ",
                expected="one time for all channels",
                next_step="resample the channels to one time when they are saved",
                rule="doubled-column",
            )
    return [vector for vector in vectors if vector.name != "t" or vector is times[0]]


def _split(line: str, separator: str) -> list[str]:
    return line.split(separator)


def lvm_bytes(columns: Sequence[Written], title: str) -> bytes:
    """Return an LVM file of one segment; a time channel is its column of x values."""
    time = next((column for column in columns if column.symbol == "t"), None)
    channels = [column for column in columns if column is not time]
    rows, many = len(columns[0].values), len(channels)

    def line(*texts: str) -> str:
        return "\t".join(texts)

    head = [
        line("LabVIEW Measurement", ""),
        line("Writer_Version", "2"),
        line("Reader_Version", "2"),
        line("Separator", "Tab"),
        line("Decimal_Separator", "."),
        line("Multi_Headings", "Yes"),
        line("X_Columns", "No" if time is None else "One"),
        line("Description", " ".join(title.split())),
        line("***End_of_Header***", ""),
        "",
        line("Channels", str(many), *[""] * many),
        line("Samples", *[str(rows)] * many, ""),
        line("Y_Unit_Label", *[column.unit for column in channels], ""),
        line("X_Dimension", *["Time"] * many, ""),
        line("X_Unit_Label", *["s" if time is None else time.unit] * many, ""),
        line("***End_of_Header***", *[""] * (many + 1)),
        line("X_Value", *[column.name for column in channels], "Comment"),
    ]
    x = [""] * rows if time is None else [repr(float(v)) for v in time.values]
    body = [
        line(x[row], *[repr(float(column.values[row])) for column in channels], "") for row in range(rows)
    ]
    return ("\r\n".join([*head, *body]) + "\r\n").encode()
