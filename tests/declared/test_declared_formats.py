"""Every declared format: its starter is valid, what is written reads back equal, its page is whole."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from tests.house.pages import formats
from toolkit.calibration.session.session_file import SessionFile
from toolkit.declared import json_schema, plain, read, read_text, reference, starter, table_of, toml_text
from toolkit.machine.definition import load_machine, machine_file, machine_names, machine_of_text
from toolkit.recording.folder import StatedTest

ROOT = Path(__file__).resolve().parents[2]
FORMATS = formats()


@pytest.mark.parametrize("cls", FORMATS)
def test_the_starter_file_is_valid_and_what_is_written_reads_back_equal(cls: type) -> None:
    text = starter(cls)
    instance = read_text(cls, text.encode(), where="starter.toml")
    assert read_text(cls, toml_text(instance).encode(), where="written.toml") == instance
    assert json.dumps(plain(instance), default=str)


@pytest.mark.parametrize("cls", FORMATS)
def test_starter_page_and_schema_have_every_entry(cls: type) -> None:
    keys = table_of(cls).keys
    lines = [re.sub(r"^#?\[*([A-Za-z_]+).*", r"\1", line) for line in starter(cls).splitlines()]
    page, schema = reference(cls), json_schema(cls)["$defs"][cls.__name__]
    for key in keys:
        assert key in lines
        assert f"| `{key}` |" in page or key == "schema"
        assert key in schema["properties"]


@pytest.mark.parametrize("cls", FORMATS)
def test_every_entry_says_what_it_is_for(cls: type) -> None:
    silent = [
        field.key
        for field in table_of(cls).fields
        if not field.kind.entry.help and not field.kind.entry.expected
    ]
    assert not silent


@pytest.mark.parametrize("name", machine_names())
def test_a_packaged_machine_is_written_and_read_back_equal(name: str) -> None:
    machine = load_machine(name)
    assert machine_of_text(toml_text(machine).encode(), machine_file(name)) == machine


def test_sessions_and_tests_of_the_house_are_read() -> None:
    for path in [*ROOT.glob("calibrations/*/*.session.toml"), *ROOT.glob("toolkit/examples/**/SESSION.toml")]:
        assert read(SessionFile, path).operator
    for path in ROOT.glob("toolkit/examples/**/test.toml"):
        assert read(StatedTest, path).machine
