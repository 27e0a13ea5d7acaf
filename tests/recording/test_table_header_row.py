"""The header row of a workbook, under a row of groups and beside a sheet of one title."""

from __future__ import annotations

import openpyxl
import pytest

from toolkit.calibration.session.cells import read_cells
from toolkit.errors import ToolkitError
from toolkit.machine import load_machine
from toolkit.recording.read import read_recording

HEADERS = ["SA [deg]", "FZ [N]", "D51 [lbf]", "D52 [lbf]", "E5 [lbf]", "FY [N]", "MZ [N*m]"]


def workbook(path, *, groups, titles=()):
    book = openpyxl.Workbook()
    sheet = book.active
    for number, text in enumerate(titles):
        cover = sheet if number == 0 else book.create_sheet()
        cover.title = f"Info{number}"
        cover["A1"] = text
        sheet = book.create_sheet("Daten")
    if groups:
        sheet.append(["Wheel", None, "Cells", None, None, "Loads", None])
        sheet.merge_cells("A1:B1")
        sheet.merge_cells("C1:E1")
        sheet.merge_cells("F1:G1")
    sheet.append(HEADERS)
    for row in range(30):
        sheet.append([0.5 + 1e-3 * row, 1000.0 + row % 3, 10.0 + row % 5, 11.0, -3.0, 80.0, 2.0])
    book.save(path)
    return path


@pytest.mark.parametrize("groups", [False, True])
@pytest.mark.parametrize("titles", [(), ("FZ [N] of belt 7",)])
def test_a_recording_is_read_under_groups_and_beside_a_title(tmp_path, groups, titles):
    path = workbook(tmp_path / "a.xlsx", groups=groups, titles=titles)
    recording = read_recording(path, load_machine("m15"))
    assert recording.rows == 30
    assert [series.header for series in recording.series] == HEADERS
    cells = read_cells(path.read_bytes(), lambda text: "[" in text, where=path, grouped=True)
    assert list(cells.header) == HEADERS
    assert len(cells.columns[0]) == 30


def test_a_row_of_units_below_the_header_is_still_told(tmp_path):
    path = workbook(tmp_path / "a.xlsx", groups=False)
    book = openpyxl.load_workbook(path)
    book.active.insert_rows(2)
    for column, text in enumerate(["deg", "N", "lbf", "lbf", "lbf", "N", "N*m"], start=1):
        book.active.cell(2, column, text)
    book.save(path)
    with pytest.raises(ToolkitError, match="row 2"):
        read_recording(path, load_machine("m15"))
