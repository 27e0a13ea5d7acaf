"""Whether what must be read in a PDF can be read: its words as large and as dark as people need them.

The text of a PDF holds white words, words of a point and words under a picture as well as any others. The
properties of a template that make them so are without end (a colour, the shading of a cell, a theme, the
scale of letters, a row of no height, a shape before the text), but what is printed is one thing: the places
of the words say how large they are, and the drawn page whether there is ink at those places that departs
from what is around it.
"""

from __future__ import annotations

import io
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import accumulate
from pathlib import Path

import numpy as np

from toolkit.arrays import Array
from toolkit.inputs import PDF_FILE, read_input
from toolkit.report.word.poppler import page_picture
from toolkit.report.word.preview import Word, words_of
from toolkit.report.word.toc_pages import squeeze

_LEAST = 4.0
"""Points from the top to the bottom of a line's letters: of a font of some 3.5 points."""
_NARROW = 0.15
"""Of their height, which letters have at least in width, on average: the narrowest fonts have 0.3."""
_CONTRAST = 1.5
"""Of luminances, by WCAG 2: light grey on white has 1.7; it asks for 4.5 where reading is comfortable."""
_SPREAD = 0.2
"""Of the rows and of the columns of a word's place that have ink, the strokes across it left out."""
_STROKE = 0.95
"""Of a row or column that has ink: a border, an underline, the edge of a shading, but no letters."""
_DPI = 144


@dataclass(frozen=True, slots=True, kw_only=True)
class Page:
    """A page's words in the order of the print, and where each begins in their joined text."""

    number: int
    words: tuple[Word, ...]
    text: str
    begins: tuple[int, ...]


class Print:
    """A PDF as it is seen; pages are drawn when they are asked for.

    Raises
    ------
    RenderError
        ``no-poppler``: poppler is not installed, or cannot draw a page
    """

    def __init__(self, pdf: Path, folder: Path) -> None:
        # Without PDF/A's colour profile, as `toolkit.report.word.toc_pages.pdf_text` has it.
        self.pdf = folder / "seen.pdf"
        self.pdf.write_bytes(read_input(pdf, PDF_FILE).replace(b"/OutputIntents", b"/OutputIntent_"))
        self.pages = tuple(_page(n, words) for n, (_, _, words) in enumerate(words_of(self.pdf, raw=True), 1))
        self.drawn = cache(self._draw)

    def unreadable(self, text: str, *, on_every_page: bool = False) -> str:
        """Return why a text can be read nowhere, or not on every page; empty where it can."""
        reasons = []
        for page in self.pages:
            why = self._on(page, text)
            if why == "" and not on_every_page:
                return ""
            if why:
                reasons.append(f"page {page.number}: {why}")
        return reasons[0] if reasons else ""

    def _on(self, page: Page, text: str) -> str | None:
        # None where the page does not hold the text.
        why = None
        for words in _places(page, squeeze(text)):
            why = self._why(page, words)
            if not why:
                return ""
        if why is None and len(parts := text.split()) > 1:
            # In pieces, as in a narrow cell beside another: word by word.
            of_parts = [self._on(page, part) for part in parts]
            if any(one is None for one in of_parts):
                return None
            return next(filter(None, of_parts), "")
        return why

    def _why(self, page: Page, words: Sequence[Word]) -> str:
        for text, left, top, right, bottom in words:
            if not any(map(str.isalnum, text)):
                continue  # a sign between words has little ink
            short, long = sorted((right - left, bottom - top))
            size = short if len(text) > 2 else long
            if size < _LEAST or long < _NARROW * len(text) * short:
                return f"{text[:20]!r} is {right - left:.1f} by {bottom - top:.1f} points"
            if not _inked(self.drawn(page.number), left, top, right, bottom):
                return f"{text[:20]!r} hardly differs from what is behind it, or is covered"
        return ""

    def _draw(self, number: int) -> Array:
        """Return the luminance of a page, 0 to 1 (rows, columns)."""
        from PIL import Image

        picture = page_picture(self.pdf, number, dpi=_DPI, png=False)
        with Image.open(io.BytesIO(picture)) as image:
            colours = np.asarray(image.convert("RGB"), dtype=np.uint8)
        return np.asarray(_LINEAR[colours] @ np.array([0.2126, 0.7152, 0.0722]))


def seen(pdf: Path, texts: Sequence[str], everywhere: str | None) -> Iterator[tuple[str, str]]:
    """Yield (text, why) of what can be read nowhere, and of ``everywhere`` where a page hides it."""
    with tempfile.TemporaryDirectory(prefix="toolkit-seen-") as folder:
        print_ = Print(pdf, Path(folder))
        for text in dict.fromkeys(texts):
            if why := print_.unreadable(text):
                yield text, why
        if everywhere is not None and (why := print_.unreadable(everywhere, on_every_page=True)):
            yield everywhere, why


def _page(number: int, words: list[Word]) -> Page:
    texts = [squeeze(word[0]) for word in words]
    begins = tuple(accumulate(map(len, texts[:-1]), initial=0)) if texts else ()
    return Page(number=number, words=tuple(words), text="".join(texts), begins=begins)


def _places(page: Page, text: str) -> Iterator[tuple[Word, ...]]:
    """Yield the words that hold a text, at each place of the page where it stands."""
    at = page.text.find(text) if text else -1
    while at >= 0:
        first = int(np.searchsorted(page.begins, at, side="right")) - 1
        last = int(np.searchsorted(page.begins, at + len(text), side="left"))
        yield page.words[first:last]
        at = page.text.find(text, at + 1)


def _inked(page: Array, left: float, top: float, right: float, bottom: float) -> bool:
    """Tell whether there is ink at a place [pt] that departs from what is around it, as letters do."""
    scale = _DPI / 72
    rows = slice(max(int(top * scale), 0), max(int(np.ceil(bottom * scale)), 1))
    columns = slice(max(int(left * scale), 0), max(int(np.ceil(right * scale)), 1))
    place = page[rows, columns]
    if not place.size:
        return False  # beyond the edge of the page
    levels, counts = np.unique(place.round(2), return_counts=True)
    behind = levels[np.argmax(counts)]
    lighter, darker = np.maximum(place, behind), np.minimum(place, behind)
    ink = (lighter + 0.05) / (darker + 0.05) >= _CONTRAST
    ink = ink & (ink.mean(axis=1, keepdims=True) < _STROKE) & (ink.mean(axis=0, keepdims=True) < _STROKE)
    return bool(min(ink.any(axis=1).mean(), ink.any(axis=0).mean()) >= _SPREAD)


def _linear() -> Array:
    """Return the luminance of each of the 256 levels of a colour of sRGB (IEC 61966-2-1)."""
    level = np.arange(256) / 255
    return np.where(level <= 0.04045, level / 12.92, ((level + 0.055) / 1.055) ** 2.4)


_LINEAR = _linear()
