"""Verify a filled report: what was meant to be printed is in the document and in its PDF."""

from __future__ import annotations

import codecs
import io
import re
import zipfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from toolkit.inputs import PDF_FILE, read_input
from toolkit.report.word.filled import Filled, text_elements
from toolkit.report.word.fonts import undrawn
from toolkit.report.word.legible import seen
from toolkit.report.word.pages import PAGE_MARK
from toolkit.report.word.poppler import poppler
from toolkit.report.word.printed import hard_to_extract, unprinted
from toolkit.report.word.scan import BROKEN, LITERAL, control_tag
from toolkit.report.word.toc_pages import pdf_outline, pdf_text, printed_pages, squeeze, titles_of
from toolkit.report.word.xml import SDT_PR, W_P, W_SDT, clean, in_fallback, paragraph_text, q

_LONG, _UNBROKEN = 40, 20  # characters of prose, and of one word, that a page's end may cut


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One check: ``ok``, or what was not as it should be. A warning does not stop the delivery."""

    name: str
    ok: bool
    message: str
    warning: bool = False


def text_checks(text: str, filled: Filled) -> list[Check]:
    """Check that every value and table cell is in a PDF's text, a form feed after each page."""
    page = squeeze(text)
    sheets = [squeeze(sheet) for sheet in text.split("\f")]
    rows_left, printed = _absent_rows(page, filled.cells, sheets)
    # A tag that no part of the template holds for us, in a diagram or a formula, would be printed as it is.
    printed_text = squeeze(" ".join(entry.text for entry in filled.manifest))
    unfilled = [tag for tag in re.findall(r"\{\{tk:[^{}]{0,60}", page) if tag not in printed_text]
    lost, unreadable = [], []
    hidden = _not_printed(filled, page)
    shown = [entry for entry in filled.manifest if entry.part not in hidden]
    for entry in dict.fromkeys(shown):
        if entry.text in printed:
            continue
        value = squeeze(entry.text)
        if not value or value in page or _in_pieces(value, page, entry.text, sheets):
            continue
        plain = "".join(ch for ch in value if not hard_to_extract(ch))
        if plain != value and all(squeeze(w) in page for w in _plain_words(entry.text)):
            unreadable.append(entry.tag)
        else:
            lost.append(f"{entry.tag} {entry.text[:40]!r}")
    checks = [
        Check(
            name="values", ok=not lost, message="; ".join(lost[:5]) or f"{len(shown)} values found in the PDF"
        ),
        *_required(filled, hidden),
        Check(name="literals", ok=not unfilled, message=", ".join(unfilled[:5]) or "no tag is printed"),
        Check(
            name="cells",
            ok=not rows_left,
            message="; ".join(rows_left[:5]) or f"{sum(map(len, filled.cells))} table cells found in the PDF",
        ),
    ]
    if filled.page_mark is not None:
        mark = squeeze(filled.page_mark)
        bare = [str(number) for number, sheet in enumerate(sheets[:-1], start=1) if mark not in sheet]
        message = f"{filled.page_mark[:40]!r} is not on page {', '.join(bare[:5])}"
        checks.append(
            Check(name="marks", ok=not bare, message=message if bare else "the mark is on every page")
        )
    if unreadable:
        checks.append(
            Check(
                name="script",
                ok=False,
                warning=True,
                message=f"{', '.join(unreadable[:5])}: characters that no installed font shows, "
                "or that run from right to left, could not be read back from the PDF",
            )
        )
    return checks


def _not_printed(filled: Filled, page: str) -> set[str]:
    """Return the headers and footers that no page shows: of first or even pages that there are not.

    Which of them a page shows follows from the document's settings and its number of pages. One that may
    be hidden is taken as hidden where neither its own words nor any of its values are in the PDF.
    """
    hidden = set(filled.never_shown)
    for part, words in filled.perhaps_shown:
        texts = [word_text for word_text in (squeeze(word) for word in words) if len(word_text) > 2]
        texts += [squeeze(word_text.text) for word_text in filled.manifest if word_text.part == part]
        if not any(word_text in page for word_text in texts):
            hidden.add(part)
    return hidden


def _required(filled: Filled, hidden: set[str]) -> list[Check]:
    """Check that each tag that the document must show stands in a part that the pages show.

    Whether it is found there is asked of every value alike; a part that no page shows is not asked.
    """
    if not filled.demanded:
        return []
    places = [(entry.tag, entry.part) for entry in filled.manifest] + list(filled.drawn_in)
    shown = {tag for tag, part in places if part not in hidden}
    # A table is in the manifest by its columns; a condition, and the pattern of a row, print nothing.
    absent = [
        tag
        for tag in filled.demanded
        if not tag.startswith(("tk:if.", "tk:row."))
        and tag not in shown
        and not any(name.startswith(f"{tag}.") for name in shown)
    ]
    message = f"no page shows the required {', '.join(absent)}" if absent else ""
    return [
        Check(
            name="required",
            ok=not absent,
            message=message or f"{len(filled.demanded)} required tags stand on the pages",
        )
    ]


