"""A phrasebook: what it recognises, and what it leaves as it is."""

from __future__ import annotations

import pytest

from toolkit.words.phrasebook import Phrasebook

BOOK = Phrasebook(
    {
        "{count} findings": "{count} Feststellungen",
        "lateral force FY": "Seitenkraft FY",
        "{what} against load": "{what} über der Radlast",
        "from {low} to {high} N": "bis {high} N, ab {low}",
        "{value} at {load}": "{value} bei {load}",
        "open": "",
        "clause 2.2": "Abschnitt 2.2",
        "tire {own}": "Reifen {own}",
        "simulated": "simuliert",
    },
    decimal_comma=True,
)


@pytest.mark.parametrize(
    ("text", "spoken"),
    [
        ("12 findings", "12 Feststellungen"),
        ("lateral force FY against load", "Seitenkraft FY über der Radlast"),
        ("Lateral force FY against load; 3 findings.", "Seitenkraft FY über der Radlast; 3 Feststellungen."),
        ("from 1.5 to 2.5 N", "bis 2,5 N, ab 1,5"),
        ("lateral force FY [N]", "Seitenkraft FY [N]"),
        ("  3 findings ", "  3 Feststellungen "),
        ("45.0 ± 6.1 at 1112", "45,0 ± 6,1 bei 1112"),
        ("x: 3 findings\ny", "x: 3 Feststellungen\ny"),
    ],
)
def test_a_phrase_a_joint_of_phrases_and_what_stands_in_their_places(text: str, spoken: str) -> None:
    assert BOOK.say(text) == spoken
    assert BOOK.knows(text)


@pytest.mark.parametrize(
    "text",
    ["", " ", "A. Operator", "sweep 0.5 deg.xlsx", "ISO/IEC 17025, 7.8.7", "open", "meet Jane at the drum"],
)
def test_what_is_no_phrase_stays_as_it_is(text: str) -> None:
    assert BOOK.say(text) == text
    assert not BOOK.knows(text)


def test_a_number_that_is_part_of_a_name_a_clause_or_a_version_keeps_its_point() -> None:
    text = "3 findings: 0.5; run 0.5.xlsx; 7.8.7; v0.1; toolkit 0.1.0; -0.25"
    assert BOOK.say(text) == "3 Feststellungen: 0,5; run 0.5.xlsx; 7.8.7; v0.1; toolkit 0.1.0; -0,25"


def test_a_place_does_not_run_over_the_next_sentence() -> None:
    assert BOOK.say("FX against load; FY against load") == "FX über der Radlast; FY über der Radlast"


def test_a_number_of_the_phrase_itself_and_a_word_of_ones_own_stay() -> None:
    assert BOOK.say("clause 2.2; 3 findings") == "Abschnitt 2.2; 3 Feststellungen"
    assert BOOK.say("tire 6.5J, simulated") == "Reifen 6.5J, simulated"
    assert BOOK.say("simulated") == "simuliert"
