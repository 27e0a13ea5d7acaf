"""What may stand in a text that is kept, by what XML 1.0 and Unicode say of characters."""

from __future__ import annotations

import unicodedata

import pytest

from toolkit.errors import ConfigError
from toolkit.files import parse_toml
from toolkit.printable import check_entries, check_text, escaped, unprintable

# Names as people have them: marks that compose, that join, from the right, beyond the first plane.
PEOPLE = [
    "Jörg Müller", "Nguye\u0302\u0303n", "王小明", "סמית", "عبد\u200cالله", "O’Neill", "𠮷田", "A\u00a0B",
]  # fmt: skip


@pytest.mark.parametrize("text", [*PEOPLE, "", "two\nlines", "two\r\nlines", "a\tb"])
def test_what_people_write_is_printable(text: str) -> None:
    assert unprintable(text) is None
    assert escaped(text) == text


def test_every_control_character_surrogate_and_noncharacter_is_none() -> None:
    refused = {chr(code) for code in range(0x110000) if unprintable(chr(code)) is not None}
    controls = {chr(c) for c in range(0x100) if unicodedata.category(chr(c)) == "Cc"} - set("\t\n")
    turning = {
        chr(code) for code in range(0x2000, 0x2100)
        if unicodedata.bidirectional(chr(code)) in "LRE RLE LRO RLO PDF LRI RLI FSI PDI".split()
    }  # fmt: skip
    separators = {"\u2028", "\u2029"}
    surrogates = set(map(chr, range(0xD800, 0xE000)))
    no_characters = {
        chr(code) for code in range(0x110000) if code & 0xFFFE == 0xFFFE or 0xFDD0 <= code <= 0xFDEF
    }
    assert refused == controls | turning | separators | surrogates | no_characters


def test_an_escape_shows_the_character_and_is_itself_printable() -> None:
    assert escaped("a\x08\x1b[2J\u202e\udce4b") == "a\\x08\\x1b[2J\\u202e\\udce4b"
    assert escaped("a\rb\r\n") == "a\\rb\r\n"
    assert escaped("a\nb\t", lines=False) == "a\\nb\\t"
    everything = escaped("".join(map(chr, range(0x3000))))
    assert unprintable(everything) is None


def test_a_name_has_one_line() -> None:
    check_text("A\nB", where="reason")
    with pytest.raises(ConfigError, match="no document can print") as caught:
        check_text("A\nB", where="by", lines=False)
    assert caught.value.rule == "unprintable"
    assert caught.value.got == "A\\nB"


@pytest.mark.parametrize(
    ("text", "place", "line"),
    [
        ('a = 1\n[b]\nc = [1, "x\\u0008"]\n', "f.toml: b.c[2]", '3 | c = [1, "x\\u0008"]'),
        ('a = "\\\\u0008"\nb = "\\U0000202E"', "f.toml: b", '2 | b = "\\U0000202E"'),
        ('"k\\u001b" = 1', "f.toml: k\\x1b", '1 | "k\\u001b" = 1'),
        ('a = "\x9b31m"', "f.toml: a", '1 | a = "\x9b31m"'),
    ],
)
def test_every_text_and_key_of_a_settings_file_is_asked(text: str, place: str, line: str) -> None:
    with pytest.raises(ConfigError) as caught:
        parse_toml(text.encode(), where="f.toml")
    assert (caught.value.rule, caught.value.where, caught.value.line) == ("unprintable", place, line)
    assert parse_toml(text.encode(), where="f.toml", entered=True)


def test_numbers_days_and_nothing_are_no_texts() -> None:
    check_entries({"a": 1, "b": [None, 2.5, {"c": True}], "d": "e"}, where="x")