def _absent_rows(
    page: str, rows: Sequence[Sequence[str]], sheets: Sequence[str]
) -> tuple[list[str], set[str]]:
    """Return the cells of rows that are not in the text in their order, and the cells of those that are."""
    lost: list[str] = []
    cells_in_rows: set[str] = set()
    cursor = 0
    for row in rows:
        joined = squeeze("".join(row))
        at = page.find(joined, cursor)
        if at >= 0:
            cursor = at + len(joined)
            cells_in_rows.update(row)
            continue
        # A row that breaks over a page, or whose cells the PDF paints in another order: cell by cell.
        for cell in row:
            value = squeeze(cell)
            if (
                value not in page
                and not _in_pieces(value, page, cell, sheets)
                and not any(map(hard_to_extract, value))
            ):
                lost.append(cell[:60])
    return lost, cells_in_rows


def _in_pieces(value: str, page: str, original: str, sheets: Sequence[str]) -> bool:
    """Tell whether a long text is there, cut by the end of a page: header and footer stand in between.

    A number may not be cut.
    """
    words = original.split()
    if len(words) > 3 and len(value) > _LONG:
        return all(squeeze(word) in page for word in words)
    if len(value) < _UNBROKEN:
        return False
    # One long word, such as a hash in a narrow column: its beginning on a page, its end on the next.
    for sheet, following in pairwise(sheets):
        cut = 8
        if value[:cut] not in sheet:
            continue
        while cut < len(value) and value[: cut + 1] in sheet:
            cut += 1
        if value[cut:] in following:
            return True
    return False


def _plain_words(text: str) -> list[str]:
    return [word for word in text.split() if not any(map(hard_to_extract, word))]


