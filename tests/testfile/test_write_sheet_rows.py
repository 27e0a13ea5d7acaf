"""Rows that are written straight into a sheet are those that openpyxl writes and reads."""

from __future__ import annotations

import io
import re
import zipfile

import numpy as np
import openpyxl
import pytest
from hypothesis import given
from hypothesis import strategies as st

from toolkit.testfile.write import filled, sheet_row

TEXTS = st.text(
    st.characters(min_codepoint=32, max_codepoint=0xFFFD, exclude_categories=("Cs",)), max_size=20
)
VALUES = (
    st.none()
    | st.booleans()
    | st.integers(-(10**15), 10**15)
    | st.floats(allow_nan=False, allow_infinity=False)
)


def book(*heads: list[str]) -> bytes:
    workbook = openpyxl.Workbook(write_only=True)
    for head in heads:
        workbook.create_sheet().append(head)
    stream = io.BytesIO()
    workbook.save(stream)
    return stream.getvalue()


def read(content: bytes) -> list[list[tuple[object, ...]]]:
    workbook = openpyxl.load_workbook(io.BytesIO(content))
    return [list(sheet.iter_rows(values_only=True)) for sheet in workbook.worksheets]


def written(*rows: list[object]) -> list[tuple[object, ...]]:
    body = io.BytesIO()
    body.writelines(sheet_row(number, row) for number, row in enumerate(rows, start=2))
    ((_, *below),) = read(filled(book([f"c{i}" for i in range(len(rows[0]))]), {"sheet1.xml": body}))
    return below


@given(st.lists(VALUES | TEXTS, min_size=3, max_size=3))
def test_values_are_read_as_they_were_given(row: list[object]) -> None:
    (back,) = written(["begins", *row])
    assert back == ("begins", *(None if value == "" else value for value in row))


@pytest.mark.parametrize(
    "number", [0.1, 1 / 3, 5e-324, -1.7976931348623157e308, np.float64(2) / 3, -0.0, 1e22]
)
def test_a_number_has_the_digits_that_read_back_as_it_is(number: float) -> None:
    text = sheet_row(1, [number]).decode()
    digits = text.partition("<v>")[2].partition("<")[0]
    assert float(digits) == number
    assert len(re.sub(r"e.*|\D", "", digits).lstrip("0")) <= 17


@pytest.mark.parametrize("text", ["=1+1", "#N/A", " kept ", "<&>", "a\rb\nc\td", "ёж 🛞", "12"])
def test_a_text_stays_a_text(text: str) -> None:
    assert written([text]) == [(text,)]


def test_a_row_is_the_bytes_of_openpyxl() -> None:
    row = ["a & b", 1.5, 3, None, True, "", " x", 1e-7]
    with zipfile.ZipFile(io.BytesIO(book(row))) as archive:
        theirs = archive.read("xl/worksheets/sheet1.xml")
    assert sheet_row(1, row) in theirs


@pytest.mark.parametrize("text", ["\x00", "a\x1fb", "\x0b"])
def test_a_control_character_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="control character"):
        sheet_row(1, [text])


def test_other_sheets_stay_as_they_are() -> None:
    body = io.BytesIO()
    body.write(sheet_row(2, [4.0]))
    shell = book(["a"], ["b"], ["c"])
    assert read(filled(shell, {"sheet2.xml": body})) == [[("a",)], [("b",), (4,)], [("c",)]]
