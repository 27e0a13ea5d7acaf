"""A packaged template with charts of Word's own in place of pictures: in its PDF, as it is seen and heard."""

from __future__ import annotations

import datetime as dt
import io
import re
import shutil
import zipfile
from pathlib import Path

import pytest
from pyhanko.pdf_utils.reader import PdfFileReader

from tests.report.report_factory import make_record, make_result
from tests.report.template_factory import FOLDER
from tests.report.test_kinds_templates import structure
from toolkit.recording.folder import ReportDetails
from toolkit.report.deliver import Delivered, deliver
from toolkit.report.kinds import check
from toolkit.report.style import Style, read_style, style_file
from toolkit.report.test.content import REPORT, build_content
from toolkit.report.word.chart import with_alternatives
from toolkit.report.word.package import read_template
from toolkit.report.word.toc_pages import pdf_text

pytestmark = pytest.mark.skipif(
    not (shutil.which("soffice") and shutil.which("pdftotext")),
    reason="LibreOffice or poppler is not installed",
)


def with_charts(source: Path, target: Path) -> Path:
    """Write a template whose figures are charts where they can be; what cannot be one stays a picture."""
    with zipfile.ZipFile(source) as archive, zipfile.ZipFile(target, "w") as out:
        for name in archive.namelist():
            data = archive.read(name)
            if name == "word/document.xml":
                data = re.sub(
                    rb"tk:figure\.(\w+)",
                    lambda m: b"tk:chart." + m[1] if m[1].decode() in REPORT.vocabulary.charts else m[0],
                    data,
                )
            out.writestr(name, data)
    return target


@pytest.fixture(scope="module")
def delivered(tmp_path_factory: pytest.TempPathFactory) -> Delivered:
    folder = tmp_path_factory.mktemp("charts")
    source = FOLDER / "pruefbericht.docx"
    template = read_template(with_charts(source, folder / "charts.docx"))
    style = read_style(style_file(source))
    assert [one for one in check(template, style, fonts=False) if one.level != "note"] == []
    made = build_content(
        make_result(simulated=True), make_record(), style=style, issued=dt.date(2026, 11, 24),
        details=ReportDetails(method="drum test"),
    )  # fmt: skip
    return deliver(template, made, folder / "out")


def test_the_pdf_shows_the_axes_the_series_and_the_mark_of_every_chart(delivered: Delivered) -> None:
    charts = delivered.filled.charts
    assert len(charts) >= 4
    assert [check.message for check in delivered.checks if not check.ok] == []
    text = re.sub(r"\s", "", pdf_text(delivered.pdf))
    for chart in charts:
        for said in chart.texts:
            assert re.sub(r"\s", "", said) in text
    assert "SIMULIERTE" in " ".join(said for chart in charts for said in chart.texts)


def test_every_chart_is_heard(delivered: Delivered) -> None:
    """ISO 14289-1, 7.3: LibreOffice 7.4 itself leaves the alternative text of a chart out."""
    with delivered.pdf.open("rb") as stream:
        root = PdfFileReader(stream).root
        figures = [one for one in structure(root["/StructTreeRoot"]["/K"]) if one.type == "Figure"]
        assert b"pdfuaid:part>1<" in root["/Metadata"].data
    assert len(figures) >= len(delivered.filled.figures)
    assert all(figure.alt for figure in figures)


def test_a_chart_that_the_pdf_lacks_is_no_verified_report(delivered: Delivered) -> None:
    from dataclasses import replace

    from toolkit.report.word.verify import verify_pdf

    ghost = replace(delivered.filled.charts[0], tag="tk:chart.ghost", texts=("an axis that is nowhere",))
    filled = replace(
        delivered.filled, charts=(ghost,), figures=(*delivered.filled.figures, (ghost.tag, "nowhere"))
    )
    failed = {check.name for check in verify_pdf(delivered.pdf, filled)[0] if not check.ok}
    assert failed == {"charts", "figures"}


def test_alternative_texts_go_by_size_and_order_and_leave_the_rest_alone(delivered: Delivered) -> None:
    data = delivered.pdf.read_bytes()
    assert with_alternatives(data, ()).startswith(data)
    again = with_alternatives(data, delivered.filled.charts)  # all of them have their texts already
    with io.BytesIO(again) as stream:
        root = PdfFileReader(stream).root
        assert all(one.alt for one in structure(root["/StructTreeRoot"]["/K"]) if one.type == "Figure")


def test_the_word_file_is_the_same_on_another_day(tmp_path: Path, delivered: Delivered) -> None:
    from toolkit.report.word.fill import fill, survey

    source = FOLDER / "summary.docx"
    template = read_template(with_charts(source, tmp_path / "t.docx"))
    made = build_content(make_result(), make_record(), style=Style(), issued=dt.date(2026, 11, 24))
    assert survey(template, made).figures == ()
    one, two = (fill(template, made, {}, allow_missing=True) for _ in range(2))
    assert one.docx == two.docx
    assert one.pictures == two.pictures
