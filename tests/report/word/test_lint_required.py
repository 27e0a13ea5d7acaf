"""What a document must show stands where it is printed whatever the test has."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.report.template_factory import HASH, make, opened, p, sdt
from tests.report.word.test_check import rules
from toolkit.report.kinds import check as check_template
from toolkit.report.style import Style
from toolkit.report.word.check import RULES
from toolkit.report.word.package import read_template


def _as(kind: str):
    """Make the header of a template one of another kind of pages."""

    def edit(members: dict[str, bytes]) -> None:
        text = members["word/document.xml"]
        members["word/document.xml"] = text.replace(
            b'<w:headerReference w:type="default"', f'<w:headerReference w:type="{kind}"'.encode()
        )

    return edit


def test_a_required_tag_in_a_condition_alone_is_an_error(tmp_path: Path) -> None:
    assert rules(tmp_path, sdt("tk:if.pull", p(HASH)), hash_=False) == ["unprinted-required"]
    assert "unprinted-required" in RULES


def test_a_required_tag_that_also_stands_outside_conditions_is_printed(tmp_path: Path) -> None:
    assert rules(tmp_path, sdt("tk:if.pull", p(HASH))) == []


def test_a_condition_that_asks_for_the_tag_itself_keeps_it(tmp_path: Path) -> None:
    assert rules(tmp_path, sdt("tk:if.calibration.hash", p(HASH)), hash_=False) == []


@pytest.mark.parametrize("kind", ["first", "even"])
def test_a_header_of_pages_that_are_not_told_apart_prints_nothing(tmp_path: Path, kind: str) -> None:
    # Neither titlePg nor evenAndOddHeaders is set (ISO/IEC 29500-1, 17.10.1 and 17.10.6).
    template = read_template(make(tmp_path, p("x"), header=p(HASH), hash_=False, edit=_as(kind)))
    (finding,) = check_template(template, Style(), fonts=False)
    assert (finding.rule, finding.level, finding.part) == ("unprinted-required", "error", "word/header1.xml")


def test_the_header_of_a_section_that_may_go_is_no_place_for_a_required_tag(tmp_path: Path) -> None:
    def edit(members: dict[str, bytes]) -> None:
        text = members["word/document.xml"]
        begin, end = (
            text.index(b"<w:headerReference"),
            text.index(b"/>", text.index(b"<w:headerReference")) + 2,
        )
        reference = text[begin:end]
        text = text[:begin] + text[end:]
        members["word/document.xml"] = text.replace(b"<w:vanish/>", reference)

    broken = "<w:p><w:pPr><w:sectPr><w:vanish/></w:sectPr></w:pPr></w:p>"
    body = sdt("tk:if.pull", p("x") + broken) + p("y")
    template = read_template(make(tmp_path, body, header=p(HASH), hash_=False, edit=edit))
    assert "unprinted-required" in {one.rule for one in check_template(template, Style(), fonts=False)}


def test_what_a_style_file_demands_is_held_to_the_same(tmp_path: Path) -> None:
    style = Style(required=("tk:figure.gough", "tk:tire.rim"))
    body = sdt("tk:if.gough", p("{{tk:figure.gough}}")) + sdt("tk:if.pull", p("{{tk:tire.rim}}"))
    found = check_template(opened(tmp_path, body), style, fonts=False)
    assert [(one.rule, one.message.split()[0]) for one in found] == [("unprinted-required", "tk:tire.rim")]
