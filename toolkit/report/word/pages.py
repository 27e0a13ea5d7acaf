"""Which headers, footers and notes a page can show."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator, Sequence
from typing import Any

from docx.enum.section import WD_HEADER_FOOTER
from lxml import etree

from toolkit.calibration.records.use import DRAFT
from toolkit.recording.marks import output_keywords
from toolkit.report.content import ReportContent
from toolkit.report.word.own import RED, own_paragraph
from toolkit.report.word.scan import LITERAL, visible_texts
from toolkit.report.word.xml import W_P, Element, Story, clean, element, in_fallback, q, switch_is_on
from toolkit.version import __version__

_NOTES = ("footnote", "endnote")


def headers_shown(
    package: Any, parts: list[Story], sections: Sequence[Element] | None = None
) -> tuple[tuple[str, ...], tuple[tuple[str, tuple[str, ...]], ...]]:
    """Return the headers, footers and notes that no page shows, and the headers that some page may show.

    Call it before the template is filled: the words are its own, without tags.

    A section's first page has a header of its own only with ``titlePg``, even pages only where the settings
    ask for them; the others then depend on how many pages there are. ``sections`` are the properties of those
    that count, by default of all.
    """
    main = package.main_document_part
    sections = list(main.element.iter(q("w:sectPr"))) if sections is None else sections
    even = switched_on(getattr(settings_of(main), "element", None), "w:evenAndOddHeaders")
    certain: set[str] = set()
    possible: set[str] = set()
    title_somewhere = any(switched_on(section, "w:titlePg") for section in sections)
    for number, section in enumerate(sections):
        for reference in section.iter(q("w:headerReference"), q("w:footerReference")):
            rel = main.rels.get(reference.get(q("r:id")))
            if rel is None or rel.is_external:
                continue
            name = str(rel.target_part.partname).lstrip("/")
            kind = reference.get(q("w:type")) or "default"
            title = switched_on(section, "w:titlePg")
            # Every document has a first page. A later section may show the first page's header of the one
            # before.
            if (kind == "default" and not even and not title) or (kind == "first" and title and number == 0):
                certain.add(name)
            elif kind == "default" or (kind == "first" and title_somewhere) or (kind == "even" and even):
                possible.add(name)
    own = {story.name: story for story in parts if story.root.tag in (q("w:hdr"), q("w:ftr"))}
    noted = {kind for kind, _ in notes_used(main.element)}
    unseen = {
        story.name
        for story in parts
        for kind in _NOTES
        if story.root.tag == q(f"w:{kind}s") and kind not in noted
    }
    never = tuple(sorted((set(own) - certain - possible) | unseen))
    perhaps = tuple(
        (
            name,
            tuple(
                words
                for p in own[name].root.iter(W_P)
                if not in_fallback(p)
                for words in LITERAL.split("".join(t.text or "" for t in visible_texts(p)))[::2]
            ),
        )
        for name in sorted((possible - certain) & set(own))
    )
    return never, perhaps


def notes_used(body: Any) -> set[tuple[str, str]]:
    """Return (kind, id) of the footnotes and endnotes that a body refers to."""
    return {(kind, one.get(q("w:id")) or "") for kind in _NOTES for one in body.iter(q(f"w:{kind}Reference"))}


def drop_notes(parts: list[Story]) -> None:
    """Take out the footnotes and endnotes that no mark refers to, or none any more: nothing prints them.

    Separators have a type, and stay.
    """
    used = notes_used(parts[0].root)
    for story in parts:
        for kind in _NOTES:
            if story.root.tag != q(f"w:{kind}s"):
                continue
            for note in list(story.root.findall(q(f"w:{kind}"))):
                special = (note.get(q("w:type")) or "normal") != "normal"
                if not special and (kind, note.get(q("w:id")) or "") not in used:
                    story.root.remove(note)


def settings_of(main: Any) -> Any:
    """Return the part with the document's settings, None where it has none."""
    return next(
        (
            rel.target_part
            for rel in main.rels.values()
            if not rel.is_external and rel.reltype.endswith("/settings")
        ),
        None,
    )


