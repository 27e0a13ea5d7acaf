"""Rows that a workbook hides are told, wherever it is read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import openpyxl
import pytest
from openpyxl.worksheet.worksheet import Worksheet

from tests.calibration.calibration_factory import hub_data, write_session
from toolkit.calibration.fit.findings import session_findings
from toolkit.calibration.fit.session_fit import fit_session
from toolkit.calibration.session.read import read_session
from toolkit.recording.columns import rig
from toolkit.recording.hidden import hidden_findings, hidden_rows
from toolkit.recording.read import read_recording

Hide = Callable[[Worksheet], None]


def workbook(
    path: Path, rows: list[list[object]], hide: Callable[[openpyxl.worksheet.worksheet.Worksheet], None]
) -> None:
    book = openpyxl.Workbook()
    sheet = book.active
    assert sheet is not None
    for row in rows:
        sheet.append(row)
    hide(sheet)
    other = book.create_sheet("notes")
    other["A1"] = "press"
    other.row_dimensions[1].hidden = True
    book.save(path)


def hidden_at(*numbers: int) -> Hide:
    def hide(sheet: Worksheet) -> None:
        for number in numbers:
            sheet.row_dimensions[number].hidden = True

    return hide


@pytest.mark.parametrize(
    ("xml", "rows"),
    [
        (b'<row r="7" hidden="1">', (7,)),
        (b"<row hidden='true' r='7'/>", (7,)),
        (b'<x:row r="7" hidden = "1">', (7,)),
        (b'<row><c/></row><row hidden="1">', (2,)),
        (b'<row r="7" hidden="0">', ()),
        (b'<col min="1" max="2" hidden="1"/><row r="1">', ()),
    ],
)
def test_hidden_rows_are_found_as_programs_write_them(xml: bytes, rows: tuple[int, ...]) -> None:
    assert hidden_rows(xml) == rows


def test_a_recording_tells_hidden_rows_of_data(tmp_path: Path) -> None:
    """The header, rows below the data and rows of another worksheet hold no data."""
    rows = [["A [mV/V]", "B [mV/V]"], *([float(i), 2.0 * i] for i in range(1, 30))]
    path = tmp_path / "r.xlsx"
    workbook(path, rows, hidden_at(1, 5, 6, 40))
    recording = read_recording(path, rig("r", {"A": "mV/V", "B": "mV/V"}))
    assert recording.hidden == (5, 6)
    (told,) = hidden_findings(recording.hidden, path.name)
    assert told.message == "rows hidden in the workbook take part: 2, worksheet rows 5, 6"


def test_hidden_rows_of_a_session_and_of_its_check_loads_are_told(tmp_path: Path) -> None:
    path = write_session(tmp_path, hub_data(60, 1))
    for name, hidden in (("loads", (20, 21, 22)), ("check", (3,))):
        source = path.with_name(f"{name}.csv")
        lines = [line.split(",") for line in source.read_text().splitlines()]
        body = [[_cell(text) for text in line] for line in lines[1:]]
        workbook(path.with_name(f"{name}.xlsx"), [list(lines[0]), *body], hidden_at(*hidden))
    path.write_text(path.read_text().replace("loads.csv", "loads.xlsx").replace("check.csv", "check.xlsx"))
    told = [f for f in session_findings(fit_session(read_session(path))) if f.rule == "hidden-rows"]
    assert [finding.where for finding in told] == [path.name, f"{path.name}, check loads"]
    assert "3, worksheet rows 20, 21, 22" in told[0].message


def _cell(text: str) -> object:
    try:
        return float(text)
    except ValueError:
        return text
