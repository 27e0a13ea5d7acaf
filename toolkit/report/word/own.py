"""The look of what the toolkit itself writes into a document: its own, whatever the template's styles say.

What must be read (simulated data, a draft, the line of signatures) is no part of the organisation's design:
a template whose default text is white, hidden or two points high would hide it. Every property by which text
can be made unreadable is therefore stated; the font alone is the template's.
"""

from __future__ import annotations

from collections.abc import Iterable

from lxml import etree

from toolkit.report.word.xml import W_P, Element, new_run, q

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
    paragraph = etree.Element(W_P)
    properties = etree.SubElement(paragraph, q("w:pPr"))
    properties.extend(first)
    # In the sequence of the schema.
    properties.append(element("w:shd", val="clear", color="auto", fill=_WHITE))
    properties.append(element("w:suppressAutoHyphens"))
    properties.append(element("w:bidi", val=0))
    properties.append(element("w:spacing", before=before, after=0, line=240, lineRule="auto"))
    properties.append(element("w:ind", left=0, right=0, firstLine=0))
    properties.extend(last)
    paragraph.append(new_run(text, _look(bold=bold, colour=colour, half_points=half_points)))
    return paragraph


def element(name: str, **values: str | int) -> Element:
    """Return an element with attributes, all of WordprocessingML."""
    written = etree.Element(q(name))
    for key, value in values.items():
        written.set(q(f"w:{key}"), str(value))
    return written


def _look(*, bold: bool, colour: str, half_points: int) -> Element:
    look = etree.Element(q("w:rPr"))
    look.append(element("w:b", val=int(bold)))
    look.extend(element(f"w:{off}", val=0) for off in _OFF)
    for name, value in (
        ("w:color", colour), ("w:spacing", 0), ("w:w", 100), ("w:position", 0), ("w:sz", half_points),
        ("w:szCs", half_points), ("w:highlight", "none"), ("w:u", "none"), ("w:effect", "none"),
    ):  # fmt: skip
        look.append(element(name, val=value))
    look.append(element("w:shd", val="clear", color="auto", fill=_WHITE))
    look.append(element("w:vertAlign", val="baseline"))
    look.append(element("w:specVanish", val=0))
    return look
