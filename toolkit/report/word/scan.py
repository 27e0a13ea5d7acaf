"""Find the tags of a template: content controls and literal ``{{tk:...}}``, in every part.

What stands beside the tags of a template in another language follows the catalogue of phrases.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from toolkit.report.tags import DRAWN, Tag, parse_tag
from toolkit.report.word.package import Template, open_package
from toolkit.report.word.styles import styles_root
from toolkit.report.word.xml import (
    SDT_CONTENT,
    SDT_PR,
    W_P,
    W_SDT,
    W_TBL,
    W_TR,
    Element,
    Story,
    ancestor,
    in_fallback,
    own_texts,
    q,
    set_text,
    stories,
    write_back,
)
from toolkit.words.phrasebook import locale_of, phrasebook

LITERAL = re.compile(r"\{\{\s*(tk:[^{}]*?)\s*\}\}")
BROKEN = re.compile(r"\{\{\s*tk:(?![^{}]*\}\})")
# Word's autocorrection makes {{Tk: of it at the start of a sentence; it would be printed as it stands.
MISSPELT = re.compile(r"(?!tk:)[tT][kK]\s*:")
UNBRACED = re.compile(r"\btk:([\w.]*\w)")
MISSPELT_LITERAL = re.compile(r"\{\{\s*" + MISSPELT.pattern)


@dataclass(slots=True, kw_only=True, eq=False)
class Site:
    """One place of a tag. ``element`` is the control, or the paragraph of a literal."""

    tag: Tag
    form: Literal["control", "literal"]
    story: Story
    element: Element
    fallback: bool

    @property
    def place(self) -> str:
        """Where in its part the tag stands, for people."""
        return place_of(self.element, self.story)


def control_tag(sdt: Element) -> Tag | None:
    """Return the toolkit's tag of a content control, None where it has another or none."""
    element = sdt.find(f"{SDT_PR}/{q('w:tag')}")
    return None if element is None else parse_tag(element.get(q("w:val")) or "")


def scan(stories: list[Story]) -> list[Site]:
    """Return every tag in document order, part by part; literals that a control will replace are left out."""
    return [site for story in stories for site in _story(story)]


def _story(story: Story) -> Iterator[Site]:
    for element in story.root.iter(W_SDT, W_P):
        fallback = in_fallback(element)
        if element.tag == W_SDT:
            tag = control_tag(element)
            if tag is not None:
                yield Site(tag=tag, form="control", story=story, element=element, fallback=fallback)
            continue
        for match in LITERAL.finditer("".join(t.text or "" for t in visible_texts(element))):
            tag = parse_tag(match[1])
            if tag is not None:
                yield Site(tag=tag, form="literal", story=story, element=element, fallback=fallback)


def visible_texts(paragraph: Element) -> list[Element]:
    """Return a paragraph's w:t outside controls that are themselves filled with a value or figure."""
    return [t for t in own_texts(paragraph) if filled_by(t) is None]


def filled_by(element: Element) -> Element | None:
    """Return the control around an element whose content will be replaced, None where there is none."""
    for sdt in element.iterancestors(W_SDT):
        tag = control_tag(sdt)
        if tag is not None and tag.family in ("value", "row", *DRAWN):
            return sdt
    return None


def broken_literals(story: Story) -> Iterator[Element]:
    """Yield paragraphs with a ``{{tk:`` that is never closed."""
    for paragraph in story.root.iter(W_P):
        if BROKEN.search("".join(t.text or "" for t in visible_texts(paragraph))):
            yield paragraph


def misspelt(story: Story) -> Iterator[tuple[Element, str]]:
    """Yield (element, text) of controls and literals that mean the toolkit and are not written ``tk:``."""
    for element in story.root.iter(W_SDT, W_P):
        if element.tag == W_SDT:
            tag = element.find(f"{SDT_PR}/{q('w:tag')}")
            text = "" if tag is None else (tag.get(q("w:val")) or "").strip()
            if MISSPELT.match(text):
                yield element, text
        else:
            text = "".join(t.text or "" for t in visible_texts(element))
            if match := MISSPELT_LITERAL.search(text):
                yield element, text[match.start() : match.start() + 40]


