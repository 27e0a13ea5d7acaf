"""Catalogues of phrases (gettext), and the phrasebook that says a sentence in another language by them.

A phrase is a text with places for values, ``{count} findings, listed under Findings``. What stands in a place
may be a phrase itself, and its numbers take the decimal sign; those of the phrase are the catalogue's. A text
that is no phrase as a whole is parted at its punctuation, and each part is looked up: captions, alternative
texts and lists are phrases that stop or comma join. What is no phrase, such as a name, a number or what a
person wrote, stays as it is.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterable, Mapping
from functools import cache
from gettext import GNUTranslations, NullTranslations
from pathlib import Path

SOURCE = "en"
"""The language of code and templates: it has no catalogue."""
DOCUMENTS = Path(__file__).with_name("messages")
"""The catalogues of documents and of the templates that come with the toolkit."""


def languages(folder: Path = DOCUMENTS) -> tuple[str, ...]:
    """Return the languages that a folder has catalogues of, the source's own first."""
    return (SOURCE, *sorted(path.stem for path in folder.glob("*.po")))


@cache
def phrases(language: str, folder: Path = DOCUMENTS) -> dict[str, str]:
    """Return a catalogue's phrases with their translations, empty where there is none.

    The source's own language says each phrase as it is.
    """
    from babel.messages.pofile import read_po

    if language == SOURCE:
        further = languages(folder)[1:]
        return {phrase: phrase for name in further for phrase in phrases(name, folder)}
    catalogue = read_po(io.BytesIO((folder / f"{language}.po").read_bytes()), locale=language)
    return {str(message.id): str(message.string) for message in catalogue if message.id}


@cache
def translations(language: str, folder: Path) -> NullTranslations:
    """Return a catalogue for gettext, which lacks what documents say in the same words.

    That of the source's own language is empty.
    """
    from babel.messages.mofile import write_mo
    from babel.messages.pofile import read_po

    if language == SOURCE:
        return NullTranslations()
    catalogue = read_po(io.BytesIO((folder / f"{language}.po").read_bytes()), locale=language)
    compiled = io.BytesIO()
    write_mo(compiled, catalogue)
    compiled.seek(0)
    compiled_catalogue = GNUTranslations(compiled)
    if folder != DOCUMENTS:
        compiled_catalogue.add_fallback(translations(language, DOCUMENTS))
    return compiled_catalogue


def locale_of(language: str) -> str:
    """Return a language with its likeliest country, as documents name it.

    >>> locale_of("fr")
    'fr-FR'
    """
    from babel.core import get_global

    name, *_, country = get_global("likely_subtags")[language].split("_")
    return f"{name}-{country}"


@cache
def decimal_sign(language: str) -> str:
    """Return the sign between a number and its decimals."""
    from babel.numbers import get_decimal_symbol

    return get_decimal_symbol(language)


PLACE = re.compile(r"\{(\w+)\}")
_JOINTS = ("\n", ". ", "; ", " - ", ": ", ", ")
_WITH_UNIT = re.compile(r"(.*?)( \[[^\[\]]*\])")  # an axis, the head of a column
# What stands in a place: no joint of sentences, or a phrase would run over the next one.
# A phrase of few letters would be recognised in anything: its values are single words or numbers.
_VALUE, _WORD = r"(?:(?!; |\. |\n).)*?", r"\S+(?: ± \S+)?"
_FEW_LETTERS = 4
# A number of one point that is no part of a name, a version, a clause or a file.
_DECIMAL = re.compile(r"(?<![\w.,:])(\d+)\.(\d+)(?!\w|\.\w)")