def switched_on(element: Any, name: str) -> bool:
    """Tell whether a child that is a switch is on."""
    found = None if element is None else element.find(q(name))
    return found is not None and switch_is_on(found)


# A line that stands on every page of a document, whatever its template: it goes in by the toolkit.


PAGE_MARK = "mark:pages"
_TOP = 300  # twips from the edge of the page: what most printers can print, above most headers
_SIDES = 1100  # twips of the page's width that the frame leaves free
_LETTER = 12240  # twips, where a section states no width
_HALF_POINTS = 16


def mark_pages(package: Any, text: str) -> None:
    """Put a line of text on every page: first, even and odd ones, of every section."""
    main = package.main_document_part
    sections = [
        properties
        for properties in main.element.iter(q("w:sectPr"))
        if properties.getparent().tag != q("w:sectPrChange")
    ]
    if not sections:
        sections = [etree.SubElement(main.element.find(q("w:body")), q("w:sectPr"))]
    headers = {id(element): element for element in _headers(main, sections)}
    for kind in _needed(main, sections):
        # A later section without a header of a kind shows that of the one before it.
        if _reference(sections[0], kind) is None:
            part, identity = main.add_header_part()
            sections[0].add_headerReference(kind, identity)
            headers[id(part.element)] = part.element
    frame = _frame(text, min(_width(section) for section in sections) - _SIDES)
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
    if any(switched_on(section, "w:titlePg") for section in sections):
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
            element
            for element in section.findall(q("w:headerReference"))
            if (element.get(q("w:type")) or "default") == wanted
        ),
        None,
    )


def _width(section: Element) -> int:
    size = section.find(q("w:pgSz"))
    return int((None if size is None else size.get(q("w:w"))) or _LETTER)


def _frame(text: str, width: int) -> Element:
    """Return the frame: a paragraph of its own look, whatever the styles of the template say."""
    borders = element("w:pBdr")
    borders.extend(
        element(f"w:{side}", val="single", sz=4, space=1, color=RED)
        for side in ("top", "left", "bottom", "right")
    )
    place = element(
        "w:framePr", w=width, hSpace=0, wrap="around", vAnchor="page", hAnchor="page", xAlign="center", y=_TOP
    )
    return own_paragraph(
        text, bold=True, colour=RED, half_points=_HALF_POINTS, first=(place, borders),
        last=(element("w:jc", val="center"),),
    )  # fmt: skip


def _insert(header: Element, frame: Element) -> None:
    """Put a copy of the frame before a paragraph, on which it hangs."""
    from copy import deepcopy

    anchor = next((paragraph for paragraph in header if paragraph.tag == W_P), None)
    if anchor is None:
        anchor = etree.SubElement(header, W_P)
    anchor.addprevious(deepcopy(frame))


# Document properties: the report's own title, author and dates in place of python-docx's of 2013.


def set_properties(package: Any, content: ReportContent) -> None:
    """Set title, author and dates; the dates are the day of issue, so that the content is reproducible."""
    _one_core(package)
    core = package.core_properties
    day = dt.datetime.combine(dt.date.fromisoformat(content.issued), dt.time(), tzinfo=dt.UTC).replace(
        tzinfo=None
    )
    title = f"{DRAFT}: {content.title}" if content.draft_reasons else content.title
    core.title, core.author = clean(title)[:255], clean(content.author)[:255]
    core.last_modified_by = f"toolkit {__version__}"
    core.subject = clean(content.subject)[:255]
    core.identifier = content.identity
    # So that a report that lies in a test's folder is never taken for a recording.
    core.keywords = output_keywords(simulated=any(name == "simulated" for name, _ in content.marks))
    core.comments = ""
    core.created = core.modified = day
    core.revision = 1


def _one_core(package: Any) -> None:
    """Let go of properties that stand there under another program's name for their relation.

    LibreOffice writes its own (``officedocument`` in small letters); python-docx does not see it and would
    add a second part of the same name, a file that Word calls damaged.
    """
    from docx.opc.constants import RELATIONSHIP_TYPE

    for identity, relation in list(package.rels.items()):
        if (
            relation.reltype.endswith("/core-properties")
            and relation.reltype != RELATIONSHIP_TYPE.CORE_PROPERTIES
        ):
            del package.rels[identity]
