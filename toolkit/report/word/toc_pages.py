"""The pages of a table of contents: left to LibreOffice for the PDF, then written into the Word file."""

from __future__ import annotations

import io
import re
import subprocess
import tempfile
import unicodedata
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from lxml import etree

from toolkit.errors import RenderError
from toolkit.inputs import PDF_FILE, read_input
from toolkit.report.word.bulk import with_rows, without_rows
from toolkit.report.word.filled import Filled
from toolkit.report.word.office import Office
from toolkit.report.word.poppler import poppler
from toolkit.report.word.toc import ContentsEntry, contents_fields
from toolkit.report.word.xml import SDT_CONTENT, SDT_PR, W_P, W_R, W_SDT, W_T, Element, ancestor, parser, q

Edit = Callable[[Element], None]
_STORY = re.compile(r"word/[\w.-]+\.xml")
_STYLES = re.compile(r"word/styles\d*\.xml")
# The standard structure types that are no kind of text (ISO 32000-1, 14.8.4); LibreOffice writes the name of
# a style of one's own as the type of its paragraphs.
_ELEMENTS = frozenset(
    "Document Part Art Sect Div TOC TOCI Index NonStruct Private L LI Lbl LBody Table TR TH TD THead TBody "
    "TFoot Reference BibEntry Link Annot Ruby Warichu Figure Formula Form".split()
)
_ELEMENT_NAME = re.compile(rf'<w:name w:val="(?:{"|".join(sorted(_ELEMENTS))})"')
_FIELDS = (q("w:fldChar"), q("w:fldSimple"), q("w:hyperlink"))
_LABEL = r"[\s.…·‥_\-]*?(\d+|[ivxlcdmIVXLCDM]+|[A-Z]{1,2})(?=\s|$)"

_SPACE = re.compile("[\\s\u00ad\u200b-\u200f\u202a-\u202e\u2066-\u2069\ufeff]+")


def for_printing(docx: bytes, part: str, *, contents: bool) -> bytes:
    """Return the document as LibreOffice prints it right; as it came where there is nothing to change.

    Tables of contents become plain lines, whose pages it updates. Controls around paragraphs or cells with
    fields go, in every part: of a control around one paragraph LibreOffice 7.4 prints the codes of the
    fields in it, ``PAGE ?`` in a footer. ``contents`` tells that the main part has tables of contents. A
    style that is named like an element of the PDF's structure gets another name: its paragraphs would be
    figures or tables to those who hear the document.
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
        edits |= {
            name: _unlike_elements
            for name in source.namelist()
            if _STYLES.fullmatch(name) and _ELEMENT_NAME.search(source.read(name).decode("utf-8", "replace"))
        }
    if contents:
        edits[part] = unwrap
    return _edited(docx, edits) if edits else docx


def _unlike_elements(styles: Element) -> None:
    for name in styles.iter(q("w:name")):
        if name.get(q("w:val")) in _ELEMENTS:
            name.set(q("w:val"), f"{name.get(q('w:val'))} paragraph")


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
                    reference = re.match(r"\s*PAGEREF\s+(\S+)", code.text or "")
                    if reference and reference[1] in pages:
                        following = (t for t in code.getparent().itersiblings(W_R) if t.find(W_T) is not None)
                        next(following).find(W_T).text = pages[reference[1]]

    return _edited(docx, {part: put})


def with_numbers(docx: bytes, part: str, titles: Mapping[str, str]) -> bytes:
    """Return the document with the text of each line of its tables of contents replaced by bookmark."""

    def put(root: Element) -> None:
        for field in contents_fields(root):
            for paragraph in field.paragraphs or ():
                bookmark = next(
                    (
                        reference[1]
                        for code in paragraph.iter(q("w:instrText"))
                        if (reference := re.match(r"\s*PAGEREF\s+(\S+)", code.text or ""))
                    ),
                    "",
                )
                text = next((t for t in paragraph.iter(W_T) if ancestor(t, W_P) is paragraph), None)
                if bookmark in titles and text is not None:
                    text.text = titles[bookmark]

    return _edited(docx, {part: put})


def squeeze(text: str) -> str:
    """Return text as it is compared: composed, without white space, soft hyphens and direction marks.

    >>> squeeze("1 234,5\\u00ad N")
    '1234,5N'
    """
    return _SPACE.sub("", unicodedata.normalize("NFKC", text))


def pdf_text(pdf: Path, *, layout: bool = False) -> str:
    """Return a PDF's text, a form feed after each page, as it was painted or as its ``layout`` has it."""
    with tempfile.TemporaryDirectory(prefix="toolkit-verify-") as folder:
        # The text is the same without PDF/A's colour profile, which pdftotext sets up anew for each page:
        # 50 ms a page. The name is blotted out in place, so that every offset stays right.
        plain = Path(folder) / "text.pdf"
        plain.write_bytes(read_input(pdf, PDF_FILE).replace(b"/OutputIntents", b"/OutputIntent_"))
        return poppler(["pdftotext", "-layout" if layout else "-raw", "-enc", "UTF-8", str(plain), "-"])


