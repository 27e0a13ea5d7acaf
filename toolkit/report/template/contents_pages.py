"""The pages of a table of contents: left to LibreOffice for the PDF, then written into the Word file."""

from __future__ import annotations

import io
import re
import subprocess
import zipfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from lxml import etree

from toolkit.report.template.bulk import with_rows, without_rows
from toolkit.report.template.contents import ContentsEntry, contents_fields
from toolkit.report.template.xml import (
    SDT_CONTENT,
    SDT_PR,
    W_P,
    W_R,
    W_SDT,
    W_T,
    Element,
    ancestor,
    parser,
    q,
)

Edit = Callable[[Element], None]
_STORY = re.compile(r"word/[\w.-]+\.xml")
_FIELDS = (q("w:fldChar"), q("w:fldSimple"), q("w:hyperlink"))
_LABEL = r"[\s.…·‥_\-]*?(\d+|[ivxlcdmIVXLCDM]+|[A-Z]{1,2})(?=\s|$)"


def for_printing(docx: bytes, part: str, *, contents: bool) -> bytes:
    """Return the document as LibreOffice prints it right; as it came where there is nothing to change.

    Tables of contents become plain lines, whose pages it updates. Controls around paragraphs or cells with
    fields go, in every part: of a control around one paragraph LibreOffice 7.4 prints the codes of the
    fields in it, ``PAGE ?`` in a footer. ``contents`` tells that the main part has tables of contents.
    """

    def unwrap(root: Element) -> None:
        for field in contents_fields(root):
            for element in [*_span(root, field.begin, field.separate), field.end]:
                run = element.getparent()
                run.remove(element)
                if run.tag == W_R and not [c for c in run if c.tag != q("w:rPr")]:
                    run.getparent().remove(run)
        for gallery in list(root.iter(q("w:docPartObj"))):
            if gallery.getparent().tag == SDT_PR:
                gallery.getparent().remove(gallery)
        _without_controls(root)

    with zipfile.ZipFile(io.BytesIO(docx)) as source:
        edits: dict[str, Edit] = {
            name: _without_controls
            for name in source.namelist()
            if _STORY.fullmatch(name) and _in_control(source.read(name))
        }
    if contents:
        edits[part] = unwrap
    return _edited(docx, edits) if edits else docx


def _in_control(xml: bytes) -> bool:
    return b"<w:sdt" in xml and any(mark in xml for mark in (b"<w:fldChar", b"<w:fldSimple", b"<w:hyperlink"))


def _without_controls(root: Element) -> None:
    """Take away the controls that stand around paragraphs, rows or cells with fields or links."""
    for control in list(root.iter(W_SDT)):
        content = control.find(SDT_CONTENT)
        if content is None or next(content.iter(*_FIELDS), None) is None:
            continue
        if next(content.iter(W_P), None) is None:
            continue
        for child in list(content):
            control.addprevious(child)
        control.getparent().remove(control)


def with_pages(docx: bytes, part: str, pages: Mapping[str, str]) -> bytes:
    """Return the document with the page of each bookmark in the lines of its tables of contents."""

    def put(root: Element) -> None:
        for field in contents_fields(root):
            for paragraph in field.paragraphs or ():
                for code in paragraph.iter(q("w:instrText")):
                    found = re.match(r"\s*PAGEREF\s+(\S+)", code.text or "")
                    if found and found[1] in pages:
                        following = (t for t in code.getparent().itersiblings(W_R) if t.find(W_T) is not None)
                        next(following).find(W_T).text = pages[found[1]]

    return _edited(docx, {part: put})


def with_numbers(docx: bytes, part: str, titles: Mapping[str, str]) -> bytes:
    """Return the document with the text of each line of its tables of contents replaced by bookmark."""

    def put(root: Element) -> None:
        for field in contents_fields(root):
            for paragraph in field.paragraphs or ():
                bookmark = next(
                    (
                        found[1]
                        for code in paragraph.iter(q("w:instrText"))
                        if (found := re.match(r"\s*PAGEREF\s+(\S+)", code.text or ""))
                    ),
                    "",
                )
                text = next((t for t in paragraph.iter(W_T) if ancestor(t, W_P) is paragraph), None)
                if bookmark in titles and text is not None:
                    text.text = titles[bookmark]

    return _edited(docx, {part: put})


def pdf_outline(pdf: Path) -> list[tuple[str, int]]:
    """Return the PDF's own outline: (title, page), in the order of the document."""
    done = subprocess.run(
        ["pdftohtml", "-xml", "-i", "-stdout", "-f", "1", "-l", "1", str(pdf)],
        capture_output=True,
        timeout=120,
        check=False,
    )
    found = re.findall(rb'<item page="(\d+)">(.*?)</item>', done.stdout, re.DOTALL)
    return [(_unescaped(title), int(page)) for page, title in found]


def titles_of(
    headings: Sequence[tuple[str, str]], outline: Sequence[tuple[str, int]]
) -> list[tuple[str, str, str, int]]:
    """Return (bookmark, text, title in the PDF, page) of each heading, matched in order.

    The PDF's title begins with the number that Word gives a heading by itself. A heading that the outline
    has not is left out.
    """
    from toolkit.report.template.verify_text import squeeze

    found = []
    at = 0
    for bookmark, text in headings:
        wanted = squeeze(text)
        for i in range(at, len(outline)):
            if squeeze(outline[i][0]).endswith(wanted):
                found.append((bookmark, text, *outline[i]))
                at = i + 1
                break
    return found


def printed_pages(text: str, entries: Sequence[ContentsEntry]) -> dict[str, str]:
    """Return the page that each line of the tables of contents shows in the PDF's text, by bookmark."""
    found: dict[str, str] = {}
    at = 0
    for entry in entries:
        if not entry.paged:
            continue
        words = r"\s*".join(re.escape(word) for word in entry.text.split())
        match = re.compile(words + _LABEL).search(text, at)
        if match:
            found[entry.bookmark] = match[1]
            at = match.end()
    return found


def _span(root: Element, begin: Element, separate: Element | None) -> list[Element]:
    """Return a field's begin, its code and its separator."""
    inside, found = False, []
    for element in root.iter(q("w:fldChar"), q("w:instrText")):
        inside = inside or element is begin
        if inside:
            found.append(element)
        if element is separate or (separate is None and inside and element is not begin):
            return found
    return found


def _edited(docx: bytes, edits: Mapping[str, Edit]) -> bytes:
    stream = io.BytesIO()
    with (
        zipfile.ZipFile(io.BytesIO(docx)) as source,
        zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as target,
    ):
        for item in source.infolist():
            data = source.read(item)
            if item.filename in edits:
                data, rows = without_rows(data)
                root = etree.fromstring(data, parser())
                edits[item.filename](root)
                data = etree.tostring(root, xml_declaration=True, encoding="UTF-8", standalone=True)
                data = with_rows(data, rows)
            target.writestr(item, data)
    return stream.getvalue()


def _unescaped(title: bytes) -> str:
    from html import unescape

    return unescape(title.decode("utf-8", "replace"))
