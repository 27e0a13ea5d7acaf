"""The words of the pages: English in the templates, other languages in ``messages/`` (gettext).

A language is a file ``messages/<code>.po``: another one needs no code. Numbers keep their digits and take the
language's decimal sign; days stay ISO 8601, which laboratories write in every language.
"""

from __future__ import annotations

from gettext import NullTranslations
from pathlib import Path

from toolkit.words import catalogue
from toolkit.words.catalogue import SOURCE, decimal_sign

__all__ = ["MESSAGES", "SOURCE", "TERMS", "decimal_sign", "languages", "preferred", "translations"]

MESSAGES = Path(__file__).with_name("messages")
TERMS = (
    "candidate", "approved", "withdrawn", "discarded", "entered", "enter", "approve", "withdraw", "discard",
)  # fmt: skip
"""Words of the ledger that pages translate: no template spells them."""


def languages() -> tuple[str, ...]:
    """Return the languages of the pages, the templates' own first."""
    return catalogue.languages(MESSAGES)


def translations(language: str) -> NullTranslations:
    """Return the catalogue of a language; that of the templates' own is empty."""
    return catalogue.translations(language, MESSAGES)


def preferred(accepted: str) -> str:
    """Return the language of a page, by what a browser says that its person reads.

    >>> preferred("de-AT,de;q=0.9,en;q=0.8"), preferred("it"), preferred("")
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
