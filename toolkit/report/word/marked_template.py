"""A template as a screen shows it: its pages as they lie there, and where on them each finding stands.

A finding says its part and its place in it, as ``table 2, row 3``. A word that nobody sees is put there, the
copy is printed by LibreOffice, and the page tells where the word came to lie.
"""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from toolkit.report.word.package import Template, open_package
from toolkit.report.word.preview import words_of
from toolkit.report.word.scan import own_rows
from toolkit.report.word.xml import W_P, W_TBL, XML_SPACE, Element, Story, new_run, q, stories, write_back

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
