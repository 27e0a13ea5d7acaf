"""Lines of a known form are read as a parser reads them, and refused where it refuses them."""

from __future__ import annotations

import hashlib
import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from toolkit.calibration.records.record import canonical
from toolkit.calibration.registry.ledger import LineForms

BODY: dict[str, Any] = {
    "by": "A. Person", "document": {"content": "c" * 64, "name": "report 1"}, "event": "issued",
    "id": "m15-r2", "note": None, "prev": "0" * 64, "seq": 7, "sha256": "a" * 64,
    "time": "2026-03-01T00:00:00Z",
    "unverifiable": [],
}  # fmt: skip
FLAT = {name: value for name, value in BODY.items() if name != "document"}


def parsed(text: str) -> tuple[dict[str, Any], str] | None:
    """The entries of a line by a parser alone, and what its hash is of; None where it is not canonical."""
    try:
        body = json.loads(text)
        if type(body) is not dict or canonical(body) != text or type(body["sha256"]) is not str:
            return None
        return body, canonical({name: value for name, value in body.items() if name != "sha256"})
    except (ValueError, KeyError, RecursionError):
        return None


def with_form(text: str, body: dict[str, Any]) -> tuple[dict[str, Any], str] | None:
    """The same by the form of a line; None where the text has another."""
    known, found, remainder = forms_of(body).read(text.encode())
    return None if known is None else (found, remainder)


def forms_of(body: dict[str, Any]) -> LineForms:
    """Forms that know one line."""
    forms = LineForms()
    forms.learn(canonical(body).encode(), body)
    return forms


@pytest.mark.parametrize("body", [BODY, FLAT], ids=["deep", "flat"])
def test_a_line_of_the_form_is_read_as_by_a_parser(body: dict[str, Any]) -> None:
    for change in ({}, {"seq": 12345}, {"by": ""}, {"by": "Jürgen: {a, b}"}, {"id": "seq"}, {"seq": 0}):
        text = canonical({**body, **change})
        assert with_form(text, body) == parsed(text) != None  # noqa: E711  both, and neither None


@given(st.data())
def test_whatever_is_done_to_a_line_both_ways_agree(data: st.DataObject) -> None:
    body = data.draw(st.sampled_from([BODY, FLAT]))
    text = canonical(
        {**body, "by": data.draw(st.text(max_size=6)), "seq": data.draw(st.integers(-2, 10**20))}
    )
    for _ in range(data.draw(st.integers(0, 2))):
        at = data.draw(st.integers(0, len(text) - 1))
        end = at + data.draw(st.integers(0, 2))
        text = (
            text[:at]
            + data.draw(st.sampled_from([*'"\\{}[]:,0٣7 \n ü', "", "null", '""', "1e2"]))
            + text[end:]
        )
    try:
        _, *found = forms_of(body).read(text.encode())
    except (ValueError, KeyError, RecursionError):
        assert parsed(text) is None
    else:
        expected = parsed(text)
        assert expected is None or tuple(found) == expected
        if expected is None:  # the hash is no text: no line's hash is it
            assert type(found[0]["sha256"]) is not str


def test_a_text_that_must_be_escaped_and_a_line_of_another_form_are_parsed() -> None:
    assert with_form(canonical({**FLAT, "seq": 8}), FLAT)
    for other in ({**FLAT, "by": 'a"b'}, {**FLAT, "by": "a\\b"}, {**FLAT, "clock": "unknown"}, BODY):
        known, found, _ = forms_of(FLAT).read(canonical(other).encode())
        assert (known, found) == (None, other)


@pytest.mark.parametrize("character", [*map(chr, range(0x20)), "\x7f", "\x80", "\u2028"])
def test_a_raw_control_character_is_read_as_the_parser_reads_it(character: str) -> None:
    text = canonical(FLAT).replace("A. Person", f"A.{character}Person")
    try:
        _, *found = forms_of(FLAT).read(text.encode())
    except ValueError:
        assert parsed(text) is None
    else:
        assert tuple(found) == parsed(text)


@pytest.mark.parametrize(
    "text",
    [
        canonical(FLAT).replace(":7,", ":07,"),
        canonical(FLAT).replace(":7,", ":7 ,"),
        canonical(FLAT).replace(":7,", ":٧,"),
        canonical(FLAT).replace(":7,", ":+7,"),
        canonical(FLAT).replace(":7,", ";7,"),
        canonical(FLAT).replace("[]", "[ ]"),
        canonical(FLAT).replace("null", "true"),
        canonical(FLAT).replace('"by"', '"id"'),
        canonical(FLAT) + " ",
        " " + canonical(FLAT),
        canonical(FLAT)[:-1],
    ],
)
def test_another_spelling_has_no_form(text: str) -> None:
    try:
        assert with_form(text, FLAT) is None
    except ValueError:
        assert parsed(text) is None


def test_the_hash_is_of_all_but_itself() -> None:
    nested = {**BODY, "document": {"name": "x", "sha256": BODY["sha256"], "z": "z"}}
    text = canonical(nested)
    (_, remainder) = with_form(text, nested) or ({}, "")
    assert json.loads(remainder) == {name: value for name, value in nested.items() if name != "sha256"}
    assert hashlib.sha256(remainder.encode()).hexdigest() == hashlib.sha256(
        canonical({name: value for name, value in nested.items() if name != "sha256"}).encode()
    ).hexdigest()  # fmt: skip
