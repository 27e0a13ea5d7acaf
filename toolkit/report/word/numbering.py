"""Number the captions: the results of SEQ fields, and of REF fields that point at them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from lxml import etree

from toolkit.report.word.xml import FALLBACK, W_P, W_R, W_T, Element, field_mark, paragraph_text, q


@dataclass(slots=True, eq=False)
class _Field:
    code: str
    results: list[Element]
    end: Element | None
    separate: Element | None


def number_captions(body: Element) -> None:
    """Write the running number into every SEQ field, and the bookmarked text into every REF field.

    Word shows the stored result until someone updates the fields; removed blocks leave gaps in it.
    """
    counters: dict[str, int] = {}
    fields = list(_fields(body))
    for field in fields:
        words = field.code.split()
        if len(words) < 2 or words[0].upper() != "SEQ":
            continue
        name = words[1].lower()
        reset = re.search(r"\\r\s*(\d+)", field.code)
        if reset:
            counters[name] = int(reset[1])
        elif "\\c" not in words:
            counters[name] = counters.get(name, 0) + 1
        _write(field, str(counters.get(name, 0)))
    marks = _bookmarks(body)
    for field in fields:
        words = field.code.split()
        if len(words) > 1 and words[0].upper() == "REF" and words[1] in marks:
            _write(field, marks[words[1]])


def _write(field: _Field, text: str) -> None:
    if field.results:
        field.results[0].text = text
        for result in field.results[1:]:
            result.text = ""
        return
    if field.end is None:
        return
    owner = field.end.getparent()
    if field.separate is None:
        owner.addprevious(field_mark("separate"))
    run = etree.Element(W_R)
    etree.SubElement(run, W_T).text = text
    owner.addprevious(run)


def _fields(body: Element) -> list[_Field]:
    fields: list[_Field] = []
    stack: list[_Field] = []
    for element in body.iter(q("w:fldSimple"), q("w:fldChar"), q("w:instrText"), W_T):
        if element.tag == q("w:fldSimple"):
            fields.append(_Field(element.get(q("w:instr")) or "", list(element.iter(W_T)), None, None))
            if not fields[-1].results:
                run = etree.SubElement(element, W_R)
                fields[-1].results = [etree.SubElement(run, W_T)]
        elif element.tag == q("w:instrText"):
            if stack and stack[-1].separate is None:
                stack[-1].code += element.text or ""
        elif element.tag == W_T:
            for field in stack:
                if field.separate is not None:
                    field.results.append(element)
        elif (kind := element.get(q("w:fldCharType"))) == "begin":
            stack.append(_Field("", [], None, None))
            fields.append(stack[-1])
        elif kind == "separate" and stack:
            stack[-1].separate = element
        elif kind == "end" and stack:
            stack.pop().end = element
    return fields


def _bookmarks(body: Element) -> dict[str, str]:
    open_: dict[str, str] = {}
    texts: dict[str, str] = {}
    for element in body.iter(q("w:bookmarkStart"), q("w:bookmarkEnd"), W_T):
        if element.tag == q("w:bookmarkStart"):
            name = element.get(q("w:name")) or ""
            open_[element.get(q("w:id")) or ""] = name
            texts[name] = ""
        elif element.tag == q("w:bookmarkEnd"):
            open_.pop(element.get(q("w:id")) or "", None)
        else:
            for name in open_.values():
                texts[name] += element.text or ""
    return texts


# The headings of a document: paragraphs with an outline level, by their style or their own.


_BODY = 9  # outline level of body text
_P_PR, _P_STYLE, _LEVEL = q("w:pPr"), q("w:pStyle"), q("w:outlineLvl")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Heading:
    """One heading: ``level`` from 1, its text, its paragraph, and whether Word numbers it by itself."""

    level: int
    text: str
    element: Element
    numbered: bool
    by_style: bool


@dataclass(slots=True, kw_only=True)
class StyleSheet:
    """The paragraph styles of a document, by id: outline level, numbering, tab stops, name."""

    levels: dict[str, int]
    numbered: set[str]
    tabbed: set[str]
    names: dict[str, str]

    @classmethod
    def of(cls, package: object) -> StyleSheet:
        """Read the styles part of an opened package; what a style lacks comes from the one it is based on."""
        root = package.main_document_part._styles_part.element  # type: ignore[attr-defined]
        styles = {
            style_element.get(q("w:styleId")) or "": style_element
            for style_element in root.iter(q("w:style"))
        }
        names = {identity: _value(style, "w:name").lower() for identity, style in styles.items()}
        levels, numbered, tabbed = {}, set(), set()
        for identity in styles:
            level: int | None = None
            for style_element in _chain(identity, styles):
                if level is None:
                    level = _own_level(style_element, names[style_element.get(q("w:styleId")) or ""])
                if style_element.find(f"{_P_PR}/{q('w:numPr')}") is not None:
                    numbered.add(identity)
                if style_element.find(f"{_P_PR}/{q('w:tabs')}") is not None:
                    tabbed.add(identity)
            levels[identity] = _BODY if level is None else level
        return cls(levels=levels, numbered=numbered, tabbed=tabbed, names=names)

    def identity(self, name: str) -> str | None:
        """Return the id of the style of a name, without regard to case."""
        return next((identity for identity, own in self.names.items() if own == name.lower()), None)


def levelled(package: object) -> frozenset[str]:
    """Return the ids of the paragraph styles that make a heading."""
    sheet = StyleSheet.of(package)
    return frozenset(identity for identity, level in sheet.levels.items() if level < _BODY)


def level_of(paragraph: Element, sheet: StyleSheet) -> int:
    """Return a paragraph's outline level, 0 the highest, 9 that of body text."""
    own = paragraph.find(f"{_P_PR}/{_LEVEL}")
    if own is not None:
        return _number(own)
    return sheet.levels.get(style_of(paragraph), _BODY)


