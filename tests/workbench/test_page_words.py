"""The catalogues: every phrase of the templates in every language, with the same places for its values."""

from __future__ import annotations

import io
import re

import pytest
from babel.messages.extract import extract
from babel.messages.pofile import read_po

from toolkit.words import phrasebook
from toolkit.workbench.page import MESSAGES, SOURCE, TEMPLATES, TERMS, languages, preferred, templates

Phrase = str | tuple[str, ...]
PLACE = re.compile(r"%\((\w+)\)s")


def phrases() -> set[Phrase]:
    keywords = {"_": None, "gettext": None, "ngettext": (1, 2)}
    options = {"trim_blocks": "true", "lstrip_blocks": "true"}
    return {
        tuple(message) if isinstance(message, (tuple, list)) else message
        for path in TEMPLATES.glob("*.j2")
        for _, message, _, _ in extract(
            "jinja2.ext:babel_extract", io.BytesIO(path.read_bytes()), keywords=keywords, options=options  # type: ignore[arg-type]
        )
    }  # fmt: skip


@pytest.mark.parametrize("language", [name for name in languages() if name != SOURCE])
def test_a_catalogue_has_every_phrase_and_no_other(language: str) -> None:
    catalogue = {
        message.id: message.string
        for message in read_po(io.BytesIO((MESSAGES / f"{language}.po").read_bytes())) if message.id
    }  # fmt: skip
    of_documents = phrasebook.phrases(language)
    asked = phrases() | set(TERMS)
    assert set(catalogue) <= asked
    assert asked - set(catalogue) <= set(of_documents)
    assert set(catalogue) & set(of_documents) == set()  # pages and documents say a phrase in the same words
    for phrase, translated in catalogue.items():
        for source, target in zip(
            *((text,) if isinstance(text, str) else text for text in (phrase, translated)), strict=True
        ):  # type: ignore[misc]
            assert target, source
            assert set(PLACE.findall(source)) == set(PLACE.findall(target)), source


def test_no_template_holds_words_beside_the_catalogue() -> None:
    between = re.compile(r">([^<>{}]*[A-Za-z]{3,}[^<>{}]*)<")
    for path in TEMPLATES.glob("*.j2"):
        text = re.sub(
            r"\{%-? *trans.*?endtrans *-?%\}|<pre>.*?</pre>|<code>.*?</code>",
            "",
            path.read_text(),
            flags=re.DOTALL,
        )
        if path.name in ("refused.html.j2", "way_in.html.j2"):
            continue  # before anybody is let in: no language is asked for
        words = [match[1].strip() for match in between.finditer(text)]
        assert [word for word in words if word != "sha256"] == [], path.name


def test_every_list_of_findings_says_how_grave_each_is() -> None:
    """An error that reads like a note is overlooked: the pages have one way to write a finding."""
    listed = {path.name for path in TEMPLATES.glob("*.j2") if "{{ finding.message" in path.read_text()}
    by_level = {path.name for path in TEMPLATES.glob("*.j2") if "level(finding.level)" in path.read_text()}
    assert listed <= by_level


def test_numbers_take_the_decimal_sign_of_the_language_and_keep_their_value() -> None:
    drawn = {
        name: templates(name).from_string("{{ number(-1.25, '.2f', 'N') }}").render()
        for name in ("en", "de", "fr")
    }
    assert drawn["en"] == '<data value="-1.25">\u22121.25\u00a0N</data>'
    assert drawn["de"] == '<data value="-1.25">\u22121,25\u00a0N</data>'
    assert drawn["fr"] == drawn["de"]


def test_the_pages_come_in_english_german_and_french() -> None:
    assert set(languages()) == {"en", "de", "fr"}
    assert [preferred(accepted) for accepted in ("fr-CA,en;q=0.5", "de-AT", "it, fr;q=0.2", "it")] == [
        "fr", "de", "fr", "en",
    ]  # fmt: skip


def test_french_puts_a_space_that_does_not_break_before_its_double_marks() -> None:
    # Lexique des règles typographiques en usage à l'Imprimerie nationale: deux-points, ; ? ! et guillemets.
    catalogue = read_po(io.BytesIO((MESSAGES / "fr.po").read_bytes()))
    for message in (message for message in catalogue if message.id):
        for text in message.string if isinstance(message.string, tuple) else (message.string,):
            assert not re.search(r"[^\u00a0](?:[;?!\u00bb]|:(?=\s|$))|\u00ab(?!\u00a0)", text), text
