"""Answers as typed dictionaries: what departs is told with its place; the schema says the same."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, NotRequired, TypedDict

import pytest

from toolkit.declared.answers import answer_reference, answer_schema, departures


class Row(TypedDict):
    """A row of the table."""

    load_N: Annotated[float, "mean load"]
    grade: Literal["good", "bad"]


class Table(TypedDict):
    """A table of rows."""

    rows: Annotated[Sequence[Row], "one a load"]
    ends: tuple[float, float | None] | None
    by_name: Mapping[str, Row]
    file: Path
    extra: NotRequired[Annotated[Any, "whatever it is"]]


GOOD: dict[str, Any] = {
    "rows": [{"load_N": 1, "grade": "good"}],
    "ends": [1.5, None],
    "by_name": {"a": {"load_N": 2.5, "grade": "bad"}},
    "file": "x.csv",
}


def test_what_is_declared_does_not_depart() -> None:
    assert not list(departures(GOOD, Table))
    assert not list(departures(GOOD | {"extra": object(), "ends": None, "file": Path("x")}, Table))

    def rows() -> Iterator[dict[str, Any]]:
        yield from GOOD["rows"]

    assert not list(departures(GOOD | {"rows": tuple(rows())}, Table))


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"rows": [{"load_N": True, "grade": "good"}]}, "rows[0].load_N: True is no number"),
        ({"rows": [{"load_N": 1.0, "grade": "fair"}]}, "rows[0].grade: 'fair' is none of good, bad"),
        ({"rows": [{"load_N": 1.0}]}, "rows[0].grade: missing"),
        ({"rows": "text"}, "rows: 'text' is no list of `Row`"),
        ({"by_name": {"a": {"load_N": 1.0, "grade": "bad", "why": ""}}}, "by_name.a.why: not declared"),
        ({"ends": [1.5, "x"]}, "ends[1]: 'x' is no number"),
        ({"file": 3}, "file: 3 is no path"),
        ({"spare": 1}, "spare: not declared"),
    ],
)
def test_what_departs_is_told_with_its_place(change: dict[str, Any], told: str) -> None:
    assert list(departures(GOOD | change, Table)) == [told]


def test_schema_and_page_say_what_is_declared() -> None:
    schema = answer_schema(Table)
    table = schema["$defs"]["Table"]
    assert table["required"] == ["rows", "ends", "by_name", "file"]
    assert table["properties"]["rows"] == {
        "description": "one a load", "type": "array", "items": {"$ref": "#/$defs/Row"},
    }  # fmt: skip
    assert table["properties"]["extra"] == {"description": "whatever it is"}
    assert schema["$defs"]["Row"]["properties"]["grade"] == {"enum": ["good", "bad"]}
    page = answer_reference(Table)
    assert "| `rows` | list of [`Row`](#row) | one a load |" in page
    assert "| `extra` | any value | not always: whatever it is |" in page
    assert "### Row\n\n`rows[]`: A row of the table." in page
