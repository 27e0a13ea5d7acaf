"""A grid of numbers is what a parser reads, or there is none."""

from __future__ import annotations

import io
import math
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.recording.workbook_factory import (
    DATA,
    HEADERS,
    MAIN,
    PROLOG,
    SHEET,
    members,
    packed,
    row_xml,
    sheet_xml,
    table_xml,
)
from toolkit.errors import ToolkitError
from toolkit.machine import load_machine
from toolkit.recording import read_recording
from toolkit.recording.cells import _parse, find_cells
from toolkit.recording.columns import header_of
from toolkit.recording.grid import find_grid
from toolkit.recording.safe_open import gate
from toolkit.recording.table import read_table
from toolkit.recording.xlsx import read_sheet

M15 = load_machine("m15")
GOOD = table_xml([HEADERS, *DATA])
quick = settings(
    max_examples=80,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)


def both_ways(path, xml: str, **parts: bytes) -> tuple[object, object]:
    """What is read with and without grids: the columns, or the words of the refusal."""
    path.write_bytes(packed({**members(), SHEET: xml.encode(), **parts}))
    told = []
    for grids in (True, False):
        try:
            name, table = read_sheet(gate(path), header_of(M15), grids=grids)
            told.append((name, [(one, one.values.tobytes()) for one in read_table(table, M15)]))
        except ToolkitError as error:
            told.append(error.as_dict())
    for one in told:
        if isinstance(one, tuple):  # series compare by identity of their arrays
            one[1][:] = [(s.symbol, s.header, s.unit, s.role, raw) for s, raw in one[1]]
    return told[0], told[1]


def parsed(xml: bytes) -> list[list[float]]:
    """The numbers below the first row by the standard library's parser, for sheets that have every cell."""
    rows = ET.parse(io.BytesIO(xml)).getroot().iter(f"{{{MAIN}}}row")  # noqa: S314
    return [[float(v.text or "") for v in row.iter(f"{{{MAIN}}}v")] for row in list(rows)[1:]]


def test_a_plain_sheet_has_a_grid_and_it_holds_what_a_parser_reads():
    xml = GOOD.encode()
    grid = find_grid(xml)
    assert grid.first_row == 2
    np.testing.assert_array_equal(grid.numbers(xml), DATA)
    assert grid.without_rows(xml) == sheet_xml([row_xml(1, HEADERS)]).encode()


def test_rows_of_excel_and_cells_of_openpyxl_have_one_too():
    excel = re.sub(r'<row r="(\d+)">', r'<row r="\1" spans="1:7" x14ac:dyDescent="0.25">', GOOD).encode()
    typed = re.sub(r'"><v>', '" t="n"><v>', GOOD).encode()
    for xml in (excel, typed, GOOD.replace(PROLOG, "").encode(), b"\xef\xbb\xbf" + GOOD.encode()):
        np.testing.assert_array_equal(find_grid(xml).numbers(xml), DATA)


@pytest.mark.parametrize("first", [1, 7, 8, 96, 997, 99_990, 1_048_560])
@pytest.mark.parametrize("columns", [1, 7, 26])
def test_row_numbers_that_grow_by_a_digit_and_any_width(first, columns):
    table = np.round(np.random.default_rng(first).normal(0, 300, (13, columns)), 5)
    xml = table_xml([["x"] * columns, *table.tolist()], first=first).encode()
    grid = find_grid(xml)
    assert grid.first_row == first + 1
    np.testing.assert_array_equal(grid.numbers(xml), parsed(xml))
    fast, full = find_cells(xml, grid), _parse(xml)
    np.testing.assert_array_equal(fast.rows, full.rows)
    np.testing.assert_array_equal(fast.columns, full.columns)


def numbers_of(texts: list[str]) -> np.ndarray | None:
    rows = [
        row_xml(1, ["x"]),
        *(f'<row r="{i}"><c r="A{i}"><v>{t}</v></c></row>' for i, t in enumerate(texts, 2)),
    ]
    xml = sheet_xml(rows).encode()
    return find_grid(xml).numbers(xml)


