"""A catalogue of phrases: a gettext file ``<language>.po``; another language needs a file and no code."""

from __future__ import annotations

import io
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
        others = languages(folder)[1:]
        return {phrase: phrase for name in others for phrase in phrases(name, folder)}
    catalogue = read_po(io.BytesIO((folder / f"{language}.po").read_bytes()), locale=language)
    return {str(message.id): str(message.string) for message in catalogue if message.id}


@cache
def translations(language: str, folder: Path) -> NullTranslations:
    """Return a catalogue for gettext; that of the source's own language is empty."""
    from babel.messages.mofile import write_mo
    from babel.messages.pofile import read_po

    if language == SOURCE:
        return NullTranslations()
    catalogue = read_po(io.BytesIO((folder / f"{language}.po").read_bytes()), locale=language)
    compiled = io.BytesIO()
    write_mo(compiled, catalogue)
    compiled.seek(0)
    return GNUTranslations(compiled)


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
