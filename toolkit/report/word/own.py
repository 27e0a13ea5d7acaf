"""The look of what the toolkit itself writes into a document: its own, whatever the template's styles say.

What must be read (simulated data, a draft, the line of signatures) is no part of the organisation's design:
a template whose default text is white, hidden or two points high would hide it. Every property by which text
can be made unreadable is therefore stated; the font alone is the template's.
"""

from __future__ import annotations

from collections.abc import Iterable

from toolkit.report.word.xml import Element, element, new_run

BLACK, RED, _WHITE = "000000", "B00000", "FFFFFF"
_TEXT = 20  # half-points
_OFF = "i caps smallCaps strike dstrike outline shadow emboss imprint vanish webHidden".split()


def own_paragraph(
    text: str,
    *,
    bold: bool = False,
    before: int = 0,
    colour: str = BLACK,
    half_points: int = _TEXT,
    first: Iterable[Element] = (),
    last: Iterable[Element] = (),
) -> Element:
    """Return a paragraph of its own look.

    Parameters
    ----------
    before : space above it, in twips
    first, last : further properties of the paragraph, before its shading and behind its indentation
    """
    properties = element(
        "w:pPr",
        *first,
        # In the sequence of the schema.
        element("w:shd", val="clear", color="auto", fill=_WHITE),
        element("w:suppressAutoHyphens"),
        element("w:bidi", val=0),
        element("w:spacing", before=before, after=0, line=240, lineRule="auto"),
        element("w:ind", left=0, right=0, firstLine=0),
        *last,
    )
    return element("w:p", properties, new_run(text, _look(bold=bold, colour=colour, half_points=half_points)))


def _look(*, bold: bool, colour: str, half_points: int) -> Element:
    stated = (
        ("w:color", colour), ("w:spacing", 0), ("w:w", 100), ("w:position", 0), ("w:sz", half_points),
        ("w:szCs", half_points), ("w:highlight", "none"), ("w:u", "none"), ("w:effect", "none"),
    )  # fmt: skip
    return element(
        "w:rPr",
        element("w:b", val=int(bold)),
        *(element(f"w:{off}", val=0) for off in _OFF),
        *(element(name, val=value) for name, value in stated),
        element("w:shd", val="clear", color="auto", fill=_WHITE),
        element("w:vertAlign", val="baseline"),
        element("w:specVanish", val=0),
    )
