"""Templates that nobody adapted, six odd ones: through the check, the filling and one call of LibreOffice."""

from __future__ import annotations

import datetime as dt
import io
import shutil
import zipfile
from pathlib import Path

import pytest

from tests.report.odd_templates import ALL
from tests.report.report_factory import make_record, make_result
from toolkit.errors import ToolkitError
from toolkit.report.content import ReportContent
from toolkit.report.deliver import Delivered, Job, deliver_all
from toolkit.report.kinds import check as check_template
from toolkit.report.style import Style
from toolkit.report.test.content import build_content
from toolkit.report.word.controls import kept_whole
from toolkit.report.word.package import read_template
from toolkit.report.word.toc_pages import pdf_text

pytestmark = pytest.mark.skipif(
    not (shutil.which("soffice") and shutil.which("pdftotext")),
    reason="LibreOffice or poppler is not installed",
)
LRM = "\u200e"


def content() -> ReportContent:
    style = Style(laboratory="Labor")
    return build_content(make_result(), make_record(), style=style, issued=dt.date(2026, 11, 21))


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Delivered, str]]:
    """All of them in one command; each report with its PDF's words."""
    folder = tmp_path_factory.mktemp("odd")
    paths = [build(folder) for build in ALL]
    jobs = [Job(template=read_template(one), content=content(), out=folder / one.stem) for one in paths]
    found = {}
    for path, one in zip(paths, deliver_all(jobs), strict=True):
        assert not isinstance(one, ToolkitError), f"{path.name}: {one}"
        found[path.stem] = (one, " ".join(pdf_text(one.pdf).split()))
    return found


@pytest.mark.parametrize("build", ALL)
def test_they_have_no_errors(build, tmp_path: Path) -> None:
    found = check_template(read_template(build(tmp_path)), Style(), fonts=False)
    assert {one.rule for one in found} <= {"tracked-changes", "header-row", "figure-small"}
    told = {"tracked-changes", "figure-small"}  # each is a warning: the document says so, and is made
    assert {one.level for one in found if one.rule not in told} <= {"note"}


def test_a_literal_is_found_through_whatever_splits_it(made) -> None:
    text = made["split"][1]
    for said in ("A 265/35 ZR 18 end", "B altimax-89 end", "C A. Operator", "D 4MY8-009X-0713 end",
                 "E 9J x 18 end", "F steel end", "G m15 end"):  # fmt: skip
        assert said in text
    assert any("tracked-changes" in one for one in made["split"][0].warnings)


def test_controls_of_every_kind_and_level_are_filled(made) -> None:
    report, text = made["controls"]
    for said in ("x 265/35 ZR 18", "Continental 4MY8-009X-0713 9J x 18", "A. Operator lit altimax-89 e",
                 "reverse yes z", "item steel", "m15", "\u2610 left alone Asymmetric", "R. Requestor",
                 "radial", "deep m15-r2"):  # fmt: skip
        assert said in text
    assert not {"GONE", "Choose", "click"} & set(text.split())
    with zipfile.ZipFile(report.docx) as archive:
        word = archive.read("word/document.xml").decode()
    # Locks and the kinds of others stay; what would show old data again goes.
    assert "sdtContentLocked" in word
    assert "repeatingSectionItem" in word
    assert "dataBinding" not in word


def test_boxes_pictures_and_a_wide_page(made) -> None:
    report, text = made["boxes"]
    assert "Box 265/35 ZR 18" in text
    assert "old altimax-89" in text
    assert report.pages == 3
    assert [tag for tag, _ in report.filled.figures].count("tk:figure.mz_vs_slip") == 1
    assert len(report.filled.figures) == 3


def test_a_number_keeps_its_sign_where_text_runs_from_the_right(made) -> None:
    report, _ = made["right"]
    with zipfile.ZipFile(report.docx) as archive:
        word = archive.read("word/document.xml").decode()
    shown = [one.text for one in report.filled.manifest if one.tag == "tk:table.pull.plysteer"]
    assert all(one.startswith("-") for one in shown)
    for text in (*shown, "265/35 ZR 18"):
        assert f"{LRM}{text}{LRM}" in word
    # Elsewhere nothing is added to any value.
    with zipfile.ZipFile(made["split"][0].docx) as archive:
        assert LRM not in archive.read("word/document.xml").decode()


def test_what_has_letters_from_the_right_or_no_digit_is_left_alone() -> None:
    assert kept_whole("מידה 5") == "מידה 5"
    assert kept_whole("steel\n-1") == f"steel\n{LRM}-1{LRM}"


def test_fields_in_controls_around_a_paragraph_are_printed_as_their_results(made) -> None:
    report, text = made["libreoffice"]
    assert "eins 1 265/35 ZR 18" in text
    assert "zwei 1" in text
    assert "drei link" in text
    assert "Blatt 1 von 1 altimax-89" in text
    # The Word file keeps its controls.
    with zipfile.ZipFile(report.docx) as archive:
        assert b'<w:tag w:val="foot"/>' in archive.read("word/footer1.xml")


def test_properties_stand_in_a_file_once(made) -> None:
    data = made["libreoffice"][0].docx.read_bytes()
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        assert archive.namelist().count("docProps/core.xml") == 1
        assert b"toolkit-output" in archive.read("docProps/core.xml")


def test_a_second_print_for_numbered_headings_is_of_the_same_document(made) -> None:
    report, text = made["numbered"]
    # Contents of one line, in a control: its fields are results here too.
    assert text.startswith("1 Ein 265/35 ZR 18...")
    assert "PAGEREF" not in text
    # The first document's PDF is still its own.
    assert made["split"][1].startswith("A 265/35 ZR 18 end")
    # A note that nothing refers to asks for no value and is not looked for.
    assert "tk:test.rated_load" not in {one.tag for one in report.filled.manifest}
