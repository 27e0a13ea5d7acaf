"""Answers as typed dictionaries: what departs is told with its place; the schema says the same."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Annotated, Any, Literal, NotRequired, TypedDict

import pytest

from tests.declared_answers import departures
from toolkit.declared.answers import answer_reference, answer_schema, entry_of


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


@dataclass(frozen=True)
class Measured:
    """What an entry is filled from: more than it says, and a value that is computed."""

    load_N: float
    day: date
    rows: tuple[object, ...] = ()
    spare: str = ""

    @property
    def grade(self) -> str:
        return "good" if self.load_N > 1 else "bad"


class Series(TypedDict):
    """Rows of a day."""

    day: str
    rows: list[Row]
    ends: NotRequired[tuple[float, float]]


def test_an_entry_is_filled_from_attributes_and_what_stands_inside_it() -> None:
    inside = (Measured(4.0, date(2026, 3, 2)), Measured(0.5, date(2026, 3, 3)))
    series = entry_of(Series, Measured(1.0, date(2026, 3, 1), inside))
    assert series == {
        "day": "2026-03-01",
        "rows": [{"load_N": 4.0, "grade": "good"}, {"load_N": 0.5, "grade": "bad"}],
    }
    assert not list(departures(series, Series))


def test_what_is_stated_stands_in_the_place_of_an_attribute() -> None:
    assert entry_of(Row, Measured(4.0, date(2026, 3, 2)), grade="bad") == {"load_N": 4.0, "grade": "bad"}


@pytest.mark.parametrize(
    ("stated", "error"),
    [({}, AttributeError), ({"load_N": 1.0, "grade": "good", "extra": 2}, TypeError)],
)
def test_an_entry_says_all_that_is_declared_and_nothing_else(
    stated: dict[str, Any], error: type[Exception]
) -> None:
    with pytest.raises(error):
        entry_of(Row, object(), **stated)
