"""Verify a filled report: what was meant to be printed is in the document and in its PDF."""

from __future__ import annotations

import io
import re
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from toolkit.inputs import PDF_FILE, read_input
from toolkit.report.word.contents_pages import pdf_outline, pdf_text, poppler, printed_pages, titles_of
from toolkit.report.word.filled import Filled, text_elements
from toolkit.report.word.scan import BROKEN, LITERAL, control_tag
from toolkit.report.word.verify_text import Check, text_checks
from toolkit.report.word.xml import SDT_PR, W_P, W_SDT, clean, in_fallback, paragraph_text, q


def verify_docx(filled: Filled) -> tuple[Check, ...]:
    """Check the filled Word file itself: placeholders gone, every figure there with its text."""
    values = " ".join(entry.text for entry in filled.manifest)
    left, alts = [], []
    for element in text_elements(filled.docx, filled.main_part):
        if element.tag == W_P:
            text = paragraph_text(element)
            if "{{" not in text:
                continue
            left += [m[0] for m in LITERAL.finditer(text) if m[0] not in values]
            if BROKEN.search(text) and "{{" not in values:
                left.append(text[:40])
        elif element.tag == W_SDT:
            tag = control_tag(element)
            if tag is not None and (
                tag.family == "if" or element.find(f"{SDT_PR}/{q('w:showingPlcHdr')}") is not None
            ):
                left.append(str(tag))
        elif not in_fallback(element):
            alts.append(element.get("descr") or "")
    absent = [
        tag
        for tag, alt in filled.figures
        if " ".join(alt.split()) not in {" ".join(alt.split()) for alt in alts}
    ]
    return (
        Check(name="placeholders", ok=not left, message=", ".join(left[:5]) or "none left"),
        Check(
            name="alt-text",
            ok=not absent and all(alt for _, alt in filled.figures),
            message=", ".join(absent) or f"{len(filled.figures)} figures with alternative text",
        ),
    )


def verify_pdf(pdf: Path, filled: Filled) -> tuple[tuple[Check, ...], int]:
    """Check the PDF and return the checks and its number of pages.

    Raises
    ------
    RenderError
        poppler's programs are not installed
    """
    info = poppler(["pdfinfo", str(pdf)])
    found = re.search(r"^Pages:\s+(\d+)", info, re.MULTILINE)
    pages = int(found[1]) if found else 0
    data = read_input(pdf, PDF_FILE)
    with ThreadPoolExecutor(2) as pool:
        fonts = pool.submit(poppler, ["pdffonts", str(pdf)])
        text = pdf_text(pdf)
        listing = fonts.result()
    pictures = data.count(b"/Subtype/Image")
    # Headers and footers are artifacts of a tagged PDF: nothing in them has a text beside it.
    mute = [
        tag for tag, alt in filled.figures if tag not in filled.in_margins and _pdf_string(alt) not in data
    ]
    return (
        (
            *text_checks(text, filled),
            *_contents(pdf, text, filled),
            *_margins(filled),
            _fonts(listing),
            Check(name="pages", ok=pages > 0 and text.count("\f") == pages, message=f"{pages} pages"),
            Check(
                name="figures",
                ok=pictures >= len({tag for tag, _ in filled.figures}) and not mute,
                message=f"no alternative text in the PDF for {', '.join(mute)}"
                if mute
                else f"{pictures} pictures in the PDF, {len(filled.figures)} figures in the report",
            ),
            Check(
                name="archive",
                ok=b"pdfaid" in data and b"pdfuaid" in data and "yes" in _line(info, "Tagged"),
                message="PDF/A-2 and PDF/UA-1, tagged" if b"pdfaid" in data else "not PDF/A",
            ),
        ),
        pages,
    )


def _margins(filled: Filled) -> list[Check]:
    if not filled.in_margins:
        return []
    return [
        Check(
            name="margins",
            ok=False,
            warning=True,
            message=f"{', '.join(sorted(filled.in_margins))} stands in a header or footer: the Word file has "
            "its alternative text, a tagged PDF has none there",
        )
    ]


def _contents(pdf: Path, text: str, filled: Filled) -> list[Check]:
    if not filled.contents.entries:
        return []
    problems = contents_problems(pdf, text, filled)
    lines = len(filled.contents.entries)
    return [
        Check(
            name="contents",
            ok=not problems,
            message="; ".join(problems[:5]) or f"{lines} lines of contents with the pages of the print",
        )
    ]


def _pdf_string(text: str) -> bytes:
    # LibreOffice writes alternative texts as UTF-16 in hexadecimal, in objects that are not packed.
    plain = clean(text).replace("\n", " ")
    return b"<FEFF" + plain.encode("utf-16-be").hex().upper().encode() + b">"


def _fonts(listing: str) -> Check:
    loose = []
    for line in listing.splitlines()[2:]:
        # name  type  encoding  emb sub uni  object ID: the flags are the last three words before two numbers.
        words = line.split()
        if len(words) >= 6 and words[-5] != "yes":
            loose.append(words[0])
    return Check(name="fonts", ok=not loose, message=", ".join(loose) or "all fonts embedded")


def _line(info: str, name: str) -> str:
    return next((line for line in info.splitlines() if line.startswith(name)), "")


# Verify the tables of contents: their lines equal the headings, their pages those of the print.


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