def unbraced(story: Story) -> Iterator[tuple[Element, str]]:
    """Yield (paragraph, path) of texts such as ``{tk:tire.size}`` that stand in no double braces."""
    for paragraph in story.root.iter(W_P):
        text = "".join(t.text or "" for t in visible_texts(paragraph))
        for match in UNBRACED.finditer(BROKEN.sub("", LITERAL.sub("", text))):
            yield paragraph, match[1]


def table_of(site: Site) -> Element | None:
    """Return the w:tbl that a table tag names: inside its control, or the next thing after its paragraph."""
    if site.form == "control":
        return next(site.element.iter(W_TBL), None)
    following = site.element.getnext()
    while following is not None and following.tag in (
        q("w:bookmarkStart"),
        q("w:bookmarkEnd"),
        q("w:proofErr"),
    ):
        following = following.getnext()
    while following is not None and following.tag == W_SDT:
        # A control of others, or a condition, around the table.
        content = following.find(SDT_CONTENT)
        following = None if content is None else next(iter(content), None)
    return following if following is not None and following.tag == W_TBL else None


def own_rows(table: Element) -> list[Element]:
    """Return a table's rows, also those inside row-level controls, not those of a table within."""
    return [row for row in table.iter(W_TR) if ancestor(row, W_TBL) is table]


def row_in(table: Element, element: Element) -> Element | None:
    """Return the row of ``table`` that an element stands in, through any table within."""
    for row in element.iterancestors(W_TR):
        if ancestor(row, W_TBL) is table:
            return row
    return None


def place_of(element: Element, story: Story) -> str:
    """Return ``paragraph 12`` or ``table 2, row 3``, counted in the part."""
    row = element if element.tag == W_TR else ancestor(element, W_TR)
    if row is not None:
        table = ancestor(row, W_TBL)
        number = list(story.root.iter(W_TBL)).index(table) + 1
        return f"table {number}, row {own_rows(table).index(row) + 1}"
    paragraph = element if element.tag == W_P else ancestor(element, W_P)
    if paragraph is None:
        paragraph = next(element.iter(W_P), None)
    if paragraph is None:
        return "part"
    return f"paragraph {list(story.root.iter(W_P)).index(paragraph) + 1}"


_NUMBERED = re.compile(r"(\d+(?:\.\d+)*\s{2,})?(.*)", re.DOTALL)
_WORDS = re.compile(r"[^\W\d_]{2,}")
_TAGS = re.compile(r"\{\{.*?\}\}")


def fixed_texts(parts: Sequence[Story]) -> Iterator[Element]:
    """Yield the texts of a template that a report prints as they stand."""
    for story in parts:
        for paragraph in story.root.iter(W_P):
            yield from (text for text in visible_texts(paragraph) if _is_word(text.text or ""))


def phrase_of(text: str) -> str:
    """Return the phrase that a fixed text is: without the number of a heading and outer space.

    >>> phrase_of("3  Lateral force "), phrase_of(" of ")
    ('Lateral force', 'of')
    """
    match = _NUMBERED.fullmatch(text.strip())
    return match[2] if match else text.strip()


def in_language(template: Template, language: str) -> bytes:
    """Return a template as a Word file with its fixed texts, and its language, in another one."""
    package = open_package(template)
    parts = stories(package)
    book = phrasebook(language)
    for element in fixed_texts(parts):
        text = element.text or ""
        phrase = phrase_of(text)
        set_text(element, text.replace(phrase, book.say(phrase)))
    for story in parts:
        write_back(story)
    if (styles := styles_root(package)) is not None:
        for mark in styles.iter(q("w:lang")):
            mark.set(q("w:val"), locale_of(language))
    package.core_properties.language = locale_of(language)
    stream = io.BytesIO()
    package.save(stream)
    return stream.getvalue()


def _is_word(text: str) -> bool:
    return _WORDS.search(_TAGS.sub("", text)) is not None
