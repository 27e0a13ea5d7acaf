"""Tables of contents and of figures: written anew from the headings and captions that a report has.

LibreOffice takes what stands in such a field as it is. So the entries are written here, each with a PAGEREF
field; for the PDF the field around them is left out, and then LibreOffice works the pages out itself. The
pages that it found go back into the Word file.
"""

from __future__ import annotations

import re
from copy import deepcopy
from dataclasses import dataclass
from itertools import count

from toolkit.report.word.fields import CHAR, CODE, Field, fields_of
from toolkit.report.word.styles import StyleSheet, headings, style_of
from toolkit.report.word.xml import (
    P_PR,
    W_P,
    Element,
    ancestor,
    element,
    field_mark,
    in_fallback,
    paragraph_text,
    q,
    text_run,
)

_BEFORE_TABS = (
    "pStyle keepNext keepLines pageBreakBefore framePr widowControl numPr suppressLineNumbers pBdr shd"
)
_INDENT = 220  # twips a level, where the template has no style for an entry


@dataclass(frozen=True, slots=True, kw_only=True)
class ContentsEntry:
    """One line of a table of contents: the bookmark it points at, its text, its level.

    ``heading`` tells an entry of the headings from one of a list of figures; ``numbered`` that Word puts a
    number before it; ``paged`` that the line ends with a page.
    """

    bookmark: str
    text: str
    level: int
    heading: bool
    numbered: bool
    paged: bool


def contents_fields(root: Element) -> list[Field]:
    """Return the TOC fields of a body, in their order."""
    return [field for field in fields_of(root) if field.words[0] == "TOC" and field.end is not None]


