"""The line of every entry: by hand, and every path of tomllib's answer for texts that hypothesis writes."""

from __future__ import annotations

import tomllib
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from toolkit.declared.faults import lines_of
from toolkit.declared.text import toml_text

WRITTEN = '''# a comment with [brackets] and "quotes
title = "a # no comment"   # and one
"quoted key" = 1
a.b."c.d" = 2
'single' = """
first = 1
\\"""" # three quotes and one that belongs to the text
after = \'\'\'it\'\'s [[no]] header\'\'\'

[table . "with space"]
array = [
  1, # one
  "two ] }", [ 3,
    4 ],
  { x = 1, y.z = "}" },
]
day = 1979-05-27 07:32:00 # a space inside

[[list]]
name = "first"
[list.below]
deep = true
[[list.inner]]
k = 1
[[list.inner]]
k = 2
[[list]]
name = "second"
[list.below]
deep = false
'''
PLACES = {
    ("title",): 2,
    ("quoted key",): 3,
    ("a", "b", "c.d"): 4,
    ("single",): 5,
    ("after",): 8,
    ("table",): 10,
    ("table", "with space"): 10,
    ("table", "with space", "array"): 11,
    ("table", "with space", "array", 0): 12,
    ("table", "with space", "array", 1): 13,
    ("table", "with space", "array", 2, 1): 14,
    ("table", "with space", "array", 3): 15,
    ("table", "with space", "array", 3, "y", "z"): 15,
    ("table", "with space", "day"): 17,
    ("list", 0): 19,
    ("list", 0, "below", "deep"): 22,
    ("list", 0, "inner", 1, "k"): 26,
    ("list", 1): 27,
    ("list", 1, "name"): 28,
    ("list", 1, "below"): 29,
}


def paths(value: Any, path: tuple[str | int, ...] = ()) -> set[tuple[str | int, ...]]:
    entries = (
        value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    )
    return {path, *(deeper for key, entry in entries for deeper in paths(entry, (*path, key)))}


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_the_line_of_every_entry(end: str) -> None:
    text = WRITTEN.replace("\n", end)
    assert paths(tomllib.loads(text)) == {(), *lines_of(text)}
    lines = lines_of(text)
    assert {path: lines[path] for path in PLACES} == PLACES


@pytest.mark.parametrize(
    "text",
    [
        "", "# nothing", "a = 1", "a=[]\nb={}",
        'a = """"x"""', "a = ''''x'''''",
        'a = ""\nb = \'\'', 'a = """"""\nb = 1', "[a.b]\n[a]\nc = 1", "a = [[[1]], []]", "[[a.b]]\n[[a.b]]",
        'a = "\\\\"\nb = "\\""', "a = [ # [\n 1, ]\nb = 2", "a = { b = { c = [ { d = 1 } ] } }",
        "1.2 = 3\n-_ = 1", "a = 1979-05-27T07:32:00Z\nb = +inf\nc = 0x_1".replace("0x_1", "0xA1"),
    ],
)  # fmt: skip
def test_odd_texts(text: str) -> None:
    assert {(), *lines_of(text)} == paths(tomllib.loads(text))


ANY_TEXT = st.text(st.characters(codec="utf-8"))
VALUES = st.recursive(
    st.booleans() | st.integers() | st.floats(allow_nan=False) | ANY_TEXT | st.dates(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(ANY_TEXT, inner, max_size=3),
    max_leaves=12,
)


@given(st.dictionaries(ANY_TEXT, VALUES, max_size=4))
def test_what_is_written_reads_back_and_every_entry_has_a_line(table: dict[str, Any]) -> None:
    text = toml_text(table)
    assert tomllib.loads(text) == table
    assert {(), *lines_of(text)} == paths(table)