@quick
@given(
    st.lists(
        st.floats(allow_nan=False, allow_infinity=False).map(repr)
        | st.decimals(allow_nan=False, allow_infinity=False, places=5).map(lambda d: f"{d:f}")
        | st.from_regex(r"-?[0-9]{1,12}(\.[0-9]{1,12})?", fullmatch=True)
        | st.from_regex(r"-?[0-9]{1,3}(\.[0-9]{1,4})?[eE][+-]?[0-9]{1,2}", fullmatch=True)
        | st.sampled_from(
            ["0", "-0", "-0.0", "000.5", "9007199254740993", "0.1", "999999999999999", "5e-324"]
        ),
        min_size=1,
        max_size=30,
    )
)
def test_every_number_is_the_nearest_double(texts):
    found = numbers_of(texts).ravel().tolist()
    assert [v.hex() for v in found] == [float(t).hex() for t in texts]


@pytest.mark.parametrize(
    "text",
    ["+1", "1,5", "NaN", "inf", "1_0", " 1", "1 ", "--1", "1-", "1.2.3", "-", ".", "1e", "1e9999",
     "0x1", "٣", "1e999", "9" * 400, "1&#49;", "-1e-"],
)  # fmt: skip
def test_no_plain_number_is_left_to_the_parser(text):
    assert numbers_of(["1.5", text]) is None


OTHER = {
    "a comment": ("</row><row", "</row><!-- --><row"),
    "a comment that ends behind": ('<row r="2">', '<!-- <row r="2">'),
    "character data": ("<v>86.06072</v>", "<v><![CDATA[86.06072]]></v>"),
    "an instruction": ("<sheetData>", "<?x </row> ?><sheetData>"),
    "a second list of rows": ("</sheetData>", "</sheetData><sheetData/>"),
    "blanks between cells": ("</c><c", "</c> <c"),
    "a line a row": ("</row><row", "</row>\n<row"),
    "single quotes": ('r="A2"', "r='A2'"),
    "attributes in another order": ('<c r="B2">', '<c t="n" r="B2">'),
    "a style": ('<c r="B2">', '<c r="B2" s="1">'),
    "a type in one cell": ('<c r="B2">', '<c r="B2" t="n">'),
    "a text": ('<c r="B2">', '<c r="B2" t="s">'),
    "a boolean": ('<c r="B2">', '<c r="B2" t="b">'),
    "an error": ('<c r="B2"><v>86.06072', '<c r="B2" t="e"><v>#N/A'),
    "a date": ('<c r="B2"><v>86.06072', '<c r="B2" t="d"><v>2020-01-01'),
    "a formula": ('<c r="B2"><v>', '<c r="B2"><f>1+1</f><v>'),
    "an inline text": ('<c r="B2"><v>86.06072</v>', '<c r="B2" t="inlineStr"><is><t>86.06072</t></is>'),
    "no cell": ('<c r="B2"><v>86.06072</v></c>', ""),
    "an empty cell": ('<c r="B2"><v>86.06072</v></c>', '<c r="B2"/>'),
    "an empty value": ("<v>86.06072</v>", "<v></v>"),
    "two values": ("<v>86.06072</v>", "<v>86.06072</v><v>1</v>"),
    "a prefix": ('<c r="B2"><v>86.06072</v></c>', f'<x:c xmlns:x="{MAIN}" r="B2"><x:v>1</x:v></x:c>'),
    "no reference": ('<c r="B2">', "<c>"),
    "a lower case": ('r="B2"', 'r="b2"'),
    "a doubled cell": ('r="B2"', 'r="A2"'),
    "cells out of order": ('r="B3"', 'r="C3"'),
    "a cell of another row": ('r="B3"', 'r="B4"'),
    "a row out of order": ('<row r="3">', '<row r="4">'),
    "a row without number": ('<row r="3">', "<row>"),
    "a row with two numbers": ('<row r="3">', '<row r="3" r="5">'),
    "a row with an attribute twice": ('<row r="3">', '<row r="3" s="1" s="2">'),
    "a row with an entity": ('<row r="3">', '<row r="3" spans="&lt;">'),
    "a gap of a row": ('<row r="4"><c r="A4">', '<row r="5"><c r="A5">'),
    "a number with a zero before": ('r="A2"', 'r="A02"'),
    "a blank in a tag": ("<v>86.06072</v>", "<v >86.06072</v>"),
    "a blank in an end": ("</v>", "</v >"),
    "an element of its own": ("<v>86.06072</v></c>", "<v>86.06072</v></c><k/>"),
    "text between": ("</c><c", "</c>7<c"),
    "an end in capitals": ("</v>", "</V>"),
    "a list that is not closed": ("</sheetData>", ""),
    "an end that is missing": ("</c></row></sheetData>", "</row></sheetData>"),
}


