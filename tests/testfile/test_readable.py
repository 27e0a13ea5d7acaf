"""The sheets of a workbook that people read: what they show, and that the others stand behind them."""

from __future__ import annotations

import math

import openpyxl
import pytest

from tests.report.report_factory import make_result
from toolkit.testfile import write_test_file
from toolkit.testfile.layout import SHEETS
from toolkit.testfile.readable import CONDITIONS, PAGE, RESULTS, in_unit


@pytest.fixture(scope="module")
def book(tmp_path_factory: pytest.TempPathFactory) -> openpyxl.Workbook:
    path = tmp_path_factory.mktemp("readable") / "test.xlsx"
    write_test_file(path, make_result(simulated=True))
    return openpyxl.load_workbook(path)


def test_people_come_first_and_provenance_last(book: openpyxl.Workbook) -> None:
    assert book.sheetnames[:4] == [PAGE, CONDITIONS, RESULTS, "findings"]
    assert book.sheetnames[-1] == "provenance"
    assert set(SHEETS) <= set(book.sheetnames)


def test_the_first_page_says_what_was_tested_and_how_it_is_marked(book: openpyxl.Workbook) -> None:
    page = {row[0]: row[1] for row in book[PAGE].iter_rows(max_col=2, values_only=True)}
    assert "Tire force and moment test 265/35 ZR 18" in page
    assert any(str(text).startswith("SIMULATED DATA") for text in page)
    assert page["tire"] == "265/35 ZR 18, Continental, Altimax, DOT 4MY8-009X-0713"
    assert page["inflation pressure"] == pytest.approx(234.4, abs=0.05)  # 34 psi = 234.4 kPa
    assert page["rated load"] == 4900.0


def test_conditions_are_in_degrees_and_their_cells_show_the_unit(book: openpyxl.Workbook) -> None:
    sheet, condition = book[CONDITIONS], make_result().reduced.conditions[0]
    head = [cell.value for cell in sheet[1]]
    angle, force = sheet.cell(2, head.index("slip angle") + 1), sheet.cell(2, head.index("FY") + 1)
    assert angle.value == pytest.approx(math.degrees(condition.SA), rel=1e-15)
    assert angle.number_format == '#,##0.00" °"'
    assert force.value == condition.FY
    assert force.number_format == '#,##0.0" N"'


@pytest.mark.parametrize("name", [CONDITIONS, RESULTS, "findings", "reduced", "provenance"])
def test_every_table_has_a_frozen_head_and_a_filter_over_all_its_rows(
    name: str, book: openpyxl.Workbook
) -> None:
    sheet = book[name]
    assert sheet.freeze_panes == "A2"
    assert sheet.auto_filter.ref == sheet.dimensions
    assert all(cell.font.b for cell in sheet[1] if cell.value is not None)


def test_a_number_that_is_none_leaves_its_cell_empty() -> None:
    assert in_unit(math.inf, "N", 1).value is None
    assert in_unit(1.5, "N*m/deg", 2).number_format == '#,##0.00" N·m/°"'
