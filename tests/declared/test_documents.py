"""A document that was written of an object gives an equal object back, or says where it does not."""

from __future__ import annotations

import dataclasses
import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Annotated, Any, Literal

import pytest

from tests.declared_answers import departures
from toolkit.declared import Entry, Keyed, OrNan, answer, derived, json_value, object_of
from toolkit.declared.answers import answer_reference, answer_schema


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """A band of a curve."""

    ends: Annotated[tuple[OrNan, OrNan], Entry("lower and upper")]
    unit: str = "N"


@dataclass(frozen=True, slots=True, kw_only=True)
class Peak:
    """The largest force."""

    force: Annotated[OrNan, Entry("lateral force", key="FY_N")]
    size: Annotated[float | None, Entry("null without one")] = None
    at: float | str = 0.0
    on: date | None = None
    file: Path = Path("a.csv")
    grade: Literal["good", "bad"] = "good"
    bands: tuple[Band, ...] = ()
    signs: Annotated[tuple[tuple[str, int], ...], Keyed(), Entry("of each channel")] = ()
    by_name: Mapping[str, Band] = dataclasses.field(default_factory=dict)
    extra: Annotated[str | None, Entry(sparse=True)] = None
    own: Annotated[int, Entry(output=False)] = 0

    @property
    @derived("force over two", after="force")
    def half(self) -> float:
        return self.force / 2


FULL = Peak(
    force=4000.0, size=1.5, at="the end", on=date(2026, 3, 1), file=Path("b/c.csv"), grade="bad",
    bands=(Band(ends=(1.0, 2.0)), Band(ends=(3.0, 4.0), unit="lbf")), signs=(("FY", -1), ("MZ", 1)),
    by_name={"a": Band(ends=(5.0, 6.0))}, extra="more",
)  # fmt: skip


@pytest.mark.parametrize("peak", [FULL, Peak(force=1.0), dataclasses.replace(FULL, extra=None, on=None)])
def test_what_was_written_is_read_back_equal(peak: Peak) -> None:
    document = json.loads(json.dumps(answer(peak)))
    assert object_of(Peak, document) == peak
    del document["schema"]
    assert not list(departures(document, Peak))


def test_what_is_no_number_is_null_and_back() -> None:
    written = json_value(Peak(force=math.nan, bands=(Band(ends=(1.0, math.nan)),)))
    assert written["FY_N"] is None
    assert written["bands"][0]["ends"] == [1.0, None]
    read = object_of(Peak, written)
    assert math.isnan(read.force)
    assert math.isnan(read.bands[0].ends[1])


def test_a_derived_property_stands_behind_the_field_that_it_names_and_is_not_read() -> None:
    assert list(json_value(FULL))[:3] == ["FY_N", "half", "size"]
    assert object_of(Peak, json_value(FULL) | {"half": "whatever"}) == FULL


def test_pairs_of_a_name_and_its_value_are_a_table() -> None:
    assert json_value(FULL)["signs"] == {"FY": -1, "MZ": 1}


def test_keys_that_are_not_there_have_their_default_and_others_are_passed_over() -> None:
    assert object_of(Peak, {"FY_N": 2, "newer": 7}) == Peak(force=2.0)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"FY_N": True}, "FY_N: True is no number or null"),
        ({"FY_N": 10**400}, "FY_N: 1000"),
        ({"size": "1"}, "size: '1' is no number"),
        ({"at": []}, "at: [] is no number or text"),
        ({"at": None}, "at: None is no number or text"),
        ({"on": "yesterday"}, "on: 'yesterday' is no date"),
        ({"file": 3}, "file: 3 is no path"),
        ({"grade": "fair"}, """grade: 'fair' is no "good" or "bad\""""),
        ({"bands": [{"unit": "N"}]}, "bands[0].ends: missing"),
        ({"bands": [{"ends": [1.0]}]}, "bands[0].ends: [1.0] is no [number or null, number or null]"),
        ({"bands": [{"ends": [1.0, "x"]}]}, "bands[0].ends[1]: 'x' is no number or null"),
        ({"bands": {}}, "bands: {} is no list of `Band`"),
        ({"bands": [7]}, "bands[0]: 7 is no `Band`"),
        ({"signs": {"FY": 0.5}}, "signs.FY: 0.5 is no whole number"),
        ({"signs": []}, "signs: [] is no by name: whole number"),
        ({"by_name": {"a": {}}}, "by_name.a.ends: missing"),
    ],
)
def test_what_is_not_declared_is_told_with_its_place(change: dict[str, Any], told: str) -> None:
    with pytest.raises(ValueError, match=f"^{re.escape(told)}"):
        object_of(Peak, json_value(FULL) | change)


def test_a_document_that_is_no_table_is_told() -> None:
    with pytest.raises(ValueError, match=r"the document: \[\] is no `Peak`"):
        object_of(Peak, [])


def test_page_and_schema_have_what_is_written() -> None:
    page = answer_reference(Peak)
    assert "| `FY_N` | number or null | lateral force |" in page
    assert "| `extra` | text | not always:  |" in page
    assert "| `half` | number | force over two |" in page
    assert "| `signs` | by name: whole number | of each channel |" in page
    assert "| `ends` | [number or null, number or null] | lower and upper |" in page
    table = answer_schema(Peak)["$defs"]["Peak"]
    assert list(table["properties"]) == [key for key in json_value(FULL) if key != "schema"]
    assert table["properties"]["FY_N"]["anyOf"] == [{"type": "number"}, {"type": "null"}]
