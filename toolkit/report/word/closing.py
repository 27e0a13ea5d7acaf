"""The end of a document: its line of signatures, and on the last page the place of the ledger's proof.

The place is empty in the Word file, whose hash the proof holds. In the PDF a QR code is drawn there, where
the words before it stand.
"""

from __future__ import annotations

from pathlib import Path

from toolkit.errors import RenderError
from toolkit.report.content import ReportContent
from toolkit.report.word.own import own_paragraph
from toolkit.report.word.preview import words_of
from toolkit.report.word.xml import W_P, W_SDT, W_T, Element, element, q
from toolkit.trust.seal.qr import Place

LABEL = "Signature"
CAPTION = (
    "This document is an entry of the laboratory's ledger. The code below, in the PDF, proves it; the file "
    "toolkit.json attached to the PDF holds the proof whole."
)
SIZE = 170.0
"""Of the code's square, in points."""
_SPACE, _GAP = 12.0, 4.0  # around the code, in points


def close(body: Element, content: ReportContent, *, signed: bool) -> list[tuple[str, str]]:
    """Write the end of a document; return its texts by what they are.

    It stands before the words by which a template ends the document, where these name it. ``signed``: the
    template has a place of its own for the signatures.
    """
    texts = [] if signed else [("signature", f"{content.style.say(LABEL)}: {content.signature}")]
    texts += [("proof", content.style.say(CAPTION))] if content.symbol else []
    paragraphs = [_paragraph(text) for _, text in texts] + ([_space()] if content.symbol else [])
    at = _end(body, content.identity)
    body[at:at] = paragraphs
    return texts


def place_of_symbol(pdf: Path, page: int, content: ReportContent) -> Place:
    """Return where the code goes on the last page, which is ``page`` (from 1).

    Raises
    ------
    RenderError
        ``proof-place``: the page has no such place, or something stands there
    """
    width, height, words = next(iter(words_of(pdf, page=page)), (0.0, 0.0, []))
    caption, texts = content.style.say(CAPTION).split(), [word[0] for word in words]
    at = next((at for at in reversed(range(len(texts))) if texts[at : at + len(caption)] == caption), None)
    if at is None:
        raise _without("its words are not on the last page")
    of_caption = words[at : at + len(caption)]
    x, top = min(word[1] for word in of_caption), max(word[4] for word in of_caption) + _GAP
    right, bottom = x + SIZE, top + SIZE
    inside = [text for text, x0, y0, x1, y1 in words if x0 < right and x1 > x and y0 < bottom and y1 > top]
    if inside or bottom > height or right > width:
        raise _without(f"{' '.join(inside[:5])!r} stands there" if inside else "the page ends there")
    return Place(page=page - 1, left=x, top=top, size=SIZE)


def _end(body: Element, identity: str) -> int:
    """Return where the end of a body begins: its last words that name the document, or its last section."""
    at = len(body) - (len(body) > 0 and body[-1].tag == q("w:sectPr"))
    last = next((place for place in reversed(range(at)) if _words(body[place])), None)
    if last is not None and body[last].tag in (W_P, W_SDT) and identity and identity in _words(body[last]):
        return last
    return at


def _words(element: Element) -> str:
    return "".join(text.text or "" for text in element.iter(W_T)).strip()


def _paragraph(text: str) -> Element:
    together = (element("w:keepNext"), element("w:keepLines"))
    return own_paragraph(text, before=round(20 * _SPACE), first=together)


def _space() -> Element:
    spacing = element("w:spacing", line=round(20 * (SIZE + _SPACE)), lineRule="exact")
    return element("w:p", element("w:pPr", element("w:keepNext"), spacing))


def _without(got: str) -> RenderError:
    return RenderError(
        "the PDF has no place for the ledger's proof", where="last page", got=got,
        expected="the words that end the document, and an empty place below them",
        next_step="take away what the template puts at the end of its last page; nothing was issued",
        rule="proof-place",
    )  # fmt: skip
