"""The words of the pages: English in the templates, other languages in ``messages/`` (gettext).

A language is a file ``messages/<code>.po``: another one needs no code. Numbers keep their digits and take the
language's decimal sign; days stay ISO 8601, which laboratories write in every language.
"""

from __future__ import annotations

import io
from functools import cache
from gettext import GNUTranslations, NullTranslations
from pathlib import Path

MESSAGES = Path(__file__).with_name("messages")
SOURCE = "en"
TERMS = ("candidate", "approved", "withdrawn", "discarded", "entered")
"""Words of the ledger that pages translate: no template spells them."""


def languages() -> tuple[str, ...]:
    """Return the languages of the pages, the templates' own first."""
    return (SOURCE, *sorted(path.stem for path in MESSAGES.glob("*.po")))


@cache
def translations(language: str) -> NullTranslations:
    """Return the catalogue of a language; that of the templates' own is empty."""
    from babel.messages.mofile import write_mo
    from babel.messages.pofile import read_po

    if language == SOURCE:
        return NullTranslations()
    catalogue = read_po(io.BytesIO((MESSAGES / f"{language}.po").read_bytes()), locale=language)
    compiled = io.BytesIO()
    write_mo(compiled, catalogue)
    compiled.seek(0)
    return GNUTranslations(compiled)


def preferred(accepted: str) -> str:
    """Return the language of a page, by what a browser says that its person reads.

    >>> preferred("de-AT,de;q=0.9,en;q=0.8"), preferred("fr"), preferred("")
    ('de', 'en', 'en')
    """
    from babel.core import negotiate_locale

    ranked: list[tuple[float, str]] = []
    for part in accepted.split(","):
        name, _, parameter = part.strip().partition(";")
        try:
            weight = float(parameter.strip().removeprefix("q=")) if parameter else 1.0
        except ValueError:
            continue
        ranked.append((-weight, name.strip()))
    names = [name for _, name in sorted(ranked, key=lambda entry: entry[0])]
    return negotiate_locale(names, languages(), sep="-") or SOURCE


@cache
def decimal_sign(language: str) -> str:
    """Return the sign between a number and its decimals."""
    from babel.numbers import get_decimal_symbol

    return get_decimal_symbol(language)
