"""What is printed from a declaration: the starter file is valid, page and schema name every entry."""

from __future__ import annotations

import re
import tomllib
from typing import Any

import pytest

from tests.declared.sample import Cell, Sample
from toolkit.declared import json_schema, plain, read_text, reference, starter, table_of
from toolkit.simulation.plan_file import PlanFile


def all_on(text: str) -> str:
    return re.sub(r"^#(?! )", "", text, flags=re.MULTILINE)


def test_a_starter_is_valid_and_so_is_every_entry_switched_on() -> None:
    text = starter(Sample)
    instance = read_text(Sample, text.encode(), where="starter.toml")
    assert instance.title == "a sample"
    assert instance.share == 0.5
    keys = {line.lstrip("#").split(" = ")[0] for line in text.splitlines()}
    assert {*table_of(Sample).keys} - {"channel", "cells"} <= keys
    # Names that another entry declares cannot be invented.
    switched = all_on(text).replace("NAME = ", "FY = ").replace("[cells.NAME]", "[cells.A]")
    assert read_text(Sample, switched.encode(), where="starter.toml").count == 1


def test_a_starter_says_what_each_entry_holds() -> None:
    text = starter(Sample)
    assert '# surface speed; { value = NUMBER, unit = "km/h" } above 0 km/h; required' in text
    assert "#share = 0.5" in text
    assert "# share; a number from 0 and up to 1; default 0.5" in text
    assert "[[channel]]" in text
    assert "#[cells.NAME]" in text


def test_a_reference_page_has_every_entry_of_every_table() -> None:
    page = reference(Sample)
    assert page.startswith("# Sample\n")
    for section in ("## `[[channel]]`", "## `[cells.NAME]`", "## `[rate]`", "## `[check]`"):
        assert section in page
    for key in (*table_of(Sample).keys, "gain", "u", "role", "limits", "tolerance"):
        assert f"| `{key}` |" in page or key == "schema"
    assert "formerly `velocity`" in page
    assert "`schema = 2`" in page
    rows = [line for line in page.splitlines() if line.startswith("| ")]
    assert {len(re.findall(r"(?<!\\)\|", row)) for row in rows} == {5}


def test_a_json_schema_says_types_bounds_choices_and_what_is_required() -> None:
    schema = json_schema(Sample)
    assert schema["$schema"].endswith("2020-12/schema")
    top = schema["$defs"]["Sample"]
    assert top["additionalProperties"] is False
    assert top["required"] == ["title", "loads", "day", "speed", "channel"]
    properties = top["properties"]
    assert properties["schema"] == {"const": 2}
    assert properties["share"] == {"type": "number", "minimum": 0, "maximum": 1, "default": 0.5}
    assert properties["loads"]["uniqueItems"]
    assert properties["count"] == {"type": "integer", "minimum": 1, "default": 1}
    assert properties["country"]["pattern"] == "^(?:[A-Z]{2})$"
    assert properties["cells"]["additionalProperties"] == {"$ref": "#/$defs/Cell_by_name"}
    assert "name" not in schema["$defs"]["Cell_by_name"]["properties"]
    assert schema["$defs"]["Channel"]["properties"]["role"]["enum"] == ["load", "angle"]
    assert [*schema["$defs"]] == ["Sample", "Channel", "Cell_by_name", "Constant", "Sweep", "Check"]


def references(schema: Any) -> set[str]:
    if isinstance(schema, dict):
        inner = {name for entry in schema.values() for name in references(entry)}
        return inner | ({schema["$ref"]} if "$ref" in schema else set())
    return {name for entry in schema for name in references(entry)} if isinstance(schema, list) else set()


def test_every_reference_of_a_json_schema_is_defined() -> None:
    schema = json_schema(Sample)
    assert references(schema) == {f"#/$defs/{name}" for name in schema["$defs"]}


def test_a_table_by_itself_has_its_name_as_a_field() -> None:
    assert "name" in json_schema(Cell)["$defs"]["Cell"]["properties"]
    with pytest.raises(KeyError):
        plain(Cell(name="a", gain=1.0))["schema"]
    assert tomllib.loads(starter(Cell))["gain"] == 1.0


def test_a_default_is_printed_without_the_digits_of_its_conversion() -> None:
    page = reference(PlanFile)
    assert "34.3775" in page  # 0.6 rad
    assert '{ value = 4.0, unit = "deg/s" }' in page
    assert not re.search(r"\d\.\d{9,}", page)
