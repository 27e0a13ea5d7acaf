"""A PDF or a template as a screen shows it: its pages as pictures, and where a hole or a finding is."""

from __future__ import annotations

import html
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from toolkit.report.word import poppler as programs
from toolkit.report.word.package import Template, open_package
from toolkit.report.word.poppler import poppler
from toolkit.report.word.scan import own_rows
from toolkit.report.word.xml import W_P, W_TBL, XML_SPACE, Element, Story, new_run, q, stories, write_back

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
    mark_words = mark.split()
    return tuple(
        SeenPage(width=width, height=height, holes=tuple(_places(words, mark_words)))
        for width, height, words in words_of(pdf)
    )


def words_of(
    pdf: Path, *, raw: bool = False, page: int | None = None
) -> list[tuple[float, float, list[Word]]]:
    """Return the pages of a PDF: width, height [pt] and words; ``raw``: in the order of the print.

    ``page`` is the only one that is asked for, from 1.

    Raises
    ------
    RenderError
        poppler is not installed, or does not end
    """
    only = [] if page is None else ["-f", str(page), "-l", str(page)]
    listing = poppler(["pdftotext", *(["-raw"] if raw else []), "-bbox", *only, str(pdf), "-"])
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


def _places(words: list[Word], mark_words: list[str]) -> list[tuple[float, float, float, float]]:
    places = []
    for at in range(len(words)):
        group = words[at : at + len(mark_words)]
        if mark_words and [word[0] for word in group] == mark_words:
            left, top = min(word[1] for word in group), min(word[2] for word in group)
            right, bottom = max(word[3] for word in group), max(word[4] for word in group)
            places.append((left, top, right - left, bottom - top))
    return places


def page_picture(pdf: Path, page: int) -> bytes:
    """Return one page (from 1) as PNG, as a screen shows it.

    Raises
    ------
    RenderError
        poppler cannot draw it
    """
    return programs.page_picture(pdf, page, dpi=_DPI)


_PLACE = re.compile(r"(paragraph|table) (\d+)(?:, row (\d+))?\Z")
_PLAIN = (
    ("w:caps", "0"), ("w:smallCaps", "0"), ("w:vanish", "0"), ("w:color", "FFFFFF"), ("w:spacing", "0"),
    ("w:w", "100"), ("w:kern", "0"), ("w:position", "0"), ("w:sz", "2"), ("w:szCs", "2"),
)  # fmt: skip
_MARK = re.compile(r"tkmark(\d+)x")


@dataclass(frozen=True, slots=True, kw_only=True)
class MarkedPage:
    """One page, in points; ``marks`` are (number, left, top) of the findings on it, from 1."""

    width: float
    height: float
    marks: tuple[tuple[int, float, float], ...]


def marked_template(template: Template, places: Sequence[tuple[str, str]]) -> bytes:
    """Return a copy of a template with an unseen word at each place (part, place in it) that is one.

    Raises
    ------
    TemplateError
        its parts do not fit together
    """
    package = open_package(template)
    parts = {story.name: story for story in stories(package)}
    targets = [
        (number, paragraph)
        for number, (part, place) in enumerate(places, start=1)
        if part in parts and (paragraph := _paragraph(parts[part], place)) is not None
    ]
    for number, paragraph in targets:
        properties = paragraph.find(q("w:pPr"))
        paragraph.insert(0 if properties is None else 1, _unseen(f"tkmark{number}x "))
    for story in parts.values():
        write_back(story)
    stream = io.BytesIO()
    package.save(stream)
    return stream.getvalue()


def marked_pages(pdf: Path) -> tuple[MarkedPage, ...]:
    """Return the pages of the print of a marked template.

    Raises
    ------
    RenderError
        poppler is not installed, or does not end
    """
    return tuple(
        MarkedPage(
            width=width, height=height,
            marks=tuple(
                (int(mark[1]), left, top)
                for text, left, top, _, _ in words
                for mark in _MARK.finditer(text)
            ),
        )
        for width, height, words in words_of(pdf)
    )  # fmt: skip


def _paragraph(story: Story, place: str) -> Element | None:
    """Return the paragraph at a place of a part, as `scan.place_of` counts them; None where it is none."""
    match = _PLACE.match(place)
    if match is None:
        return None
    elements = list(story.root.iter(W_P if match[1] == "paragraph" else W_TBL))
    element = elements[int(match[2]) - 1] if int(match[2]) <= len(elements) else None
    if element is None or match[3] is None:
        return element if match[1] == "paragraph" else None
    return next(own_rows(element)[int(match[3]) - 1].iter(W_P), None)


def _unseen(text: str) -> Element:
    """Return a run of text too small and too pale to be seen; what its style does to letters is undone."""
    run = new_run(text, None)
    properties = run.makeelement(q("w:rPr"))
    for name, value in _PLAIN:
        properties.append(run.makeelement(q(name), {q("w:val"): value}))
    run.insert(0, properties)
    for element in run.iter(q("w:t")):
        element.set(XML_SPACE, "preserve")
    return run
