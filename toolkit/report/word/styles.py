"""What a document's styles say of a paragraph, the nearest style first; which paragraphs are headings."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from toolkit.report.word.xml import FALLBACK, P_PR, W_P, Element, is_on, paragraph_text, q

BODY = 9
"""The outline level of body text; headings are above it, the highest at 0."""
_LEVEL = q("w:outlineLvl")


def styles_root(package: Any) -> Element | None:
    """Return the part of an opened package that holds its styles, None without one."""
    part = getattr(package.main_document_part, "_styles_part", None)
    return None if part is None else part.element


def styles_by_id(root: Element | None) -> dict[str, Element]:
    """Return the styles of a part by their ids."""
    return {} if root is None else {s.get(q("w:styleId")) or "": s for s in root.iter(q("w:style"))}


def _styles(package: Any) -> dict[str, Element]:
    return styles_by_id(styles_root(package))


def _chain(identity: str, styles: dict[str, Element]) -> Iterator[Element]:
    """Yield a style and those that it is based on, the nearest first."""
    seen: set[str] = set()
    while identity in styles and identity not in seen:
        seen.add(identity)
        yield styles[identity]
        identity = _value(styles[identity], "w:basedOn")


def paragraph_styles(package: Any, paragraph: Element, kind: str) -> Iterator[Element]:
    """Yield the properties, of run or paragraph, of a paragraph's style and of those it is based on."""
    styles = _styles(package)
    default = next((name for name, style in styles.items() if _is_default(style)), "")
    yield from properties_of(style_of(paragraph) or default, styles, kind)


def style_chain(package: Any, identity: str | None, kind: str) -> Iterator[Element]:
    """Yield the properties of a style and of those it is based on."""
    yield from properties_of(identity or "", _styles(package), kind)


def properties_of(identity: str, styles: dict[str, Element], kind: str) -> Iterator[Element]:
    """Yield the properties of a style among others, and of those that it is based on."""
    for style in _chain(identity, styles):
        if (properties := style.find(kind)) is not None:
            yield properties


def style_defaults(package: Any, name: str, kind: str) -> Iterator[Element]:
    """Yield the properties that hold where no style says otherwise."""
    root = styles_root(package)
    properties = None if root is None else root.find(f"{q('w:docDefaults')}/{q(name)}/{kind}")
    if properties is not None:
        yield properties


def _is_default(style: Element) -> bool:
    return style.get(q("w:type")) == "paragraph" and is_on(style.get(q("w:default")) or "0")


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
    def of(cls, package: Any) -> StyleSheet:
        """Read the styles of an opened package; what a style lacks comes from the one it is based on."""
        styles = _styles(package)
        names = {identity: _value(style, "w:name").lower() for identity, style in styles.items()}
        levels, numbered, tabbed = {}, set(), set()
        for identity in styles:
            chain = list(_chain(identity, styles))
            stated = (_own_level(style, names[style.get(q("w:styleId")) or ""]) for style in chain)
            levels[identity] = next((level for level in stated if level is not None), BODY)
            if any(style.find(f"{P_PR}/{q('w:numPr')}") is not None for style in chain):
                numbered.add(identity)
            if any(style.find(f"{P_PR}/{q('w:tabs')}") is not None for style in chain):
                tabbed.add(identity)
        return cls(levels=levels, numbered=numbered, tabbed=tabbed, names=names)

    def identity(self, name: str) -> str | None:
        """Return the id of the style of a name, without regard to case."""
        return next((identity for identity, own in self.names.items() if own == name.lower()), None)

    def level_of(self, paragraph: Element) -> int:
        """Return a paragraph's outline level, by itself or by its style."""
        own = paragraph.find(f"{P_PR}/{_LEVEL}")
        return self.levels.get(style_of(paragraph), BODY) if own is None else _number(own)


def levelled(package: object) -> frozenset[str]:
    """Return the ids of the paragraph styles that make a heading."""
    return frozenset(identity for identity, level in StyleSheet.of(package).levels.items() if level < BODY)


def style_of(paragraph: Element) -> str:
    """Return the id of a paragraph's style, empty for the default one."""
    style = paragraph.find(f"{P_PR}/{q('w:pStyle')}")
    return "" if style is None else style.get(q("w:val")) or ""


def headings(body: Element, sheet: StyleSheet) -> Iterator[Heading]:
    """Yield the headings of the body in their order; one without text, or in a text box, is none."""
    outside = {FALLBACK, q("w:txbxContent")}
    for paragraph in body.iter(W_P):
        level = sheet.level_of(paragraph)
        if level >= BODY or any(above.tag in outside for above in paragraph.iterancestors()):
            continue
        text = " ".join(paragraph_text(paragraph).split())
        if not text:
            continue
        own = paragraph.find(f"{P_PR}/{q('w:numPr')}/{q('w:numId')}")
        none = own is not None and own.get(q("w:val")) == "0"
        yield Heading(
            level=level + 1,
            text=text,
            element=paragraph,
            numbered=not none and (own is not None or style_of(paragraph) in sheet.numbered),
            by_style=sheet.levels.get(style_of(paragraph), BODY) < BODY,
        )


def _own_level(style: Element, name: str) -> int | None:
    found = style.find(f"{P_PR}/{_LEVEL}")
    if found is not None:
        return _number(found)
    head, _, digit = name.partition(" ")
    # Word's own heading styles have their level even where the file leaves it out.
    return int(digit) - 1 if head == "heading" and digit.isdigit() and 1 <= int(digit) <= BODY else None


def _number(element: Element) -> int:
    text = element.get(q("w:val")) or ""
    return min(int(text), BODY) if text.isdigit() else BODY


def _value(style: Element, name: str) -> str:
    found = style.find(q(name))
    return "" if found is None else found.get(q("w:val")) or ""
