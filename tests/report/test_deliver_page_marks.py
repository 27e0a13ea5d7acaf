"""The mark of a draft stands on every page, whatever the template, and no report is delivered without it."""

from __future__ import annotations

import dataclasses
import io
import shutil
from pathlib import Path

import docx
import pytest
from docx.enum.section import WD_ORIENT, WD_SECTION
from docx.shared import Mm

from tests.report.alien_factory import build
from tests.report.report_factory import make_record, make_result
from tests.report.template_factory import HASH
from toolkit.calibration.records.use import CalibrationUse
from toolkit.report.content import ReportContent
from toolkit.report.deliver import deliver
from toolkit.report.style import Style
from toolkit.report.test.content import build_content
from toolkit.report.word.fill import fill
from toolkit.report.word.package import read_template
from toolkit.report.word.toc_pages import pdf_text
from toolkit.report.word.verify import text_checks

REASON = "withdrawn on 2026-05-01: cell overloaded"
USE = CalibrationUse(id="m15-r2", sha256="c0ffee" * 8, unverified=False, draft_reasons=(REASON,))
MARK = f"DRAFT, NOT APPROVED: m15-r2: {REASON}"
office_needed = pytest.mark.skipif(
    not (shutil.which("soffice") and shutil.which("pdftotext")),
    reason="LibreOffice or poppler is not installed",
)


def content(use: CalibrationUse = USE) -> ReportContent:
    made = make_result()
    reduced = dataclasses.replace(made.reduced, calibration=use)
    style = Style(laboratory="a laboratory")
    return build_content(dataclasses.replace(made, reduced=reduced), make_record(), style=style)


def template(folder: Path, *, odd: bool, first: bool, own: bool) -> Path:
    """Return a template of three sections; ``own``: each has headers of its own, the first a table alone."""
    document = docx.Document()
    document.settings.odd_and_even_pages_header_footer = odd
    document.add_paragraph(HASH)
    document.add_page_break()
    document.add_paragraph("second page")
    document.add_page_break()
    document.add_paragraph("third page")
    wide = document.add_section(WD_SECTION.NEW_PAGE)
    wide.orientation = WD_ORIENT.LANDSCAPE
    wide.page_width, wide.page_height = wide.page_height, wide.page_width
    document.add_paragraph("landscape")
    tight = document.add_section(WD_SECTION.NEW_PAGE)
    tight.orientation = WD_ORIENT.PORTRAIT
    tight.page_width, tight.page_height = wide.page_height, wide.page_width
    tight.top_margin = tight.header_distance = Mm(0)
    document.add_paragraph("text at the very edge of the page")
    for section in document.sections:
        section.different_first_page_header_footer = first
        if own:
            section.header.is_linked_to_previous = False
            section.header.add_table(1, 1, Mm(100)).cell(0, 0).text = "a laboratory"
            empty = section.header.paragraphs[0]._element
            empty.getparent().remove(empty)
    path = folder / "t.docx"
    document.save(path)
    return path


@pytest.mark.parametrize("own", [True, False])
@pytest.mark.parametrize(("odd", "first"), [(True, True), (False, True), (True, False), (False, False)])
def test_every_header_that_a_page_can_show_has_the_mark(
    tmp_path: Path, odd: bool, first: bool, own: bool
) -> None:
    made = fill(read_template(template(tmp_path, odd=odd, first=first, own=own)), content(), {})
    assert made.page_mark == MARK
    document = docx.Document(io.BytesIO(made.docx))
    for section in document.sections:
        shown = [section.header]
        shown += [section.first_page_header] if first else []
        shown += [section.even_page_header] if odd else []
        for header in shown:
            assert [one.text for one in header.paragraphs].count(MARK) == 1
    assert document.paragraphs[0].text.startswith("Calibration m15-r2: not approved: withdrawn")


def test_a_record_in_force_leaves_the_headers_alone(tmp_path: Path) -> None:
    use = dataclasses.replace(USE, draft_reasons=())
    path = template(tmp_path, odd=True, first=True, own=True)
    made = fill(read_template(path), content(use), {})
    assert made.page_mark is None
    before = [one.header._element.xml for one in docx.Document(str(path)).sections]
    assert [one.header._element.xml for one in docx.Document(io.BytesIO(made.docx)).sections] == before


UNVERIFIED = dataclasses.replace(USE, draft_reasons=(), unverified=True)


def test_an_unverified_record_has_its_mark_in_the_same_headers(tmp_path: Path) -> None:
    made = fill(read_template(template(tmp_path, odd=True, first=True, own=True)), content(UNVERIFIED), {})
    assert made.page_mark == UNVERIFIED.mark
    assert made.page_mark not in (None, MARK)
    for section in docx.Document(io.BytesIO(made.docx)).sections:
        for header in (section.header, section.first_page_header, section.even_page_header):
            assert [one.text for one in header.paragraphs].count(made.page_mark) == 1


OTHER = pytest.mark.campaign("another mark in the same headers, which hold it in every run")


@office_needed
@pytest.mark.parametrize("use", [USE, pytest.param(UNVERIFIED, marks=OTHER)])
def test_the_pdf_of_a_template_that_nobody_adapted_has_it_on_every_page(
    tmp_path: Path, use: CalibrationUse
) -> None:
    made = deliver(
        read_template(build(tmp_path / "Brief.dotx", main="template")), content(use), tmp_path / "out"
    )
    pages = pdf_text(made.pdf).split("\f")[:-1]
    assert len(pages) == made.pages > 2
    assert use.mark is not None
    assert all("".join(use.mark.split()) in "".join(page.split()) for page in pages)
    assert "marks" in {check.name for check in made.checks if check.ok}


def test_a_page_without_the_mark_is_no_verified_report(tmp_path: Path) -> None:
    made = fill(read_template(template(tmp_path, odd=False, first=False, own=False)), content(), {})
    values = " ".join(one.text for one in made.manifest)
    (check,) = [one for one in text_checks(f"{values}\f{MARK}\fno mark\f", made) if one.name == "marks"]
    assert not check.ok
    assert not check.warning
    assert check.message.endswith("is not on page 3")
