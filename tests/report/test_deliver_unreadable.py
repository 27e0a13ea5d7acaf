# ruff: noqa: E501  lines of WordprocessingML read best whole
"""No report is delivered whose marks, signatures or required values nobody can read."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.report.report_factory import make_record, make_result
from tests.report.template_factory import HASH, W, make, p
from tests.report.word.test_legible import shape
from toolkit.errors import RenderError
from toolkit.report.content import ReportContent
from toolkit.report.deliver import Delivered, Job, deliver, deliver_all
from toolkit.report.style import Style
from toolkit.report.test.content import build_content
from toolkit.report.word.legible import seen
from toolkit.report.word.package import Template, read_template

pytestmark = pytest.mark.skipif(
    not (shutil.which("soffice") and shutil.which("pdftotext")),
    reason="LibreOffice or poppler is not installed",
)
# Each hides the default text of a document in another way.
HIDING = {
    "white and tiny": '<w:color w:val="FFFFFF"/><w:sz w:val="4"/>',
    "hidden": "<w:vanish/>",
    "of no width": '<w:w w:val="1"/><w:sz w:val="20"/>',
    "on its own colour": '<w:color w:val="FFFF00"/><w:sz w:val="20"/><w:highlight w:val="yellow"/>',
}


def content() -> ReportContent:
    return build_content(make_result(simulated=True), make_record(), style=Style())


def hidden(folder: Path, name: str) -> Template:
    """Return a template whose default text nobody can read."""

    def edit(members: dict[str, bytes]) -> None:
        spacing = '<w:spacing w:line="20" w:lineRule="exact"/><w:ind w:left="-20000"/>'
        members["word/styles.xml"] = (
            f'<w:styles xmlns:w="{W}"><w:docDefaults><w:rPrDefault><w:rPr>{HIDING[name]}</w:rPr></w:rPrDefault>'
            f'</w:docDefaults><w:style w:type="paragraph" w:default="1" w:styleId="Normal"><w:name w:val="Normal"/>'
            f'<w:pPr>{spacing}</w:pPr><w:rPr>{HIDING[name]}</w:rPr></w:style></w:styles>'
        ).encode()  # fmt: skip

    look = (
        '<w:vanish w:val="0"/><w:color w:val="000000"/><w:w w:val="100"/><w:sz w:val="20"/>'
        '<w:highlight w:val="none"/>'
    )
    room = '<w:spacing w:line="240" w:lineRule="auto"/><w:ind w:left="0"/>'
    body = f"<w:p><w:pPr>{room}</w:pPr><w:r><w:rPr>{look}</w:rPr><w:t>{HASH}</w:t></w:r></w:p>"
    folder.mkdir()
    return read_template(make(folder, body, hash_=False, edit=edit))


@pytest.fixture(scope="module")
def printed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Delivered]:
    """A document of each template, all of them converted in one call of LibreOffice."""
    work = tmp_path_factory.mktemp("hiding")
    jobs = [
        Job(template=hidden(work / str(at), name), content=content(), out=work / "out", name=f"hiding-{at}")
        for at, name in enumerate(HIDING)
    ]
    answers = [answer for answer in deliver_all(jobs) if isinstance(answer, Delivered)]
    return dict(zip(HIDING, answers, strict=True))


@pytest.mark.parametrize("name", HIDING)
def test_what_the_toolkit_adds_is_read_whatever_the_default_text_looks_like(
    printed: dict[str, Delivered], name: str
) -> None:
    delivered = printed[name]
    (mark,) = [entry.text for entry in delivered.filled.manifest if entry.tag == "mark:simulated"]
    (closing,) = [entry.text for entry in delivered.filled.manifest if entry.tag == "closing:signature"]
    assert closing == "Signature: unsigned"
    assert list(seen(delivered.pdf, (mark, closing), None)) == []
    assert next(check for check in delivered.checks if check.name == "legible").ok


def test_a_required_value_under_a_shape_is_not_delivered(tmp_path: Path) -> None:
    body = f"<w:p><w:r><w:t>{HASH}</w:t></w:r>{shape('white')}</w:p>" + p("") * 4
    with pytest.raises(RenderError, match="not verified") as refusal:
        deliver(read_template(make(tmp_path, body, hash_=False)), content(), tmp_path / "out")
    assert "tk:calibration.hash" in str(refusal.value.got)
    assert not list((tmp_path / "out").glob("*.pdf"))
