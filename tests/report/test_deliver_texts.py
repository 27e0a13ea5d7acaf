# ruff: noqa: E501  lines of WordprocessingML read best whole
"""What the Word file says stands in its PDF, place by place; what is printed otherwise is no loss."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from tests.report.alien_factory import text_box
from tests.report.report_factory import make_record, make_result
from tests.report.template_factory import make, p, run, sdt, tbl
from toolkit.errors import RenderError
from toolkit.report.content import ReportContent
from toolkit.report.deliver import Delivered, deliver
from toolkit.report.style import Style
from toolkit.report.test.content import build_content
from toolkit.report.word.package import read_template
from toolkit.report.word.xml import NS

pytestmark = pytest.mark.skipif(
    not (shutil.which("soffice") and shutil.which("pdftotext")),
    reason="LibreOffice or poppler is not installed",
)
TAG = "{{tk:tire.size}}"
PROSE = "The laboratory measured the lateral force and the aligning moment of this tire at five loads. " * 4


def content(**changes: object) -> ReportContent:
    return build_content(make_result(**changes), make_record(), style=Style())


def delivered(folder: Path, body: str, **changes: object) -> Delivered:
    return deliver(read_template(make(folder, body)), content(**changes), folder / "out")


def refusal(folder: Path, body: str) -> str:
    with pytest.raises(RenderError, match="not verified") as caught:
        delivered(folder, body)
    assert not list((folder / "out").glob("*"))
    return str(caught.value.got)


def line(text: str, *, run: str = "", paragraph: str = "") -> str:
    return (
        f"<w:p><w:pPr>{paragraph}</w:pPr>"
        f'<w:r><w:rPr>{run}</w:rPr><w:t xml:space="preserve">{text}</w:t></w:r></w:p>'
    )


def cut_box(text: str) -> str:
    """Return a text box of the size of two words, whatever is in it."""
    box = text_box(p(text)).replace("<wps:bodyPr/>", "<wps:bodyPr><a:noAutofit/></wps:bodyPr>")
    box = box.replace('cx="2500000" cy="700000"', 'cx="700000" cy="200000"')
    shapes = "http://schemas.microsoft.com/office/word/2010/wordprocessingShape"
    return f'<w:p xmlns:mc="{NS["mc"]}" xmlns:v="{NS["v"]}" xmlns:wps="{shapes}">{box}</w:p>'


def upright_cells() -> str:
    cell = '<w:tc><w:tcPr><w:tcW w:w="2000" w:type="dxa"/><w:textDirection w:val="btLr"/></w:tcPr>{}</w:tc>'
    cells = "".join(cell.format(p(text)) for text in ("lateral force", "12.5 kN"))
    height = '<w:trPr><w:trHeight w:val="2500" w:hRule="exact"/></w:trPr>'
    grid = '<w:gridCol w:w="2000"/>' * 2
    return f"<w:tbl><w:tblPr/><w:tblGrid>{grid}</w:tblGrid><w:tr>{height}{cells}</w:tr></w:tbl>"


@pytest.mark.parametrize("elsewhere", [p(f"Size {TAG} of the tire."), p(TAG), tbl(["size", TAG])])
def test_a_value_that_is_cut_off_at_one_place_is_not_found_at_another(tmp_path: Path, elsewhere: str) -> None:
    got = refusal(tmp_path, cut_box(f"A rather long label of the tire: {TAG}") + elsewhere)
    assert "texts: not printed" in got


def test_the_same_value_at_several_places_is_found_at_each(tmp_path: Path) -> None:
    body = p(TAG) * 3 + tbl(["size", TAG], [TAG, TAG]) + p(f"of {TAG}, {TAG}")
    assert next(c for c in delivered(tmp_path, body).checks if c.name == "texts").ok


def test_a_text_of_the_templates_own_that_is_cut_off_is_not_delivered(tmp_path: Path) -> None:
    got = refusal(tmp_path, cut_box("Conformity: the tire does not meet the requirement") + p(TAG))
    assert "Conformity" in got


def test_a_text_after_a_field_that_does_not_end_is_not_delivered(tmp_path: Path) -> None:
    begun = '<w:r><w:fldChar w:fldCharType="begin"/></w:r><w:r><w:instrText> PAGE </w:instrText></w:r>'
    assert "does not end" in refusal(tmp_path, p(TAG) + f"<w:p>{begun}</w:p>" + p("STATEMENT"))


PRINTED_OTHERWISE = {
    "capitals": line("in capitals", run="<w:caps/>") + line("Small Capitals", run="<w:smallCaps/>"),
    "hidden": line("a hint for authors that nobody prints", run="<w:vanish/>"),
    "hyphens": line(PROSE + "Straßenverkehrszulassungsordnung " * 6, paragraph='<w:jc w:val="both"/>'),
    "three columns": line(PROSE * 6) + '<w:p><w:pPr><w:sectPr><w:type w:val="continuous"/><w:cols w:num="3"/></w:sectPr></w:pPr></w:p>',
    "pages": line(PROSE * 40),
    "tabs": '<w:p><w:pPr><w:tabs><w:tab w:val="right" w:leader="dot" w:pos="8000"/></w:tabs></w:pPr><w:r><w:t>Operator</w:t><w:tab/><w:t>Jane Doe</w:t></w:r></w:p>',
    "a page's number": '<w:p><w:r><w:t>Page </w:t></w:r><w:fldSimple w:instr=" PAGE "><w:r><w:t>77</w:t></w:r></w:fldSimple><w:r><w:t> follows</w:t></w:r></w:p>',
    "upright cells": upright_cells(),
    "signs": p("☎ 0049 – • … “quoted” ﬁne ½ 10⁻³ Ω") + p("مرحبا 12 kPa"),
    "breaks": '<w:p><w:r><w:t>first line</w:t><w:br/><w:t>second line</w:t><w:noBreakHyphen/><w:t>third</w:t></w:r></w:p>',
    "a drop capital": '<w:p><w:pPr><w:framePr w:dropCap="drop" w:lines="2" w:wrap="around" w:vAnchor="text" w:hAnchor="text"/></w:pPr><w:r><w:rPr><w:sz w:val="56"/></w:rPr><w:t>T</w:t></w:r></w:p>' + p("he tire was measured."),
    "old text of a move": '<w:p><w:moveFrom w:id="1" w:author="x"><w:r><w:t>it stood at this place</w:t></w:r></w:moveFrom><w:r><w:t>x</w:t></w:r></w:p>',
}  # fmt: skip


# What sets its pages otherwise has a document of its own; all else stands one below the other.
PAGED = ("hyphens", "three columns", "pages")
TOGETHER = tuple(name for name in PRINTED_OTHERWISE if name not in PAGED)


@pytest.mark.parametrize("names", [TOGETHER, *((name,) for name in PAGED)], ids=lambda names: names[0])
def test_what_is_printed_otherwise_is_no_loss(tmp_path: Path, names: tuple[str, ...]) -> None:
    body = "".join(PRINTED_OTHERWISE[name] + p(f"The end of {name}.") for name in names)
    made = delivered(tmp_path, p(TAG) + body)
    assert next(check.message for check in made.checks if check.name == "texts") == (
        "each text of the Word file has its place in the PDF"
    )


@pytest.mark.parametrize("special", ["10 kΩ", "Δ 5 µm", "東京 tire", "≤ 3 ℃"])
def test_a_glyph_of_another_font_within_a_line_is_found(tmp_path: Path, special: str) -> None:
    made = delivered(tmp_path, p("[{{tk:test.special}}] and more on the line"), special=special)
    assert all(check.ok or check.warning for check in made.checks)


def test_the_lines_of_a_text_stay_lines(tmp_path: Path) -> None:
    """LibreOffice 7.4 prints no line break of a control of plain text."""
    controls = "".join(
        f"<w:p>{sdt('tk:test.special', run('as typed'), plain)}</w:p>"
        for plain in ("<w:text/>", '<w:text w:multiLine="1"/>')
    )
    made = delivered(tmp_path, p("{{tk:tire.size}}") + controls, special="1 Hill Road\nNorthtown")
    text = subprocess.run(
        ["pdftotext", "-layout", made.pdf, "-"], capture_output=True, text=True, check=True
    ).stdout
    lines = [" ".join(one.split()) for one in text.splitlines()]
    assert lines.count("1 Hill Road") == 2
    assert lines.count("Northtown") == 2
