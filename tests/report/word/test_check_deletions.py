"""A tracked deletion that touches a tag: what it deletes would be printed, in the value or beside it."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.report.template_factory import opened, p, run, sdt
from toolkit.report.kinds import check as check_template
from toolkit.report.style import Style


def gone(text: str, kind: str = "del") -> str:
    word = "delText" if kind == "del" else "t"
    return f'<w:{kind} w:id="1" w:author="x"><w:r><w:{word}>{text}</w:{word}></w:r></w:{kind}>'


def added(text: str) -> str:
    return f'<w:ins w:id="2" w:author="x">{run(text)}</w:ins>'


ROW = "<w:tbl><w:tblPr/><w:tblGrid><w:gridCol/></w:tblGrid><w:tr>{}<w:tc>{}{}</w:tc></w:tr></w:tbl>"
DELETED_ROW = '<w:trPr><w:del w:id="1" w:author="x"/></w:trPr>'
DELETED_CELL = '<w:tcPr><w:cellDel w:id="1" w:author="x"/></w:tcPr>'


@pytest.mark.parametrize(
    "body",
    [
        p(run("{{tk:"), added("tire"), gone("tir"), run(".size}}")),
        p(run("{{tk:tire"), gone("s", "moveFrom"), run(".size}}")),
        p(run("{{tk:tire.size"), gone(" "), run("}}")),
        p(run("{"), gone("x"), run("{tk:tire.size}}")),
        p(run("{{tk:tire.size}"), gone("}"), run("}")),
        p(gone("{{tk:tire.size}}")),
        p(gone("{{tk:tire.size}}", "moveFrom")),
        p(gone("{{"), run("{{tk:tire.size}}"), gone("{{tk:tire")),
        p('<w:del w:id="1" w:author="x">' + sdt("tk:tire.size", run("x")) + "</w:del>"),
        ROW.format(DELETED_ROW, "", p("{{tk:tire.size}}")),
        ROW.format("", DELETED_CELL, p("{{tk:tire.size}}")),
        ROW.format(DELETED_ROW, "", p(sdt("tk:tire.size", run("x")))),
    ],
)  # fmt: skip
def test_a_deletion_that_touches_a_tag_is_an_error(tmp_path: Path, body: str) -> None:
    findings = check_template(opened(tmp_path, body), Style(), fonts=False)
    assert "tracked-changes" in {one.rule for one in findings if one.level == "error"}


@pytest.mark.parametrize(
    "body",
    [
        p(gone("old "), run("{{tk:tire.size}}")),
        p(run("{{tk:tire.size}}"), gone(" old")),
        p(run("{{tk:"), added("tire"), run(".size}}"), gone(" old")),
        p(run("{{tk:tire.size}}"), gone("old"), run("{{tk:tire.DOT}}")),
        p(added("{{tk:tire.size}}")),
        p(run("{{tk:tire.size}}")) + ROW.format(DELETED_ROW, "", p("old")),
    ],
)
def test_a_deletion_beside_a_tag_is_a_warning_only(tmp_path: Path, body: str) -> None:
    findings = check_template(opened(tmp_path, body), Style(), fonts=False)
    assert {one.level for one in findings if one.rule == "tracked-changes"} <= {"warning"}
    assert not [one for one in findings if one.level == "error"]