def pdf_outline(pdf: Path) -> list[tuple[str, int]]:
    """Return the PDF's own outline: (title, page), in the order of the document."""
    process = subprocess.run(
        ["pdftohtml", "-xml", "-i", "-stdout", "-f", "1", "-l", "1", str(pdf)],
        capture_output=True,
        timeout=120,
        check=False,
    )
    items = re.findall(rb'<item page="(\d+)">(.*?)</item>', process.stdout, re.DOTALL)
    return [(_unescaped(title), int(page)) for page, title in items]


def titles_of(
    headings: Sequence[tuple[str, str]], outline: Sequence[tuple[str, int]]
) -> list[tuple[str, str, str, int]]:
    """Return (bookmark, text, title in the PDF, page) of each heading, matched in order.

    The PDF's title begins with the number that Word gives a heading by itself. A heading that the outline
    has not is left out.
    """
    titles = []
    at = 0
    for bookmark, text in headings:
        squeezed = squeeze(text)
        for i in range(at, len(outline)):
            if squeeze(outline[i][0]).endswith(squeezed):
                titles.append((bookmark, text, *outline[i]))
                at = i + 1
                break
    return titles


def printed_pages(text: str, entries: Sequence[ContentsEntry]) -> dict[str, str]:
    """Return the page that each line of the tables of contents shows in the PDF's text, by bookmark."""
    pages: dict[str, str] = {}
    at = 0
    for entry in entries:
        if not entry.paged:
            continue
        words = r"\s*".join(re.escape(word) for word in entry.text.split())
        match = re.compile(words + _LABEL).search(text, at)
        if match:
            pages[entry.bookmark] = match[1]
            at = match.end()
    return pages


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


# The PDF of filled documents: converted in one call, tables of contents with the pages of the print.


@dataclass(frozen=True, slots=True, kw_only=True)
class Printed:
    """A document as it is handed over, with the pages in its contents, and its PDF."""

    docx: bytes
    pdf: Path


def print_copies(filled: Sequence[Filled], office: Office, work: Path) -> list[Printed | RenderError]:
    """Convert filled documents in one call; each PDF, or why there is none, in the same order.

    A document whose headings Word numbers by itself is converted twice: the numbers of its contents are
    those of the first PDF.
    """
    positions = range(len(filled))
    pdfs = _converted(
        filled, dict(zip(positions, (report.docx for report in filled), strict=True)), office, work
    )
    again = [
        i
        for i, (report, pdf) in enumerate(zip(filled, pdfs, strict=True))
        if isinstance(pdf, Path) and any(entry.numbered for entry in report.contents.entries)
    ]
    documents = [report.docx for report in filled]
    if again:
        for i in again:
            documents[i] = _numbered(filled[i], pdfs[i])
        second = _converted(filled, {i: documents[i] for i in again}, office, work)
        for i, pdf in zip(again, second, strict=True):
            pdfs[i] = pdf
    return [
        report if isinstance(report, RenderError) else Printed(docx=_paged(own, data, report), pdf=report)
        for own, data, report in zip(filled, documents, pdfs, strict=True)
    ]


def _converted(
    filled: Sequence[Filled], documents: Mapping[int, bytes], office: Office, work: Path
) -> list[Path | RenderError]:
    """Convert documents by their place in ``filled``: no PDF ever takes the name of another document's."""
    sources = []
    for index, data in documents.items():
        report = filled[index]
        source = work / f"{index:04d}.docx"
        source.write_bytes(for_printing(data, report.main_part, contents=bool(report.contents.entries)))
        sources.append(source)
    return office.convert_each(sources, work) if sources else []


def _numbered(filled: Filled, pdf: Path | RenderError) -> bytes:
    if isinstance(pdf, RenderError):
        return filled.docx
    in_outline = titles_of(filled.contents.headings, pdf_outline(pdf))
    numbered = {entry.bookmark for entry in filled.contents.entries if entry.numbered}
    titles = {bookmark: title for bookmark, _, title, _ in in_outline if bookmark in numbered}
    return with_numbers(filled.docx, filled.main_part, titles)


def _paged(filled: Filled, docx: bytes, pdf: Path) -> bytes:
    if not filled.contents.entries:
        return docx
    pages = printed_pages(pdf_text(pdf), filled.contents.entries)
    return with_pages(docx, filled.main_part, pages)
