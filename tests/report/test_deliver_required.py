"""No report is delivered of which no page shows a tag that it must show."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.report.report_factory import make_record, make_result
from tests.report.template_factory import HASH, W, make, p
from toolkit.errors import RenderError
from toolkit.report.content import ReportContent
from toolkit.report.deliver import deliver
from toolkit.report.style import Style
from toolkit.report.test.content import build_content
from toolkit.report.word.package import read_template

pytestmark = pytest.mark.skipif(
    not (shutil.which("soffice") and shutil.which("pdftotext")),
    reason="LibreOffice or poppler is not installed",
)
BREAK = '<w:p><w:r><w:br w:type="page"/></w:r></w:p>'


def content(*required: str) -> ReportContent:
    return build_content(make_result(), make_record(), style=Style(required=required))


def on_even_pages(members: dict[str, bytes]) -> None:
    document, settings = members["word/document.xml"], members["word/settings.xml"]
    members["word/document.xml"] = document.replace(
        b'<w:headerReference w:type="default"', b'<w:headerReference w:type="even"'
    )
    even = f'<w:evenAndOddHeaders xmlns:w="{W}"/>'.encode()
    members["word/settings.xml"] = settings.replace(b"</w:settings>", even + b"</w:settings>")


def made(folder: Path, body: str, header: str, *required: str):
    template = read_template(make(folder, body, header=header, hash_=False, edit=on_even_pages))
    return deliver(template, content(*required), folder / "out")


def test_a_hash_in_the_header_of_even_pages_is_on_no_page_of_one(tmp_path: Path) -> None:
    with pytest.raises(RenderError, match="not verified") as refusal:
        made(tmp_path, p("x"), p(HASH))
    assert "no page shows the required tk:calibration.hash" in str(refusal.value.got)
    assert not list((tmp_path / "out").glob("*"))


def test_a_hash_in_the_header_of_even_pages_is_on_the_second_of_two(tmp_path: Path) -> None:
    checks = {check.name: check for check in made(tmp_path, p("x") + BREAK + p("y"), p(HASH)).checks}
    assert checks["required"].ok
    assert checks["legible"].ok


def test_what_a_style_file_demands_must_be_on_a_page_too(tmp_path: Path) -> None:
    with pytest.raises(RenderError) as refusal:
        made(tmp_path, p(HASH), p("{{tk:tire.rim}}"), "tk:tire.rim")
    assert "no page shows the required tk:tire.rim" in str(refusal.value.got)


def test_a_value_that_no_page_shows_is_not_counted_among_those_found(tmp_path: Path) -> None:
    delivered = made(tmp_path, p(HASH), p("{{tk:tire.rim}}"))
    message = next(check.message for check in delivered.checks if check.name == "values")
    assert message == f"{len(delivered.filled.manifest) - 1} values found in the PDF"
