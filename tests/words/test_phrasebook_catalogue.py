"""The catalogues of documents: every phrase in every language, and none that nobody says any more."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.house.source import read_package
from tests.report.template_factory import FOLDER
from toolkit.report.word.package import open_package, read_template
from toolkit.report.word.scan import fixed_texts, phrase_of
from toolkit.report.word.xml import stories
from toolkit.words.phrasebook import PLACE, SOURCE, languages, locale_of, phrasebook, phrases

OTHERS = [name for name in languages() if name != SOURCE]
PACKAGE = FOLDER.parent / "toolkit"
OWN_LANGUAGE = {"pruefbericht"}  # written in another one from the start


def texts_of(template: Path) -> list[str]:
    package = open_package(read_template(template))
    return [phrase_of(element.text or "") for element in fixed_texts(stories(package))]


def literals() -> Iterator[str]:
    """Yield every text that the code spells, with a hole for each value."""
    for module in read_package():
        for node in module.nodes:
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                yield node.value
            elif isinstance(node, ast.JoinedStr):
                yield "".join(
                    str(part.value) if isinstance(part, ast.Constant) else "{}" for part in node.values
                )
    for path in (*PACKAGE.rglob("*.toml"), *PACKAGE.rglob("*.j2")):
        yield path.read_text(encoding="utf-8")


@pytest.mark.parametrize("language", OTHERS)
def test_every_phrase_is_translated_with_the_same_places(language: str) -> None:
    catalogue = phrases(language)
    assert set(catalogue) == set(phrases(SOURCE))
    for phrase, translation in catalogue.items():
        assert translation.strip(), phrase
        assert sorted(PLACE.findall(phrase)) == sorted(PLACE.findall(translation)), phrase
        assert re.findall(r"\{\{.*?\}\}", phrase) == re.findall(r"\{\{.*?\}\}", translation), phrase
        assert phrasebook(language).knows(phrase), phrase


def test_a_phrase_that_nobody_says_any_more_is_seen_by_its_words() -> None:
    texts = (text for path in FOLDER.glob("*.docx") for text in texts_of(path))
    spelt = set(re.findall(r"[^\W\d_]+", " ".join([*literals(), *texts]).lower()))
    unspoken = {
        phrase for phrase in phrases(SOURCE)
        if not set(re.findall(r"[^\W\d_]+", PLACE.sub(" ", phrase).lower())) <= spelt
    }  # fmt: skip
    assert unspoken == set()


@pytest.mark.parametrize("template", sorted({path.stem for path in FOLDER.glob("*.docx")} - OWN_LANGUAGE))
@pytest.mark.parametrize("language", OTHERS)
def test_every_text_of_a_shipped_template_has_a_translation(template: str, language: str) -> None:
    book = phrasebook(language)
    assert [text for text in texts_of(FOLDER / f"{template}.docx") if not book.knows(text)] == []


def test_the_likeliest_country_of_a_language() -> None:
    # Unicode CLDR, likelySubtags: de_Latn_DE, fr_Latn_FR.
    assert (locale_of("de"), locale_of("fr")) == ("de-DE", "fr-FR")


@pytest.mark.parametrize("language", OTHERS)
@pytest.mark.parametrize("event", ["entered", "approved"])
def test_the_line_of_signatures_is_whole_in_every_language(language: str, event: str) -> None:
    """A part that is known hides the others from the warning `untranslated`: each is held by itself."""
    assert phrasebook(language).knows(f"{event} by Anna Example on 2026-11-28")