def can_update(field: Field) -> bool:
    """Tell whether the field's switches and place are among those that are written here.

    Not: entries marked by TC fields (``\\f``, ``\\l``), or from one bookmark only (``\\b``).
    """
    return (
        field.paragraphs is not None
        and not in_fallback(field.begin)
        and ancestor(field.begin, q("w:txbxContent")) is None
        and re.search(r"\\[bfl]\b", field.code) is None
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Contents:
    """What was written: the lines, table by table, and every heading as (bookmark or empty, text)."""

    entries: tuple[ContentsEntry, ...] = ()
    headings: tuple[tuple[str, str], ...] = ()


def write_contents(package: object, root: Element) -> Contents:
    """Write every table of contents of a body anew.

    Parameters
    ----------
    package : the opened package, for its styles
    root : the body's tree, filled, its captions numbered
    """
    fields = [contents_field for contents_field in contents_fields(root) if can_update(contents_field)]
    if not fields:
        return Contents()
    sheet, marks = StyleSheet.of(package), _Bookmarks(root)
    entries: list[ContentsEntry] = []
    for field in fields:
        field_entries = _entries(field, root, sheet, marks)
        _rewrite(field, field_entries, sheet, root)
        entries += field_entries
    bookmarks = {id(p): name for p, name in marks.given}
    return Contents(
        entries=tuple(entries),
        headings=tuple(
            (bookmarks.get(id(heading.element), ""), heading.text) for heading in headings(root, sheet)
        ),
    )


class _Bookmarks:
    """Bookmarks for the paragraphs that are pointed at: the one that Word left there, or a fresh one."""

    def __init__(self, root: Element) -> None:
        ids = [start.get(q("w:id")) or "0" for start in root.iter(q("w:bookmarkStart"))]
        self.ids = count(max((int(start) for start in ids if start.lstrip("-").isdigit()), default=0) + 1)
        self.names = {start.get(q("w:name")) or "" for start in root.iter(q("w:bookmarkStart"))}
        self.fresh = count(990_000_001)
        self.given: list[tuple[Element, str]] = []

    def of(self, paragraph: Element) -> str:
        """Return the bookmark of a paragraph."""
        name = self._found(paragraph) or self._made(paragraph)
        self.given.append((paragraph, name))
        return name

    def _found(self, paragraph: Element) -> str | None:
        for bookmark in paragraph.iter(q("w:bookmarkStart")):
            name = bookmark.get(q("w:name")) or ""
            if name.startswith("_Toc"):
                return name
        return None

    def _made(self, paragraph: Element) -> str:
        name = next(
            candidate
            for candidate in (f"_Toc{number}" for number in self.fresh)
            if candidate not in self.names
        )
        identity = str(next(self.ids))
        start = element("w:bookmarkStart", id=identity, name=name)
        paragraph.insert(1 if paragraph.find(P_PR) is not None else 0, start)
        paragraph.append(element("w:bookmarkEnd", id=identity))
        return name


def _entries(field: Field, root: Element, sheet: StyleSheet, marks: _Bookmarks) -> list[ContentsEntry]:
    paged = re.search(r"\\n(?!\w)", field.code) is None
    caption = re.search(r'\\[ca]\s+"?([^"\\\s]+)', field.code)
    if caption:
        return [
            ContentsEntry(
                bookmark=marks.of(p),
                text=" ".join(paragraph_text(p).split()),
                level=1,
                heading=False,
                numbered=False,
                paged=paged,
            )
            for p in root.iter(W_P)
            if not in_fallback(p) and _counts(p, caption[1])
        ]
    lowest, highest, extra, outline = _switches(field.code)
    inside = field.paragraphs or []  # held, so that an identity stays that of one element
    members = {id(p) for p in inside}
    entries = []
    for heading in headings(root, sheet):
        level = extra.get(sheet.names.get(style_of(heading.element), ""))
        if level is None and (heading.by_style or outline) and lowest <= heading.level <= highest:
            level = heading.level
        if level is None or id(heading.element) in members:
            continue
        entries.append(
            ContentsEntry(
                bookmark=marks.of(heading.element),
                text=heading.text,
                level=level,
                heading=True,
                numbered=heading.numbered,
                paged=paged,
            )
        )
    return entries


def _switches(code: str) -> tuple[int, int, dict[str, int], bool]:
    """Return lowest and highest level, the level of further styles by name, and whether ``\\u`` is set."""
    extra: dict[str, int] = {}
    listed = re.search(r'\\t\s+"([^"]*)"', code)
    if listed:
        words = [word.strip().lower() for word in re.split("[;,]", listed[1])]
        extra = {name: int(n) for name, n in zip(words[::2], words[1::2], strict=False) if n.isdigit()}
    spread = re.search(r'\\o(?:\s+"?(\d)\s*-\s*(\d)"?)?', code)
    outline = re.search(r"\\u(?!\w)", code) is not None
    if spread is None and (listed or outline):
        return (1, 9, extra, True) if outline else (1, 0, extra, False)
    return (
        (int(spread[1]), int(spread[2]), extra, outline) if spread and spread[1] else (1, 9, extra, outline)
    )


def _counts(paragraph: Element, name: str) -> bool:
    counted = re.compile(rf"\s*SEQ\s+{re.escape(name)}(?!\w)", re.IGNORECASE)
    return any(counted.match(field.code) for field in fields_of(paragraph))


def _rewrite(field: Field, entries: list[ContentsEntry], sheet: StyleSheet, root: Element) -> None:
    old = field.paragraphs or []
    patterns = {style_of(p): p.find(P_PR) for p in reversed(old) if p.find(P_PR) is not None}
    first, last = old[0], old[-1]
    before = _siblings_before(first, field.begin)
    tail = _tail(last, field.end)
    linked = re.search(r"\\h(?!\w)", field.code) is not None
    separator = re.search(r'\\p\s+"([^"]*)"', field.code)
    width = _text_width(root)
    paragraphs = [
        _line(entry, patterns, sheet, width, linked, separator[1] if separator else "\t") for entry in entries
    ]
    if not paragraphs:
        paragraphs = [element("w:p")]
    head = [*before, field_mark("begin"), text_run(field.code, CODE), field_mark("separate")]
    at = 1 if paragraphs[0].find(P_PR) is not None else 0
    for offset, run in enumerate(head):
        paragraphs[0].insert(at + offset, run)
    paragraphs[-1].append(field_mark("end"))
    for paragraph in paragraphs:
        first.addprevious(paragraph)
    for paragraph in old:
        paragraph.getparent().remove(paragraph)
    if tail is not None:
        paragraphs[-1].addnext(tail)


def _siblings_before(paragraph: Element, begin: Element) -> list[Element]:
    run = next(child for child in paragraph if child is begin.getparent() or begin in child.iter(CHAR))
    siblings: list[Element] = []
    for child in paragraph:
        if child is run:
            return siblings
        if child.tag != P_PR:
            siblings.append(child)
    return siblings


def _tail(paragraph: Element, end: Element) -> Element | None:
    """Return what follows the field in its last paragraph, None where that is nothing to keep."""
    tail = deepcopy(paragraph)
    position = list(paragraph.iter()).index(end)
    twin = list(tail.iter())[position]
    for run in [c for c in tail if c.tag != P_PR]:
        tail.remove(run)
        if run is twin or twin in run.iter():
            break
    section = tail.find(f"{P_PR}/{q('w:sectPr')}") is not None
    has_content = any(True for _ in tail.iter(q("w:br"), q("w:drawing")))
    return tail if section or has_content or paragraph_text(tail).strip() else None


def _line(
    entry: ContentsEntry,
    patterns: dict[str, Element],
    sheet: StyleSheet,
    width: int,
    linked: bool,
    separator: str,
) -> Element:
    style = sheet.identity(f"toc {entry.level}" if entry.heading else "table of figures")
    properties = element("w:pPr")
    if style is not None and style in patterns:
        properties = deepcopy(patterns[style])
        for section in properties.findall(q("w:sectPr")):
            properties.remove(section)
    elif style is not None:
        properties.append(element("w:pStyle", val=style))
    elif entry.level > 1:
        properties.append(element("w:ind", left=_INDENT * (entry.level - 1)))
    if style not in sheet.tabbed and properties.find(q("w:tabs")) is None:
        _right_tab(properties, width)
    runs = [text_run(entry.text)]
    if entry.paged:
        runs += [
            element("w:r", element("w:tab")) if separator == "\t" else text_run(separator),
            field_mark("begin"),
            text_run(f" PAGEREF {entry.bookmark} \\h ", CODE),
            field_mark("separate"),
            text_run("1"),
            field_mark("end"),
        ]
    if linked:
        runs = [element("w:hyperlink", *runs, anchor=entry.bookmark, history=1)]
    return element("w:p", properties, *runs)


def _right_tab(properties: Element, width: int) -> None:
    """Put a tab stop with leading dots at the right edge; the schema wants it before the spacing."""
    tabs = element("w:tabs", element("w:tab", val="right", leader="dot", pos=width))
    before = {q(f"w:{element_name}") for element_name in _BEFORE_TABS.split()}
    properties.insert(sum(1 for child in properties if child.tag in before), tabs)


def _text_width(root: Element) -> int:
    from toolkit.report.word.pictures import section_room

    sections = list(root.iter(q("w:sectPr")))
    return section_room(sections[0])[0] if sections else 9000
