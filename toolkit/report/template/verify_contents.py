"""Verify the tables of contents: their lines equal the headings, their pages those of the print."""

from __future__ import annotations

import io
import re
import zipfile
from pathlib import Path

from toolkit.report.template.contents_pages import pdf_outline, printed_pages, titles_of
from toolkit.report.template.filled import Filled


def contents_problems(pdf: Path, text: str, filled: Filled) -> list[str]:
    """Return what is wrong with a report's tables of contents; empty where all is well.

    The PDF's own outline is the witness: it is made from the headings, not from the contents.
    """
    contents = filled.contents
    if not contents.entries:
        return []
    found = titles_of(contents.headings, pdf_outline(pdf))
    pages = {bookmark: page for bookmark, _, _, page in found}
    said = []
    if len(found) < len(contents.headings):
        seen = {one for _, one, _, _ in found}
        said += [f"heading {one!r} is not in the PDF" for _, one in contents.headings if one not in seen]
        said = said or ["a heading is not in the PDF"]
    printed = printed_pages(text, contents.entries)
    plain = not _restarts(filled)
    for entry in contents.entries:
        if not entry.paged or not entry.text.isascii():
            continue
        shown = printed.get(entry.bookmark)
        if shown is None:
            said.append(f"{entry.text!r} is not in the contents")
        elif entry.heading and plain and shown != str(pages.get(entry.bookmark, shown)):
            said.append(f"{entry.text!r} is on page {pages[entry.bookmark]}, the contents say {shown}")
    return said


def _restarts(filled: Filled) -> bool:
    # A document that counts its pages otherwise than 1, 2, 3 shows labels, not numbers of pages.
    with zipfile.ZipFile(io.BytesIO(filled.docx)) as archive:
        xml = archive.read(filled.main_part)
    return re.search(rb"<w:pgNumType[^>]*w:(?:start|fmt)=", xml) is not None