def style_of(paragraph: Element) -> str:
    """Return the id of a paragraph's style, empty for the default one."""
    style = paragraph.find(f"{_P_PR}/{_P_STYLE}")
    return "" if style is None else style.get(q("w:val")) or ""


def headings(body: Element, sheet: StyleSheet) -> Iterator[Heading]:
    """Yield the headings of the body in their order; one without text, or in a text box, is none."""
    outside = {FALLBACK, q("w:txbxContent")}
    for paragraph in body.iter(W_P):
        level = level_of(paragraph, sheet)
        if level >= _BODY or any(iterancestor.tag in outside for iterancestor in paragraph.iterancestors()):
            continue
        text = " ".join(paragraph_text(paragraph).split())
        if not text:
            continue
        own = paragraph.find(f"{_P_PR}/{q('w:numPr')}/{q('w:numId')}")
        none = own is not None and own.get(q("w:val")) == "0"
        yield Heading(
            level=level + 1,
            text=text,
            element=paragraph,
            numbered=not none and (own is not None or style_of(paragraph) in sheet.numbered),
            by_style=sheet.levels.get(style_of(paragraph), _BODY) < _BODY,
        )


def _chain(identity: str, styles: dict[str, Element]) -> Iterator[Element]:
    seen: set[str] = set()
    while identity in styles and identity not in seen:
        seen.add(identity)
        yield styles[identity]
        identity = _value(styles[identity], "w:basedOn")


def _own_level(style: Element, name: str) -> int | None:
    found = style.find(f"{_P_PR}/{_LEVEL}")
    if found is not None:
        return _number(found)
    head, _, digit = name.partition(" ")
    # Word's own heading styles have their level even where the file leaves it out.
    return int(digit) - 1 if head == "heading" and digit.isdigit() and 1 <= int(digit) <= _BODY else None


def _number(element: Element) -> int:
    text = element.get(q("w:val")) or ""
    return min(int(text), _BODY) if text.isdigit() else _BODY


def _value(style: Element, name: str) -> str:
    found = style.find(q(name))
    return "" if found is None else found.get(q("w:val")) or ""
