"""New files of every declared format: what is given reads back equal, what is not is told all at once."""

from __future__ import annotations

import tomllib

import pytest

from tests.house.pages import formats
from toolkit.declared import plain, read_text, starter, table_of
from toolkit.declared.describe import outline
from toolkit.declared.text import attempt

FORMATS = formats()


@pytest.mark.parametrize("cls", FORMATS)
def test_what_is_given_reads_back_equal(cls: type) -> None:
    instance = read_text(cls, starter(cls).encode(), where="starter.toml")
    values = {key: entry for key, entry in plain(instance).items() if key != "schema"}
    assert read_text(cls, outline(cls, values).encode(), where="outline.toml") == instance


@pytest.mark.parametrize("cls", FORMATS)
def test_what_nobody_gave_is_missing_and_nothing_is_made_up(cls: type) -> None:
    text = outline(cls, {})
    _, faults = attempt(cls, tomllib.loads(text))
    assert {fault.kind for fault in faults} <= {"missing"}
    needed = {field.key for field in table_of(cls).fields if field.required}
    assert needed <= {str(fault.key[0]) for fault in faults}
    stated = {key for key, entry in tomllib.loads(text).items() if not isinstance(entry, dict)}
    assert stated <= {"schema"}
    assert text.count("FILL IN") > len(needed) - 3  # a table that is needed has the mark in its entries


def test_a_note_stands_beside_its_entry() -> None:
    from toolkit.recording.folder import StatedTest

    text = outline(StatedTest, {"machine": "belt-2"}, {"machine": "guessed from run_01.csv"})
    assert '# guessed from run_01.csv\nmachine = "belt-2"' in text