def verify_docx(filled: Filled) -> tuple[Check, ...]:
    """Check the filled Word file itself: placeholders gone, every figure there with its text."""
    values = " ".join(entry.text for entry in filled.manifest)
    unfilled, alts = [], []
    for element in text_elements(filled.docx, filled.main_part):
        if element.tag == W_P:
            text = paragraph_text(element)
            if "{{" not in text:
                continue
            unfilled += [m[0] for m in LITERAL.finditer(text) if m[0] not in values]
            if BROKEN.search(text) and "{{" not in values:
                unfilled.append(text[:40])
        elif element.tag == W_SDT:
            tag = control_tag(element)
            if tag is not None and (
                tag.family == "if" or element.find(f"{SDT_PR}/{q('w:showingPlcHdr')}") is not None
            ):
                unfilled.append(str(tag))
        elif not in_fallback(element):
            alts.append(element.get("descr") or "")
    absent = [
        tag
        for tag, alt in filled.figures
        if " ".join(alt.split()) not in {" ".join(alt.split()) for alt in alts}
    ]
    return (
        Check(name="placeholders", ok=not unfilled, message=", ".join(unfilled[:5]) or "none left"),
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
    pages_line = re.search(r"^Pages:\s+(\d+)", info, re.MULTILINE)
    pages = int(pages_line[1]) if pages_line else 0
    data = read_input(pdf, PDF_FILE)
    with ThreadPoolExecutor(2) as pool:
        fonts = pool.submit(poppler, ["pdffonts", str(pdf)])
        text = pdf_text(pdf)
        listing = fonts.result()
    pictures = data.count(b"/Subtype/Image")
    readings = _Readings(pdf, text)
    hidden = _not_printed(filled, squeeze(text))
    # Headers and footers are artifacts of a tagged PDF: nothing in them has a text beside it.
    mute = [
        tag
        for tag, alt in filled.figures
        if tag not in filled.in_margins and not any(text in data for text in _pdf_strings(alt))
    ]
    drawn = {tag for tag, _ in filled.figures} - {chart.tag for chart in filled.charts}
    return (
        (
            *_in_some_reading(readings, filled),
            _printed(readings, filled, hidden),
            *_contents(pdf, text, filled),
            *_margins(filled),
            *_charts(text, filled),
            _legible(pdf, filled, hidden),
            _fonts(listing),
            *_glyphs(text, filled),
            Check(name="pages", ok=pages > 0 and text.count("\f") == pages, message=f"{pages} pages"),
            Check(
                name="figures",
                ok=pictures >= len(drawn) and not mute,
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


class _Readings(Sequence[str]):
    """A PDF's text in the order in which it was painted, then as it lies on the page, read when needed.

    A glyph of another font, which a line of one font lacks, is painted after the line.
    """

    def __init__(self, pdf: Path, text: str) -> None:
        self._pdf, self._texts = pdf, [text]

    def __len__(self) -> int:
        return 2

    def __getitem__(self, index: Any) -> Any:
        if index == 1 and len(self._texts) == 1:
            self._texts.append(pdf_text(self._pdf, layout=True))
        return self._texts[index]


def _in_some_reading(readings: Sequence[str], filled: Filled) -> list[Check]:
    checks = text_checks(readings[0], filled)
    if all(check.ok or check.warning for check in checks):
        return checks
    return text_checks(readings[0] + readings[1], filled)


def _printed(readings: Sequence[str], filled: Filled, hidden: set[str]) -> Check:
    problems = unprinted(filled, hidden, readings)
    message = "; ".join(problems[:5]) or "each text of the Word file has its place in the PDF"
    return Check(name="texts", ok=not problems, message=f"not printed: {message}" if problems else message)


def _legible(pdf: Path, filled: Filled, hidden: set[str]) -> Check:
    texts = {
        entry.text: entry.tag
        for entry in filled.manifest
        if entry.tag in filled.to_be_read and entry.text != filled.page_mark and entry.part not in hidden
    }
    unreadable = [
        f"{texts.get(text, PAGE_MARK)} {text[:40]!r} cannot be read: {why}"
        for text, why in seen(pdf, tuple(texts), filled.page_mark)
    ]
    message = "; ".join(unreadable[:5]) or f"{len(texts)} texts that must be read are large and dark enough"
    return Check(name="legible", ok=not unreadable, message=message)


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


def _charts(text: str, filled: Filled) -> list[Check]:
    if not filled.charts:
        return []
    page = squeeze(text)
    lost = [
        f"{chart.tag} {name[:40]!r}"
        for chart in filled.charts
        for name in chart.texts
        if squeeze(name) not in page and not any(map(hard_to_extract, name))
    ]
    message = f"the axes and series of {len(filled.charts)} charts are in the PDF"
    return [Check(name="charts", ok=not lost, message="; ".join(lost[:5]) or message)]


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


def _pdf_strings(text: str) -> tuple[bytes, bytes]:
    # Alternative texts stand as UTF-16 in hexadecimal in objects that are not packed: in capital letters by
    # LibreOffice, in small ones where `toolkit.report.word.chart` wrote them.
    written = b"<" + (codecs.BOM_UTF16_BE + clean(text).replace("\n", " ").encode("utf-16-be")).hex().encode()
    return written.upper() + b">", written + b">"


def _fonts(listing: str) -> Check:
    loose = []
    for line in listing.splitlines()[2:]:
        # name  type  encoding  emb sub uni  object ID: the flags are the last three words before two numbers.
        words = line.split()
        if len(words) >= 6 and words[-5] != "yes":
            loose.append(words[0])
    return Check(name="fonts", ok=not loose, message=", ".join(loose) or "all fonts embedded")


def _glyphs(text: str, filled: Filled) -> list[Check]:
    """Warn of characters that are printed as empty boxes: a PDF's text holds them nevertheless."""
    boxes = undrawn(text + "".join(entry.text for entry in filled.manifest))
    if not boxes:
        return []
    message = f"no installed font has {', '.join(boxes[:5])}: empty boxes are printed"
    return [Check(name="glyphs", ok=False, warning=True, message=message)]


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
    titles = titles_of(contents.headings, pdf_outline(pdf))
    pages = {bookmark: page for bookmark, _, _, page in titles}
    problems = []
    if len(titles) < len(contents.headings):
        outlined = {title for _, title, _, _ in titles}
        problems += [
            f"heading {title!r} is not in the PDF" for _, title in contents.headings if title not in outlined
        ]
        problems = problems or ["a heading is not in the PDF"]
    printed = printed_pages(text, contents.entries)
    plain = not _restarts(filled)
    for entry in contents.entries:
        if not entry.paged or not entry.text.isascii():
            continue
        printed_page = printed.get(entry.bookmark)
        if printed_page is None:
            problems.append(f"{entry.text!r} is not in the contents")
        elif entry.heading and plain and printed_page != str(pages.get(entry.bookmark, printed_page)):
            problems.append(
                f"{entry.text!r} is on page {pages[entry.bookmark]}, the contents say {printed_page}"
            )
    return problems


def _restarts(filled: Filled) -> bool:
    # A document that counts its pages otherwise than 1, 2, 3 shows labels, not numbers of pages.
    with zipfile.ZipFile(io.BytesIO(filled.docx)) as archive:
        xml = archive.read(filled.main_part)
    return re.search(rb"<w:pgNumType[^>]*w:(?:start|fmt)=", xml) is not None
