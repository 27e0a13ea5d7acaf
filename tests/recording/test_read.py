"""Reading a recording: whole or not at all, every bad cell named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.recording.format_checks import whole
from tests.recording.workbook_factory import (
    DATA,
    HEADERS,
    members,
    packed,
    sheet_xml,
    table_xml,
    with_cell,
    workbook,
)
from toolkit.errors import CellError, ColumnError, RecordingError, ToolkitError, UnreadableError
from toolkit.machine import load_machine
from toolkit.recording import read_recording
from toolkit.recording.read import cross_check
from toolkit.recording.safe_open import gate
from toolkit.recording.table import Table

M15 = load_machine("m15")
CSV = ",".join(HEADERS) + "\n" + "\n".join(",".join(map(str, row)) for row in DATA) + "\n"


@pytest.fixture
def read(tmp_path):
    def made(data: bytes, machine=M15, reader="both"):
        path = tmp_path / "recording"
        path.write_bytes(data)
        return read_recording(path, machine, reader=reader)

    return made


def refused(read, data, kind: type[ToolkitError], rule: str, reader="calamine") -> ToolkitError:
    with pytest.raises(kind) as caught:
        read(data, reader=reader)
    return whole(caught.value, rule)


def check(recording) -> None:
    assert recording.rows == len(DATA)
    for index, header in enumerate(HEADERS):
        one = next(s for s in recording.series if s.header == header)
        np.testing.assert_array_equal(one.values, [row[index] for row in DATA])
        assert not one.values.flags.writeable


def test_a_workbook(read):
    recording = read(workbook())
    check(recording)
    assert recording.format == "xlsx"
    assert not recording.simulated
    assert len(recording.sha256) == 64
    assert recording["FZ"].si[0] == pytest.approx(248.8146 * 4.4482216152605, rel=1e-12)


def test_columns_in_another_order(read):
    recording = read(workbook([row[::-1] for row in [HEADERS, *DATA]]))
    check(recording)


@pytest.mark.parametrize("dimension", ["A1", "A1:B2", "A1:G4", "C3:D3", "A1:XFD1048576"])
def test_a_wrong_dimension_is_not_believed(read, dimension):
    check(read(workbook(dimension=dimension)))


def test_leading_and_trailing_blanks(read):
    table = table_xml([HEADERS, *DATA], first=4)
    table = table.replace("</sheetData>", '<row r="8"><c r="A8"/></row><row r="9"/></sheetData>')
    check(read(packed(members({"Sheet1": table}))))
    shifted = [[None, *row] for row in [HEADERS, *DATA]]
    check(read(workbook(shifted)))


def test_a_formula_counts_by_its_cached_value(read):
    recording = read(with_cell(1, 0, '<c r="@"><f>200+48.8146</f><v>248.8146</v></c>'))
    check(recording)
    refused(read, with_cell(1, 0, '<c r="@"><f>200+48.8146</f></c>'), CellError, "empty-cell")


BAD = {
    "text": ("abc", "text-cell", "abc"),
    "number as text": ("12.3", "text-cell", "12.3"),
    "number as formula text": ('<c r="@" t="str"><f>"1"</f><v>12.3</v></c>', "text-cell", "12.3"),
    "decimal comma": ('<c r="@"><v>1,5</v></c>', "text-cell", "1,5"),
    "blanks": ('<c r="@" t="str"><v xml:space="preserve">  </v></c>', "text-cell", "  "),
    "division by zero": ('<c r="@" t="e"><v>#DIV/0!</v></c>', "error-cell", "#DIV/0!"),
    "not available": ('<c r="@" t="e"><f>NA()</f><v>#N/A</v></c>', "error-cell", "#N/A"),
    "an unknown error": ('<c r="@" t="e"><v>#SPILL!</v></c>', "error-cell", "#SPILL!"),
    "boolean": ('<c r="@" t="b"><v>1</v></c>', "boolean-cell", "TRUE"),
    "date": ('<c r="@" t="d"><v>2020-01-01</v></c>', "date-cell", "2020-01-01"),
    "nothing": (None, "empty-cell", "empty"),
    "empty cell": ('<c r="@"/>', "empty-cell", "empty"),
    "NaN": ('<c r="@"><v>NaN</v></c>', "nan-cell", "nan"),
    "infinite": ('<c r="@"><v>1e999</v></c>', "nan-cell", "inf"),
}


@pytest.mark.parametrize(("cell", "rule", "got"), BAD.values(), ids=BAD.keys())
@pytest.mark.parametrize("row", [1, 3])
def test_a_bad_cell_is_named(read, cell, rule, got, row):
    error = refused(read, with_cell(row, 3, cell), CellError, rule)
    assert got in error.got
    assert f"D{row + 1}" in error.where
    if got != "#SPILL!":  # the reader itself gives up there, before the header is known
        assert "sheet 'Sheet1'" in error.where
        assert f"row {row + 1}" in error.where
        assert "E5 (Filtered)" in error.where


def test_a_last_row_of_error_values_is_not_taken_for_the_end(read):
    row = ['<c r="@" t="e"><v>#N/A</v></c>'] * 7
    error = refused(read, workbook([HEADERS, *DATA, row]), CellError, "error-cell")
    assert "row 5" in error.where


def test_an_empty_row_between_rows_of_data(read):
    error = refused(read, workbook([HEADERS, DATA[0], [], DATA[1]]), CellError, "empty-cell")
    assert "row 3" in error.where


def test_no_data(read):
    refused(read, workbook([]), UnreadableError, "no-data")
    refused(read, workbook([HEADERS]), UnreadableError, "no-data")
    refused(read, workbook([HEADERS, [None] * 7]), UnreadableError, "no-data")
    refused(read, packed(members({"A": sheet_xml([])})), UnreadableError, "no-data")


def test_headers(read):
    refused(read, workbook([HEADERS[1:], *(row[1:] for row in DATA)]), ColumnError, "missing-column")
    refused(read, workbook([[*HEADERS, "Fy"], *([*row, 1.0] for row in DATA)]), ColumnError, "doubled-column")
    refused(read, workbook([[*HEADERS, "Temp"], *([*row, 1.0] for row in DATA)]), ColumnError, "unknown-unit")
    refused(read, workbook([HEADERS, *([*row, 1.0] for row in DATA)]), ColumnError, "unknown-column")
    refused(read, workbook(DATA), ColumnError, "missing-column")
    assert "Sheet1" in refused(read, workbook(DATA), ColumnError, "missing-column").where
    extra = read(workbook([[*HEADERS, "Temp [degC]"], *([*row, 20.0] for row in DATA)]))
    assert extra["Temp"].si[0] == pytest.approx(293.15)


def test_sheets(read):
    good, notes = table_xml([HEADERS, *DATA]), table_xml([["Notes"], ["a long day"]])
    other = table_xml([HEADERS, *DATA[:1]])
    check(read(packed(members({"Notes": notes, "Sheet1": good, "Empty": sheet_xml([])}))))
    check(read(packed(members({"Sheet1": good, "Old": other}, hidden=["Old"]))))
    check(read(packed(members({"Old": other, "Sheet1": good}, hidden=["Old"]))))
    refused(read, packed(members({"A": good}, hidden=["A"])), UnreadableError, "no-data")
    refused(read, packed(members({"A": good, "B": other})), RecordingError, "several-sheets")


def test_an_error_value_in_a_hidden_sheet_does_not_matter(read):
    bad = table_xml([['<c r="@" t="e"><v>#N/A</v></c>']])
    check(read(packed(members({"Sheet1": table_xml([HEADERS, *DATA]), "Old": bad}, hidden=["Old"]))))


def test_marks_in_the_properties(read):
    def marked(words):
        return packed(members(keywords=words))

    assert read(marked("toolkit-recording; machine=m15; simulated")).simulated
    assert not read(marked("toolkit-recording; machine=m15")).simulated
    assert not read(marked("something else")).simulated
    refused(read, marked("toolkit-output"), UnreadableError, "own-output")
    refused(read, marked("toolkit-recording; machine=m15-virtual"), RecordingError, "other-machine")
    assert read(workbook(), machine=load_machine("m15-virtual")).simulated


def test_marks_outlive_a_program_that_sets_keywords_apart_by_blanks(read):
    """LibreOffice Calc 7.4 saves the keywords ``a; b`` as ``a b``."""

    def marked(words):
        return packed(members(keywords=words))

    assert read(marked("toolkit-recording machine=m15 simulated")).simulated
    refused(read, marked("toolkit-output simulated"), UnreadableError, "own-output")
    refused(read, marked("toolkit-recording machine=m15-virtual simulated"), RecordingError, "other-machine")


def test_csv(read):
    for text in (CSV, CSV.replace(",", ";"), "\ufeff" + CSV, CSV.replace("\n", "\r\n"), "\n" + CSV + "\n\n"):
        recording = read(text.encode())
        check(recording)
        assert recording.format == "csv"
    quoted = CSV.replace("FZ load", '"fz  LOAD [lbf]"').encode()
    assert read(quoted)["FZ"].unit == "lbf"


@pytest.mark.parametrize(
    ("old", "new", "kind", "rule"),
    [
        ("248.8146", "abc", CellError, "text-cell"),
        ("248.8146", "", CellError, "empty-cell"),
        ("248.8146", "NaN", CellError, "nan-cell"),
        ("248.8146", "-inf", CellError, "nan-cell"),
        ("248.8146", "1_000", CellError, "text-cell"),
        ("248.8146", "#DIV/0!", CellError, "error-cell"),
        ("248.8146", "٣", CellError, "text-cell"),
        ("248.8146", "1e9999", CellError, "nan-cell"),
        (",-0.35393", "", CellError, "empty-cell"),
        ("-0.35393", "-0.35393,7", ColumnError, "unknown-column"),
        ("248.8146", '"', UnreadableError, "unreadable"),
        ("FZ load", "FZ", ColumnError, "unknown-unit"),
        ("FZ load,", "", ColumnError, "missing-column"),
        ("Fy", "Mz", ColumnError, "doubled-column"),
        ("FZ load", "FZ \x81", UnreadableError, "encoding"),  # a byte that Windows-1252 has no letter for
        ("FZ load", "FZ \xe9 load", ColumnError, "unknown-unit"),
    ],
)
def test_bad_csv(read, old, new, kind, rule):
    data = CSV.replace(old, new, 1)
    refused(read, data.encode("latin-1" if rule == "encoding" else "utf-8"), kind, rule)


def test_other_text(read):
    refused(read, b"dear reader, this is a letter", UnreadableError, "not-a-workbook")
    refused(read, ",".join(HEADERS).encode(), UnreadableError, "no-data")


def test_the_second_reader_disagrees(tmp_path, read):
    # Two values in one cell: the readers take different ones.
    data = with_cell(1, 0, '<c r="@"><v>1</v><v>2</v></c>')
    assert "A2" in refused(read, data, CellError, "readers-differ", reader="both").where
    path = tmp_path / "good"
    path.write_bytes(workbook())
    table = Table(where="here", rows=[list(HEADERS), *map(list, DATA)])
    cross_check(gate(path), "Sheet1", table)
    table.rows[2][4] = -0.30198
    with pytest.raises(CellError, match="E3") as caught:
        cross_check(gate(path), "Sheet1", table)
    assert caught.value.rule == "readers-differ"


@pytest.mark.parametrize("number", ["1.7e308", "-1.1e100"])
def test_a_number_that_cannot_be_measured_is_refused(tmp_path: Path, number: str) -> None:
    path = tmp_path / "run.csv"
    rows = [",".join(map(str, row)) for row in DATA]
    path.write_text("\n".join([",".join(HEADERS), number + rows[0][rows[0].index(",") :], *rows[1:]]))
    with pytest.raises(CellError, match="data row 1") as caught:
        read_recording(path, load_machine("m15"))
    assert (caught.value.rule, caught.value.got) == ("nan-cell", str(float(number)))