class Phrasebook:
    """Phrases in one language; ``decimal_comma`` writes the numbers of sentences with it."""

    def __init__(self, catalogue: Mapping[str, str], *, decimal_comma: bool = False) -> None:
        """Take a catalogue: phrase to translation; those without a translation are unknown."""
        sentences = {phrase: text for phrase, text in catalogue.items() if text}
        # Within a paragraph a sentence is parted from the next one by its stop.
        sentences |= {p[:-1]: t[:-1] for p, t in sentences.items() if p.endswith(".") and t.endswith(".")}
        self._whole = {phrase: text for phrase, text in sentences.items() if not PLACE.search(phrase)}
        with_places = [phrase for phrase in sentences if phrase not in self._whole]
        with_places.sort(key=lambda phrase: -_letters(phrase))
        self._places = tuple((_pattern(phrase), sentences[phrase]) for phrase in with_places)
        self._comma = decimal_comma
        self._known: dict[str, str | None] = {}

    def say(self, text: str) -> str:
        """Return a text in this language, as it is where nothing of it is a phrase.

        >>> book = Phrasebook({"{n} of {m} rows": "{n} von {m} Zeilen", "slip angle": "Schräglaufwinkel"})
        >>> book.say("Slip angle: 3 of 12 rows"), book.say("A. Operator")
        ('Schräglaufwinkel: 3 von 12 Zeilen', 'A. Operator')
        """
        spoken = self._spoken(text)
        return text if spoken is None else spoken

    def knows(self, text: str) -> bool:
        """Tell whether a text, or a part of it, is a phrase."""
        return self._spoken(text) is not None

    def _spoken(self, text: str) -> str | None:
        if text not in self._known:
            self._known[text] = self._look_up(text)
        return self._known[text]

    def _look_up(self, text: str) -> str | None:
        core = text.strip()
        if not core:
            return None
        if core != text:
            start = text.index(core)
            inner = self._spoken(core)
            return None if inner is None else text[:start] + inner + text[start + len(core) :]
        spoken = self._phrase(core)
        if spoken is None and core[0].isupper():
            lower = self._phrase(core[0].lower() + core[1:])
            spoken = None if lower is None else lower[:1].upper() + lower[1:]
        if spoken is None and (heading := _WITH_UNIT.fullmatch(core)):
            quantity = self._spoken(heading[1])
            spoken = None if quantity is None else quantity + heading[2]
        if spoken is None and core.endswith((".", ":")):
            sentence = self._spoken(core[:-1])
            spoken = None if sentence is None else sentence + core[-1]
        return self._parts(core) if spoken is None else spoken

    def _phrase(self, text: str) -> str | None:
        if (sentence := self._whole.get(text)) is not None:
            return sentence
        for pattern, translation in self._places:
            match = pattern.fullmatch(text)
            if match is not None:
                values = {name: self._value(name, value) for name, value in match.groupdict().items()}
                return PLACE.sub(lambda place, values=values: values[place[1]], translation)  # type: ignore[misc]
        return None

    def _parts(self, text: str) -> str | None:
        for joint in _JOINTS:
            if joint in text:
                parts = text.split(joint)
                spoken = [self._spoken(part) for part in parts]
                if any(part is not None for part in spoken):
                    return joint.join(
                        self._numbers(old) if new is None else new
                        for old, new in zip(parts, spoken, strict=True)
                    )
        return None

    def _value(self, name: str, value: str) -> str:
        """Return what stands in a place; in one whose name begins with ``own`` it is somebody's own word."""
        if name.startswith("own"):
            return value
        spoken = self._spoken(value)
        return self._numbers(value) if spoken is None else spoken

    def _numbers(self, text: str) -> str:
        return _DECIMAL.sub(r"\1,\2", text) if self._comma else text


def _letters(phrase: str) -> int:
    return sum(character.isalpha() for character in PLACE.sub("", phrase))


def _pattern(phrase: str) -> re.Pattern[str]:
    value = _VALUE if _letters(phrase) >= _FEW_LETTERS else _WORD
    parts = PLACE.split(phrase)  # text, place, text, place ... text
    written = (re.escape(part) if at % 2 == 0 else f"(?P<{part}>{value})" for at, part in enumerate(parts))
    return re.compile("".join(written), re.DOTALL)


@cache
def phrasebook(
    language: str, *, decimal_comma: bool = False, own: Iterable[tuple[str, str]] = ()
) -> Phrasebook:
    """Return the phrasebook of documents in a language; ``own`` phrases come before the catalogue's."""
    return Phrasebook({**phrases(language), **dict(own)}, decimal_comma=decimal_comma)
