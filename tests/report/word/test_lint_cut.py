"""A condition may not cut a field or a section in two."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.report.template_factory import p, run, sdt
from tests.report.word.test_check import rules
from toolkit.report.word.check import RULES

BEGIN, SEPARATE, END = (
    f'<w:r><w:fldChar w:fldCharType="{kind}"/></w:r>' for kind in ("begin", "separate", "end")
)
CODE = "<w:r><w:instrText> PAGE </w:instrText></w:r>"
FIELD = BEGIN + CODE + SEPARATE + run("1") + END
BREAK = '<w:p><w:pPr><w:sectPr><w:pgSz w:w="11906" w:h="16838"/></w:sectPr></w:pPr></w:p>'


@pytest.mark.parametrize(
    "body",
    [
        p(BEGIN, CODE, SEPARATE, sdt("tk:if.pull", run("1") + END), run(" after")),
        p(sdt("tk:if.pull", BEGIN + CODE), SEPARATE, run("1"), END),
        p(BEGIN, CODE, sdt("tk:if.pull", SEPARATE), run("1"), END),
        p("portrait") + sdt("tk:if.pull", p("x") + BREAK) + p("landscape"),
        p("portrait") + sdt("tk:if.pull", sdt("other", BREAK)) + p("landscape"),
    ],
)
def test_half_of_what_belongs_together_is_an_error(tmp_path: Path, body: str) -> None:
    assert rules(tmp_path, body) == ["cut-by-condition"]
    assert "cut-by-condition" in RULES


@pytest.mark.parametrize(
    "body",
    [
        p("Page ", sdt("tk:if.pull", FIELD + run(" of many"))),
        p(BEGIN, CODE, SEPARATE, sdt("tk:if.pull", run("1")), END),
        sdt("tk:if.pull", p("x") + BREAK) + p("y"),
        p("x") + BREAK + sdt("tk:if.pull", p("a whole section") + BREAK) + p("y"),
        sdt("other", p("x") + BREAK) + sdt("tk:if.pull", sdt("other", p("its section") + BREAK)) + p("y"),
    ],
)
def test_a_whole_field_or_section_may_go(tmp_path: Path, body: str) -> None:
    assert rules(tmp_path, body) == []
