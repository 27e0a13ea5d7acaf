"""A package without times: its parts are as they were, and the day on which it was written is nowhere."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import pytest

from tests.report.template_factory import make, p
from toolkit.errors import TemplateError
from toolkit.report.word.package import read_template, undated


def _package(year: int, method: int) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", method) as archive:
        for name, data in (("[Content_Types].xml", b"<a/>"), ("word/document.xml", b"<b/>" * 999)):
            part = zipfile.ZipInfo(name, date_time=(year, 5, 17, 12, 34, 56))
            part.extra, part.comment = b"\x99\x99\x02\x00xy", b"a comment"
            archive.writestr(part, data, method)
    return stream.getvalue()


@pytest.mark.parametrize("method", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
def test_the_same_content_is_the_same_bytes(method: int) -> None:
    first, second = _package(1999, method), _package(2026, method)
    assert first != second
    assert undated(first) == undated(second)
    with zipfile.ZipFile(io.BytesIO(undated(first))) as archive:
        assert archive.testzip() is None
        assert archive.read("word/document.xml") == b"<b/>" * 999
        assert {part.date_time for part in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}
        assert {(part.extra, part.comment) for part in archive.infolist()} == {
            (b"\x99\x99\x02\x00xy", b"a comment")
        }


def test_a_strict_document_is_refused_with_the_way_to_save_it(tmp_path: Path) -> None:
    # ISO/IEC 29500 Strict names its relationships and namespaces otherwise.
    def strict(members: dict[str, bytes]) -> None:
        for name, data in list(members.items()):
            if name.endswith((".rels", ".xml")):
                members[name] = data.replace(
                    b"http://schemas.openxmlformats.org/officeDocument/2006/relationships",
                    b"http://purl.oclc.org/ooxml/officeDocument/relationships",
                ).replace(
                    b"http://schemas.openxmlformats.org/wordprocessingml/2006/main",
                    b"http://purl.oclc.org/ooxml/wordprocessingml/main",
                )

    with pytest.raises(TemplateError) as caught:
        read_template(make(tmp_path, p("x"), edit=strict))
    assert (caught.value.rule, caught.value.exit_code) == ("strict-word", 2)
    assert "Word document (.docx)" in str(caught.value.next_step)
