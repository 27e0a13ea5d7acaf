"""A template in another language: what stands in it beside its tags, by the catalogue of phrases."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Sequence

from toolkit.report.word.package import Template, open_package
from toolkit.report.word.scan import visible_texts
from toolkit.report.word.xml import W_P, Element, Story, q, set_text, stories, write_back
from toolkit.words.phrasebook import locale_of, phrasebook

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
    styles = getattr(package.main_document_part, "_styles_part", None)
    if styles is not None:
        for mark in styles.element.iter(q("w:lang")):
            mark.set(q("w:val"), locale_of(language))
    package.core_properties.language = locale_of(language)
    stream = io.BytesIO()
    package.save(stream)
    return stream.getvalue()


def _is_word(text: str) -> bool:
    return _WORDS.search(_TAGS.sub("", text)) is not None
