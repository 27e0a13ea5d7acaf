"""A delivered PDF as a screen shows it: its pages as pictures, and where a hole was printed."""

from __future__ import annotations

import html
import re
import subprocess
from dataclasses import dataclass
from pathlib import Path

from toolkit.errors import RenderError
from toolkit.report.word.contents_pages import poppler

_PAGE = re.compile(r'<page width="([0-9.]+)" height="([0-9.]+)">(.*?)</page>', re.DOTALL)
_WORD = re.compile(
    r'<word xMin="([0-9.-]+)" yMin="([0-9.-]+)" xMax="([0-9.-]+)" yMax="([0-9.-]+)">(.*?)</word>'
)
_DPI = 110

Word = tuple[str, float, float, float, float]
"""A word of a page: its text, and left, top, right and bottom [pt]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SeenPage:
    """One page, in points; ``holes`` are (left, top, width, height) of each mark that stands for a value."""

    width: float
    height: float
    holes: tuple[tuple[float, float, float, float], ...]


def pages_of(pdf: Path, mark: str) -> tuple[SeenPage, ...]:
    """Return the pages of a PDF with the places of a mark, such as ``n/a``.

    Raises
    ------
    RenderError
        poppler is not installed, or does not end
    """
    wanted = mark.split()
    return tuple(
        SeenPage(width=width, height=height, holes=tuple(_places(words, wanted)))
        for width, height, words in words_of(pdf)
    )


def words_of(pdf: Path) -> list[tuple[float, float, list[Word]]]:
    """Return the pages of a PDF: width, height [pt] and words.

    Raises
    ------
    RenderError
        poppler is not installed, or does not end
    """
    listing = poppler(["pdftotext", "-bbox", str(pdf), "-"])
    return [
        (
            float(width),
            float(height),
            [
                (html.unescape(text), float(left), float(top), float(right), float(bottom))
                for left, top, right, bottom, text in _WORD.findall(words)
            ],
        )
        for width, height, words in _PAGE.findall(listing)
    ]


def _places(words: list[Word], wanted: list[str]) -> list[tuple[float, float, float, float]]:
    places = []
    for at in range(len(words)):
        group = words[at : at + len(wanted)]
        if wanted and [word[0] for word in group] == wanted:
            left, top = min(word[1] for word in group), min(word[2] for word in group)
            right, bottom = max(word[3] for word in group), max(word[4] for word in group)
            places.append((left, top, right - left, bottom - top))
    return places


def page_picture(pdf: Path, page: int) -> bytes:
    """Return one page (from 1) as PNG.

    Raises
    ------
    RenderError
        ``no-poppler``: poppler cannot draw it
    """
    words = ["pdftoppm", "-png", "-r", str(_DPI), "-f", str(page), "-l", str(page), "-singlefile", str(pdf)]
    try:
        done = subprocess.run(words, capture_output=True, timeout=120, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise _not_drawn(pdf, page, str(error)) from error
    if done.returncode or not done.stdout:
        raise _not_drawn(pdf, page, done.stderr.decode(errors="replace")[:500] or "nothing")
    return done.stdout


def _not_drawn(pdf: Path, page: int, got: str) -> RenderError:
    return RenderError(
        "a page cannot be drawn", where=f"{pdf}, page {page}", got=got, expected="a picture by pdftoppm",
        next_step="run 'toolkit doctor': it prints what installs poppler-utils", rule="no-poppler",
    )  # fmt: skip