@pytest.mark.parametrize(("old", "new"), OTHER.values(), ids=OTHER.keys())
def test_whatever_departs_from_the_pattern_has_no_grid_and_one_answer(tmp_path, old, new):
    at = max(GOOD.find(old, GOOD.index('<row r="2">')), GOOD.find(old))  # in the rows of numbers, if there
    xml = GOOD[:at] + GOOD[at:].replace(old, new, 1)
    assert xml != GOOD
    assert find_grid(xml.encode()) is None
    fast, whole = both_ways(tmp_path / "f", xml)
    assert fast == whole


HEADS = {
    "columns without a header": table_xml([[*HEADERS, None], *([*row, 1.0] for row in DATA)]),
    "a blank header": table_xml([[*HEADERS, "  "], *([*row, 1.0] for row in DATA)]),
    "a header of its own": table_xml([[*HEADERS, "T [degC]"], *([*row, 1.0] for row in DATA)]),
    "more headers": table_xml([[*HEADERS, "T [degC]"], *DATA]),
    "fewer headers": table_xml([HEADERS[:-1], *DATA]),
    "a header twice": table_xml([[*HEADERS[:-1], "Fy"], *DATA]),
    "no header": table_xml(DATA),
    "an empty first row": sheet_xml(
        ['<row r="1"/>', *(row_xml(i, r) for i, r in enumerate([HEADERS, *DATA], 2))]
    ),
    "nothing in the first row": table_xml([[None] * 7, *DATA]),
    "blanks before": table_xml([HEADERS, *DATA], first=5),
    "a gap below the header": sheet_xml(
        [row_xml(1, HEADERS), *(row_xml(i, r) for i, r in enumerate(DATA, 3))]
    ),
    "a header below its numbers": sheet_xml(
        [row_xml(9, HEADERS), *(row_xml(i, r) for i, r in enumerate(DATA, 2))]
    ),
    "a header in the numbers' row": sheet_xml(
        [row_xml(2, HEADERS), *(row_xml(i, r) for i, r in enumerate(DATA, 2))]
    ),
    "an error value for a header": table_xml([['<c r="@" t="e"><v>#N/A</v></c>', *HEADERS[1:]], *DATA]),
    "a wrong dimension": table_xml([HEADERS, *DATA], dimension="A1:B2"),
    "a far dimension": table_xml([HEADERS, *DATA], dimension="A1:XFD1048576"),
    "an end that is no worksheet": GOOD.replace("</worksheet>", ""),
    "a blank in the end of the header's row": GOOD.replace("</row>", "</row >", 1),
    "an end of the header's row that is none": GOOD.replace("</row>", "/row>", 1),
    "numbers in an unusual row above": GOOD.replace('<c r="B2">', '<c r="B2" s="0">').replace(
        "</row>", "</row >", 1
    ),
    "a header in character data": GOOD.replace("FZ load", "<![CDATA[FZ load]]>"),
    "a header with an entity": GOOD.replace("FZ load", "FZ &#108;oad"),
    "a header of two words in bold": GOOD.replace("<t>FZ load</t>", "<r><t>FZ </t></r><r><t>load</t></r>"),
}


@pytest.mark.parametrize("xml", HEADS.values(), ids=HEADS.keys())
def test_whatever_stands_above_a_grid_has_one_answer(tmp_path, xml):
    fast, whole = both_ways(tmp_path / "f", xml)
    assert fast == whole


def test_shared_texts_above_a_grid(tmp_path):
    texts = "".join(f"<si><t>{text}</t></si>" for text in HEADERS)
    link = (
        '<Relationship Id="rId8" Type="http://schemas.openxmlformats.org/officeDocument/2006/relationships/'
        'sharedStrings" Target="sharedStrings.xml"/></Relationships>'
    )
    head = [f'<c r="@" t="s"><v>{i}</v></c>' for i in range(len(HEADERS))]
    links = members()["xl/_rels/workbook.xml.rels"].replace(b"</Relationships>", link.encode())
    parts = {
        "xl/_rels/workbook.xml.rels": links,
        "xl/sharedStrings.xml": f'<sst xmlns="{MAIN}">{texts}</sst>'.encode(),
    }
    xml = table_xml([head, *DATA])
    fast, whole = both_ways(tmp_path / "f", xml, **parts)
    assert fast == whole
    assert [one[1] for one in fast[1]] == list(HEADERS)


