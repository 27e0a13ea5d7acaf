"""A line that stands on every page of a document, whatever its template: it goes in by the toolkit.

A small frame at the top edge of the page, in every header that a page can show. Frames have a place of their
own: the template's headers and its text stay where they are. A kind of page that has no header gets one.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from docx.enum.section import WD_HEADER_FOOTER
from lxml import etree

from toolkit.report.template.pages import settings_of, switched_on
from toolkit.report.template.xml import W_P, Element, new_run, q

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

PAGE_MARK = "mark:pages"
_TOP = 300  # twips from the edge of the page: what most printers can print, above most headers
_SIDES = 1100  # twips of the page's width that the frame leaves free
_LETTER = 12240  # twips, where a section states no width
_HALF_POINTS = 16
_RED = "B00000"


def mark_pages(package: Any, text: str) -> None:
    """Put a line of text on every page: first, even and odd ones, of every section."""
    main = package.main_document_part
    sections = [one for one in main.element.iter(q("w:sectPr")) if one.getparent().tag != q("w:sectPrChange")]
    if not sections:
        sections = [etree.SubElement(main.element.find(q("w:body")), q("w:sectPr"))]
    headers = {id(one): one for one in _headers(main, sections)}
    for kind in _needed(main, sections):
        # A later section without a header of a kind shows that of the one before it.
        if _reference(sections[0], kind) is None:
            part, identity = main.add_header_part()
            sections[0].add_headerReference(kind, identity)
            headers[id(part.element)] = part.element
    frame = _frame(text, min(_width(one) for one in sections) - _SIDES)
    for header in headers.values():
        _insert(header, frame)


def _headers(main: Any, sections: Sequence[Element]) -> Iterator[Element]:
    for section in sections:
        for reference in section.findall(q("w:headerReference")):
            rel = main.rels.get(reference.get(q("r:id")))
            if rel is not None and not rel.is_external:
                yield rel.target_part.element


def _needed(main: Any, sections: Sequence[Element]) -> Iterator[WD_HEADER_FOOTER]:
    yield WD_HEADER_FOOTER.PRIMARY
    if any(switched_on(one, "w:titlePg") for one in sections):
        yield WD_HEADER_FOOTER.FIRST_PAGE
    if switched_on(getattr(settings_of(main), "element", None), "w:evenAndOddHeaders"):
        yield WD_HEADER_FOOTER.EVEN_PAGE


def _reference(section: Element, kind: WD_HEADER_FOOTER) -> Element | None:
    wanted = {
        WD_HEADER_FOOTER.PRIMARY: "default",
        WD_HEADER_FOOTER.FIRST_PAGE: "first",
        WD_HEADER_FOOTER.EVEN_PAGE: "even",
    }[kind]
    return next(
        (
            one
            for one in section.findall(q("w:headerReference"))
            if (one.get(q("w:type")) or "default") == wanted
        ),
        None,
    )


def _width(section: Element) -> int:
    size = section.find(q("w:pgSz"))
    return int((None if size is None else size.get(q("w:w"))) or _LETTER)


def _frame(text: str, width: int) -> Element:
    """Return the frame: a paragraph of its own look, whatever the styles of the template say."""
    paragraph = etree.Element(W_P)
    properties = etree.SubElement(paragraph, q("w:pPr"))

    def add(parent: Element, name: str, **values: str | int) -> Element:
        made = etree.SubElement(parent, q(name))
        for key, value in values.items():
            made.set(q(f"w:{key}"), str(value))
        return made

    add(
        properties, "w:framePr", w=width, hSpace=0, wrap="around", vAnchor="page", hAnchor="page",
        xAlign="center", y=_TOP,
    )  # fmt: skip
    add(properties, "w:pBdr")
    for side in ("top", "left", "bottom", "right"):
        add(properties[-1], f"w:{side}", val="single", sz=4, space=1, color=_RED)
    add(properties, "w:shd", val="clear", color="auto", fill="FFFFFF")
    add(properties, "w:suppressAutoHyphens")
    add(properties, "w:bidi", val=0)
    add(properties, "w:spacing", before=0, after=0, line=240, lineRule="auto")
    add(properties, "w:ind", left=0, right=0, firstLine=0)
    add(properties, "w:jc", val="center")
    look = etree.Element(q("w:rPr"))
    add(look, "w:b")
    for off in ("i", "caps", "smallCaps", "strike", "vanish"):
        add(look, f"w:{off}", val=0)
    add(look, "w:color", val=_RED)
    add(look, "w:spacing", val=0)
    add(look, "w:sz", val=_HALF_POINTS)
    add(look, "w:u", val="none")
    paragraph.append(new_run(text, look))
    return paragraph


def _insert(header: Element, frame: Element) -> None:
    """Put a copy of the frame before a paragraph, on which it hangs."""
    from copy import deepcopy

    anchor = next((one for one in header if one.tag == W_P), None)
    if anchor is None:
        anchor = etree.SubElement(header, W_P)
    anchor.addprevious(deepcopy(frame))
