"""The tags as a Word file: every tag of a kind, with what it prints, in tables that read over pages."""

from __future__ import annotations

import datetime as dt
import io
import re

import docx
import pytest

from toolkit.report.kinds import VOCABULARIES
from toolkit.report.style import Style
from toolkit.report.word.tag_sheet import tag_sheet

DAY = dt.date(2026, 11, 23)


@pytest.mark.parametrize("kind", list(VOCABULARIES))
def test_every_tag_of_a_kind_stands_in_it_under_its_purpose(kind: str) -> None:
    vocabulary = VOCABULARIES[kind]
    sheet = docx.Document(io.BytesIO(tag_sheet(vocabulary, Style(), title=kind, values={}, day=DAY)))
    text = "\n".join(
        [
            *(p.text for p in sheet.paragraphs),
            *(c.text for t in sheet.tables for r in t.rows for c in r.cells),
        ]
    )
    tags = set(re.findall(r"tk:([^}|\s]+)", text))
    assert tags >= {entry.path for entry in vocabulary.entries if entry.kind != "if"}
    assert tags >= {f"if.{name}" for name in vocabulary.conditions}
    headings = {p.text for p in sheet.paragraphs if p.style is not None and p.style.name == "Heading 1"}
    assert headings >= {entry.path.partition(".")[0] for entry in vocabulary.values}


def test_a_value_of_a_test_is_its_example_and_numbers_are_in_the_form_of_the_style() -> None:
    style = Style(decimal_comma=True, dates="%d.%m.%Y")
    sheet = docx.Document(
        io.BytesIO(
            tag_sheet(VOCABULARIES["report"], style, title="x", values={"tk:tire.size": "205/55R16"}, day=DAY)
        )
    )
    shown = {row.cells[0].text: row.cells[2].text for table in sheet.tables for row in table.rows}
    assert shown["{{tk:tire.size}}"] == "205/55R16"
    assert shown["{{tk:test.speed}}"] == "1234,57"
    assert shown["{{tk:test.date}}"] == "17.03.2026"
    assert sheet.core_properties.created == dt.datetime(2026, 11, 23, tzinfo=dt.UTC)


def test_heads_are_repeated_and_rows_stay_whole() -> None:
    sheet = docx.Document(
        io.BytesIO(tag_sheet(VOCABULARIES["audit"], Style(), title="x", values={}, day=DAY))
    )
    for table in sheet.tables:
        properties = [[child.tag.rpartition("}")[2] for child in row._tr.trPr] for row in table.rows]
        assert properties[0] == ["cantSplit", "tblHeader"]
        assert all(row == ["cantSplit"] for row in properties[1:])