@pytest.mark.parametrize(
    "text", ["1.", ".5", "-.5", "+1", "1e5", "1E-5", "-0", "1e999", "007", "1 ", "1_0", "nan"]
)
def test_any_way_to_write_a_number_has_one_answer(tmp_path, text):
    fast, whole = both_ways(tmp_path / "f", GOOD.replace("86.06072", text))
    assert fast == whole


def sheets(*names: str) -> dict[str, str]:
    made = {"Sheet1": GOOD, "Empty": sheet_xml([]), "Notes": table_xml([["Notes"], ["a long day"]])}
    made["Other"] = table_xml([HEADERS, *DATA[:1]])
    return {name: made[name] for name in names}


@pytest.mark.parametrize(
    ("names", "hidden", "grid"),
    [
        (("Sheet1", "Empty"), (), True),
        (("Empty", "Sheet1"), (), True),
        (("Sheet1", "Notes"), (), False),
        (("Sheet1", "Other"), (), False),
        (("Sheet1", "Other"), ("Other",), False),
        (("Sheet1", "Empty"), ("Sheet1",), False),
    ],
)
def test_several_sheets_have_one_answer(tmp_path, names, hidden, grid):
    path = tmp_path / "f"
    path.write_bytes(packed(members(sheets(*names), hidden=hidden)))
    told = []
    for grids in (True, False):
        try:
            name, table = read_sheet(gate(path), header_of(M15), grids=grids)
            told.append((name, table.in_rows().rows))
            assert (table.numbers is not None) == (grid and grids)
        except ToolkitError as error:
            told.append(error.as_dict())
    assert told[0] == told[1]


def test_a_part_that_no_sheet_names_is_not_read(tmp_path):
    # The workbook's one sheet is empty; a grid lies beside it that belongs to none.
    path = tmp_path / "f"
    parts = members({"Sheet1": sheet_xml([])})
    path.write_bytes(packed({**parts, "xl/worksheets/sheet2.xml": GOOD.encode()}))
    with pytest.raises(ToolkitError) as caught:
        read_recording(path, M15)
    assert caught.value.rule == "no-data"


SNIPPETS = (
    '<c r="A2"><v>1</v></c>', '<row r="5">', "</row>", "</c>", "<v>", "</v>", '"', " ", "\n", "1", "-", ".",
    "<!--", "-->", "<![CDATA[", "]]>", "<?x?>", "&#49;", "&a;", ' t="n"', ' s="1"', "<sheetData>", "e5",
    "</sheetData>", "<row>", "<row/>", "<c/>", "x:", "B3", "A2", ">", "<", "'", "\u00e9",
)  # fmt: skip


@quick
@given(st.data())
def test_any_small_change_of_the_sheet_has_one_answer(tmp_path, data):
    xml = GOOD
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(xml.find("<sheetData>"), len(xml)))
        gone = data.draw(st.sampled_from([0, 0, 1, 2, 4, 8, 30]))
        xml = xml[:at] + data.draw(st.sampled_from(["", *SNIPPETS])) + xml[at + gone :]
    fast, whole = both_ways(tmp_path / "f", xml)
    assert fast == whole


@pytest.mark.campaign("drawn tables: tables of every kind have one answer in every run")
@settings(quick, max_examples=200)
@given(
    table=st.lists(
        st.lists(st.floats(-1e6, 1e6) | st.integers(-9, 9), min_size=7, max_size=7), min_size=1, max_size=8
    ),
    tag=st.sampled_from(
        ["", ' spans="1:7"', ' ht="15" customHeight="1"', ' spans="&#49;:7"', " spans='1:7'"]
    ),
    cell=st.sampled_from(["", ' t="n"', ' s="0"']),
    first=st.integers(1, 12),
)
def test_any_table_has_one_answer(tmp_path, table, tag, cell, first):
    xml = table_xml([HEADERS, *table], first=first)
    xml = re.sub(r'(<row r="\d+")', rf"\g<1>{tag}", xml).replace('"><v>', f'"{cell}><v>')
    fast, whole = both_ways(tmp_path / "f", xml)
    assert fast == whole
    assert len(fast[1]) == len(HEADERS)
    values = np.frombuffer(b"".join(one[-1] for one in fast[1])).reshape(7, -1).T
    assert all(math.isfinite(v) for v in values.ravel())
    np.testing.assert_array_equal(values, np.array(table, dtype=float))
