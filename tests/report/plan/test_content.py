"""A plan's sheet: what its document holds, in every language, and what names it."""

from __future__ import annotations

import dataclasses
import datetime as dt
import re
import zipfile
from pathlib import Path

import pytest

from tests.report.plan.plan_factory import sheet
from toolkit.report.plan.content import build_plan_content
from toolkit.report.style import Style
from toolkit.words.phrasebook import phrasebook

TEMPLATE = Path(__file__).parents[3] / "report_templates" / "plan.docx"
MARGINS_TWIPS = 140  # of a cell, both sides
LETTER_POINTS = 0.52 * 8.5  # of the heads' bold, on average


def test_steps_are_numbered_with_room_for_a_mark() -> None:
    rows = build_plan_content(sheet(), Style()).tables["plan_steps"].rows
    assert [row[0] for row in rows] == ["1", "2"]
    assert all(row[-1] == "" for row in rows)


def test_a_table_without_rows_is_no_condition() -> None:
    content = build_plan_content(sheet(pairs=(), risks=(), plots=()), Style())
    assert not content.conditions["plan_pairs"]
    assert not content.conditions["plan_risks"]
    assert not content.conditions["plan_figure_1"]
    assert content.conditions["plan_steps"]


def test_the_same_plan_has_the_same_name_on_any_day_and_another_plan_another() -> None:
    plan = sheet()
    assert plan.id == dataclasses.replace(plan, issued=dt.date(2027, 1, 1)).id
    assert plan.id != sheet(steps=plan.steps[:1]).id
    assert plan.id != sheet(kind="test").id


@pytest.mark.parametrize(
    ("language", "title", "step", "assumed"),
    [
        ("de", "Plan einer Kalibrierung: hub", "montieren: +FY", "nichts bricht plötzlich"),
        ("fr", "Plan d'un étalonnage: hub", "monter : +FY", "rien ne casse soudainement"),
    ],
)
def test_a_sheet_speaks_the_language_of_its_style(language: str, title: str, step: str, assumed: str) -> None:
    content = build_plan_content(sheet(), Style(language=language, decimal_comma=True))
    assert content.values["plan.title"].value == title
    assert content.tables["plan_steps"].rows[0][2] == step
    assert content.tables["plan_assumptions"].rows == ((assumed,),)
    assert content.tables["plan_uncertainties"].rows[0][3:6] == ("0,25", "0,3", "0,27")
    assert content.tables["plan_uncertainties"].rows[0][6] == {
        "de": "< 0,31 in 9 von 10", "fr": "< 0,31 dans 9 cas sur 10"
    }[language]  # fmt: skip
    assert "1393,8" in str(content.tables["plan_steps"].rows[1][3])


@pytest.mark.parametrize("language", ["en", "de", "fr"])
def test_no_word_of_a_head_is_wider_than_its_cell(language: str) -> None:
    """A word that does not fit is broken in its middle: Schri-tt."""
    book = phrasebook(language)
    document = zipfile.ZipFile(TEMPLATE).read("word/document.xml").decode()
    heads = re.findall(r"<w:tr>(?:(?!</w:tr>).)*<w:tblHeader/>.*?</w:tr>", document)
    assert len(heads) > 3
    broken = []
    for head in heads:
        for width, text in re.findall(r'<w:tcW w:w="(\d+)".*?<w:t xml:space="preserve">([^<]*)</w:t>', head):
            room = (int(width) - MARGINS_TWIPS) / 20
            words = (book.say(text) if book is not None else text).split()
            broken += [word for word in words if LETTER_POINTS * len(word) > room]
    assert broken == []
