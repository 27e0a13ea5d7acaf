"""A style that is named like an element of a PDF's structure is no such element in the print."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

from tests.report.template_factory import opened, p
from toolkit.report.word.toc_pages import for_printing


def named(docx: bytes, name: str) -> bytes:
    """Return a document whose style *Normal* has another name."""
    stream = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(docx)) as source, zipfile.ZipFile(stream, "w") as target:
        for item in source.infolist():
            data = source.read(item)
            if item.filename == "word/styles.xml":
                assert b'<w:name w:val="Normal"/>' in data
                data = data.replace(b'<w:name w:val="Normal"/>', f'<w:name w:val="{name}"/>'.encode())
            target.writestr(item, data)
    return stream.getvalue()


def styles(docx: bytes) -> bytes:
    with zipfile.ZipFile(io.BytesIO(docx)) as source:
        return source.read("word/styles.xml")


def test_only_the_name_changes_and_only_in_the_copy_that_is_printed(tmp_path: Path) -> None:
    docx = opened(tmp_path, p("a")).data
    mute = named(docx, "Figure")
    printed = styles(for_printing(mute, "word/document.xml", contents=False))
    assert b'w:val="Figure"' not in printed
    assert b'w:val="Figure paragraph"' in printed
    assert b'w:val="Figure"' in styles(mute)
    heading = named(docx, "Table Heading")
    assert for_printing(heading, "word/document.xml", contents=False) == heading
