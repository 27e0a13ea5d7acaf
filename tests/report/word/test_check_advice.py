# ruff: noqa: E501  lines of WordprocessingML read best whole
"""What a template check advises, and the texts that nobody filled in."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.report.template_factory import HASH, opened, p, run, sdt, tbl
from toolkit.cli.template import check as check_command
from toolkit.report.kinds import check
from toolkit.report.style import Style
from toolkit.report.word.lint import RULES

TABLE = tbl(["file", "hash"], ["{{tk:row.file}}", "{{tk:row.sha256}}"])
WELL_SET = TABLE.replace("<w:tr>", "<w:tr><w:trPr><w:tblHeader/></w:trPr>", 1)


def rules(folder: Path, body: str, style: Style | None = None) -> list[tuple[str, str]]:
    found = check(opened(folder, p(HASH) + body), style or Style(), fonts=False)
    assert {finding.rule for finding in found} <= set(RULES)
    return [(finding.level, finding.rule) for finding in found]


def test_a_table_over_two_pages_is_advised_to_repeat_its_head(tmp_path: Path) -> None:
    assert rules(tmp_path, p("{{tk:table.files}}") + TABLE) == [("note", "header-row")]
    assert rules(tmp_path, p("{{tk:table.files}}") + WELL_SET) == []
    assert rules(tmp_path, sdt("tk:table.files", WELL_SET)) == []


def test_words_beside_a_table_tag_are_named_as_they_go_with_it(tmp_path: Path) -> None:
    assert rules(tmp_path, p("Files: {{tk:table.files}}") + WELL_SET) == [("note", "table-paragraph")]


def test_advice_alone_ends_with_0(tmp_path: Path) -> None:
    opened(tmp_path, p(HASH) + p("{{tk:table.files}}") + TABLE)
    (template,) = tmp_path.glob("*.docx")
    assert check_command(template, quiet=True) == 0


@pytest.mark.parametrize(
    "text",
    ["TODO method", "Lorem ipsum dolor", "Reifenprüfstelle Musterstadt", "[Company name]", "<your address>", "XXX", "lab@example.org"],
)  # fmt: skip
def test_a_text_that_stands_for_another_one_is_a_finding(text: str, tmp_path: Path) -> None:
    shown = text.replace("<", "&lt;").replace(">", "&gt;")
    assert rules(tmp_path, p(shown)) == [("warning", "placeholder")]
    assert rules(tmp_path, "", Style(laboratory=text)) == [("warning", "placeholder")]


@pytest.mark.parametrize(
    "text",
    ["load [N]", "B [1/rad]", "a &lt; b", "conicity [{{tk:unit.force}}]", "Example Tyres", "muster rolls"],
)
def test_other_texts_are_none(text: str, tmp_path: Path) -> None:
    assert rules(tmp_path, p(text)) == []


def test_the_prompt_of_a_control_that_nobody_fills_is_a_finding(tmp_path: Path) -> None:
    prompt = sdt("company", run("Click or tap here to enter text."), "<w:showingPlcHdr/>")
    ours = sdt("tk:tire.size", run("tire size"), "<w:showingPlcHdr/>")
    assert rules(tmp_path, p(prompt)) == [("warning", "placeholder")]
    assert rules(tmp_path, p(ours)) == []
