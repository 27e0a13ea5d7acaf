"""Compare what was meant to be printed with a PDF's text: value by value, table cell by table cell."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from toolkit.report.word.filled import Filled

_SPACE = re.compile("[\\s\u00ad\u200b-\u200f\u202a-\u202e\u2066-\u2069\ufeff]+")
_LONG, _UNBROKEN = 40, 20  # characters of prose, and of one word, that a page's end may cut


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One check: ``ok``, or what was not as it should be. A warning does not stop the delivery."""

    name: str
    ok: bool
    message: str
    warning: bool = False


def squeeze(text: str) -> str:
    """Return text as it is compared: composed, without white space, soft hyphens and direction marks.

    >>> squeeze("1 234,5\\u00ad N")
    '1234,5N'
    """
    return _SPACE.sub("", unicodedata.normalize("NFKC", text))


def text_checks(text: str, filled: Filled) -> list[Check]:
    """Check that every value and table cell is in a PDF's text, a form feed after each page."""
    page = squeeze(text)
    sheets = [squeeze(sheet) for sheet in text.split("\f")]
    rows_left, found = _absent_rows(page, filled.cells, sheets)
    # A tag that no part of the template holds for us, in a diagram or a formula, would be printed as it is.
    meant = squeeze(" ".join(entry.text for entry in filled.manifest))
    left = [tag for tag in re.findall(r"\{\{tk:[^{}]{0,60}", page) if tag not in meant]
    lost, unreadable = [], []
    hidden = _not_printed(filled, page)
    for entry in dict.fromkeys(filled.manifest):
        if entry.text in found or entry.part in hidden:
            continue
        wanted = squeeze(entry.text)
        if not wanted or wanted in page or _in_pieces(wanted, page, entry.text, sheets):
            continue
        plain = "".join(ch for ch in wanted if not _hard_to_extract(ch))
        if plain != wanted and all(squeeze(w) in page for w in _plain_words(entry.text)):
            unreadable.append(entry.tag)
        else:
            lost.append(f"{entry.tag} {entry.text[:40]!r}")
    checks = [
        Check(
            name="values",
            ok=not lost,
            message="; ".join(lost[:5]) or f"{len(filled.manifest)} values found in the PDF",
        ),
        Check(name="literals", ok=not left, message=", ".join(left[:5]) or "no tag is printed"),
        Check(
            name="cells",
            ok=not rows_left,
            message="; ".join(rows_left[:5]) or f"{sum(map(len, filled.cells))} table cells found in the PDF",
        ),
    ]
    if filled.page_mark is not None:
        mark = squeeze(filled.page_mark)
        bare = [str(number) for number, sheet in enumerate(sheets[:-1], start=1) if mark not in sheet]
        said = f"{filled.page_mark[:40]!r} is not on page {', '.join(bare[:5])}"
        checks.append(Check(name="marks", ok=not bare, message=said if bare else "the mark is on every page"))
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
        said = [one for one in (squeeze(word) for word in words) if len(one) > 2]
        said += [squeeze(one.text) for one in filled.manifest if one.part == part]
        if not any(one in page for one in said):
            hidden.add(part)
    return hidden


def _absent_rows(
    page: str, rows: Sequence[Sequence[str]], sheets: Sequence[str]
) -> tuple[list[str], set[str]]:
    """Return the cells of rows that are not in the text in their order, and the cells of those that are."""
    lost: list[str] = []
    found: set[str] = set()
    cursor = 0
    for row in rows:
        joined = squeeze("".join(row))
        at = page.find(joined, cursor)
        if at >= 0:
            cursor = at + len(joined)
            found.update(row)
            continue
        # A row that breaks over a page, or whose cells the PDF paints in another order: cell by cell.
        for cell in row:
            wanted = squeeze(cell)
            if (
                wanted not in page
                and not _in_pieces(wanted, page, cell, sheets)
                and not any(map(_hard_to_extract, wanted))
            ):
                lost.append(cell[:60])
    return lost, found


def _in_pieces(wanted: str, page: str, original: str, sheets: Sequence[str]) -> bool:
    """Tell whether a long text is there, cut by the end of a page: header and footer stand in between.

    A number may not be cut.
    """
    words = original.split()
    if len(words) > 3 and len(wanted) > _LONG:
        return all(squeeze(word) in page for word in words)
    if len(wanted) < _UNBROKEN:
        return False
    # One long word, such as a hash in a narrow column: its beginning on a page, its end on the next.
    for here, there in pairwise(sheets):
        cut = 8
        if wanted[:cut] not in here:
            continue
        while cut < len(wanted) and wanted[: cut + 1] in here:
            cut += 1
        if wanted[cut:] in there:
            return True
    return False


def _hard_to_extract(character: str) -> bool:
    return (
        unicodedata.bidirectional(character) in ("R", "AL", "AN")
        or unicodedata.category(character)
        in (
            "So",
            "Sk",
            "Cn",
            "Co",
            "Mn",
            "Me",
            "Cf",
        )
        or ord(character) > 0xFFFF
    )


def _plain_words(text: str) -> list[str]:
    return [word for word in text.split() if not any(map(_hard_to_extract, word))]
