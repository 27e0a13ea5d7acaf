# ruff: noqa: E501  lines of WordprocessingML read best whole
"""Tags that must be read and could not be: by their run, their styles, the document's defaults, their surroundings."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.report.template_factory import HASH, W, make, p, run, sdt
from toolkit.report.kinds import check as check_template
from toolkit.report.style import Style
from toolkit.report.word.package import read_template

WHITE = '<w:color w:val="FFFFFF"/>'


def looked(look: str, text: str = HASH, ppr: str = "") -> str:
    return f"<w:p><w:pPr>{ppr}</w:pPr><w:r><w:rPr>{look}</w:rPr><w:t>{text}</w:t></w:r></w:p>"


def cell(inner: str, fill: str) -> str:
    return (
        '<w:tbl><w:tblPr/><w:tblGrid><w:gridCol/></w:tblGrid><w:tr><w:tc><w:tcPr><w:shd w:val="clear" '
        f'w:color="auto" w:fill="{fill}"/></w:tcPr>{inner}</w:tc></w:tr></w:tbl>'
    )


def found(folder: Path, body: str, styles: str = "") -> list[str]:
    def edit(members: dict[str, bytes]) -> None:
        if styles:
            members["word/styles.xml"] = f'<w:styles xmlns:w="{W}">{styles}</w:styles>'.encode()

    path = make(folder, body, hash_=False, edit=edit)
    findings = check_template(read_template(path), Style(), fonts=False)
    return [one.message for one in findings if one.rule == "unreadable-tag" and one.level == "error"]


def style(kind: str, identity: str, look: str, more: str = "", ppr: str = "") -> str:
    return f'<w:style w:type="{kind}" w:styleId="{identity}" {more}><w:name w:val="{identity}"/><w:basedOn w:val="{identity}Base"/><w:pPr>{ppr}</w:pPr></w:style><w:style w:type="{kind}" w:styleId="{identity}Base"><w:name w:val="{identity}Base"/><w:rPr>{look}</w:rPr></w:style>'


@pytest.mark.parametrize(
    ("body", "styles", "said"),
    [
        (looked(WHITE), "", "FFFFFF on FFFFFF"),
        (looked('<w:sz w:val="2"/>'), "", "1 pt"),
        (looked("<w:vanish/>"), "", "hidden"),
        (looked("<w:webHidden/>"), "", "hidden"),
        (looked('<w:w w:val="1"/>'), "", "1 % wide"),
        (looked('<w:color w:themeColor="background1" w:val="FFFFFF"/>'), "", "FFFFFF on"),
        (looked('<w:color w:val="1F3864"/><w:shd w:val="clear" w:fill="1F3864"/>'), "", "1F3864 on 1F3864"),
        (looked('<w:color w:val="FFFF00"/><w:highlight w:val="yellow"/>'), "", "FFFF00 on FFFF00"),
        (looked('<w:color w:val="1F3864"/>', ppr='<w:shd w:val="clear" w:fill="203864"/>'), "", "1F3864 on 203864"),
        (cell(looked('<w:color w:val="1F3864"/>'), "1F3864"), "", "1F3864 on 1F3864"),
        (looked('<w:rStyle w:val="Pale"/>'), style("character", "Pale", WHITE), "FFFFFF on"),
        (looked("", ppr='<w:pStyle w:val="Gone"/>'), style("paragraph", "Gone", "<w:vanish/>"), "hidden"),
        (looked(""), style("paragraph", "Normal", '<w:sz w:val="4"/>', 'w:default="1"'), "2 pt"),
        (looked(""), f"<w:docDefaults><w:rPrDefault><w:rPr>{WHITE}</w:rPr></w:rPrDefault></w:docDefaults>", "FFFFFF on"),
        (
            looked("", ppr='<w:pStyle w:val="Thin"/>'),
            style("paragraph", "Thin", "", ppr='<w:spacing w:line="20" w:lineRule="exact"/>'),
            "line is 1 pt",
        ),
        (p(sdt("tk:calibration.hash", f"<w:r><w:rPr>{WHITE}</w:rPr><w:t>x</w:t></w:r>")), "", "FFFFFF on"),
        (looked(WHITE) + looked('<w:sz w:val="2"/>'), "", "FFFFFF on"),
        (p(run("{{tk:") + f"<w:r><w:rPr>{WHITE}</w:rPr><w:t>calibration.hash}}}}</w:t></w:r>"), "", None),
    ],
)  # fmt: skip
def test_a_required_tag_that_could_not_be_read(
    tmp_path: Path, body: str, styles: str, said: str | None
) -> None:
    # The look of a tag over several runs is that of the first.
    messages = found(tmp_path, body, styles)
    assert len(messages) == (said is not None)
    assert all("tk:calibration.hash could not be read" in one and said in one for one in messages)


@pytest.mark.parametrize(
    ("body", "styles"),
    [
        (looked(""), ""),
        (looked('<w:color w:val="auto"/>'), ""),
        (cell(looked(WHITE), "1F3864"), ""),
        (looked('<w:color w:val="808080"/><w:sz w:val="12"/>'), ""),
        (looked(WHITE) + looked(""), ""),
        (
            looked('<w:vanish w:val="0"/>', ppr='<w:pStyle w:val="Gone"/>'),
            style("paragraph", "Gone", "<w:vanish/>"),
        ),
        (looked("") + looked(WHITE, "{{tk:tire.size}}"), ""),
        (looked("", ppr='<w:spacing w:line="20" w:lineRule="exact"/>'), ""),
    ],
)
def test_what_can_be_read_is_let_pass(tmp_path: Path, body: str, styles: str) -> None:
    assert found(tmp_path, body, styles) == []


@pytest.mark.parametrize("tag", ["tk:signature", "tk:simulated"])
def test_marks_and_signatures_must_be_read_wherever_a_template_puts_them(tmp_path: Path, tag: str) -> None:
    (message,) = found(tmp_path, looked("") + looked(WHITE, f"{{{{{tag}}}}}"))
    assert message.startswith(tag)
