"""What a notebook may hand over as columns: numbers with units, each row whole; anything else is refused."""

from __future__ import annotations

from collections.abc import Callable
from decimal import Decimal
from typing import Any

import numpy as np
import pandas as pd
import pint
import pytest

import toolkit
from toolkit.errors import ToolkitError

Q = pint.UnitRegistry().Quantity
GOOD = {"D51 [mV/V]": [0.1, 0.2], "D52 [mV/V]": [0.1, 0.2], "E5 [mV/V]": [0.3, 0.3]}


@pytest.fixture(scope="module")
def record() -> toolkit.Record:
    return toolkit.open_laboratory(toolkit.example("home")).in_force("m15-virtual")


def table(force: Any) -> dict[str, Any]:
    return {"SA [deg]": [0.0, 1.0], "FZ [N]": [3000.0, 3000.0], "FY [N]": force}


def apply(values: Any) -> Any:
    record = toolkit.open_laboratory(toolkit.example("home")).in_force("m15-virtual")
    return record.apply({**GOOD, "D51 [mV/V]": values}, uncertainty=False)


def fit(values: Any) -> Any:
    return toolkit.fit_tire(table(values))


def evaluate(values: Any) -> Any:
    return toolkit.read_tire(toolkit.example("tire")).evaluate({"SA [deg]": values, "FZ [N]": [3e3, 3e3]})


NO_NUMBERS = {
    "masked": np.ma.array([0.5, 1.9], mask=[False, True]),
    "bool": [True, False],
    "complex": np.array([1 + 1j, 1]),
    "datetime": pd.to_datetime(["2020-01-01", "2020-01-02"]),
    "datetime with a zone": pd.Series(pd.to_datetime(["2020-01-01", "2020-01-02"], utc=True)),
    "timedelta": pd.to_timedelta([1, 2]),
    "texts": ["0.5", "1"],
    "NaN": [np.nan, 1.0],
    "NA": pd.array([0.5, None], "Float64"),
    "None": [None, 1.0],
    "infinite": [np.inf, 1.0],
    "two dimensions": np.ones((2, 2)),
    "ragged": [[1.0], [1.0, 2.0]],
    "quantities of two dimensions": [Q(1, "mV/V"), Q(1, "N")],
    "a quantity beside a number": [Q(1, "mV/V"), 1.0],
}


@pytest.mark.parametrize("door", [apply, fit, evaluate])
@pytest.mark.parametrize("values", NO_NUMBERS.values(), ids=NO_NUMBERS)
def test_what_is_no_column_of_numbers_is_refused_at_every_door(
    door: Callable[[Any], Any], values: Any
) -> None:
    with pytest.raises(ToolkitError) as caught:
        door(values)
    error = caught.value
    assert error.rule in ("data-columns", "two-units", "unit-dimension")
    assert all((error.what, error.where, error.got, error.expected, error.next_step))


@pytest.mark.parametrize(
    "values",
    [
        np.array([1, 0], "u1"),
        np.array([1, 0], "f2"),
        pd.array([1, 0], "Int64"),
        pd.array([1.0, 0.0], "Float64"),
        [Decimal("1"), 0],
        np.ma.array([1.0, 0.0], mask=False),
        pd.Categorical([1.0, 0.0]),
    ],
)
def test_numbers_of_any_type_are_numbers(record: toolkit.Record, values: Any) -> None:
    assert apply(values).value["FY"].tolist() == apply([1.0, 0.0]).value["FY"].tolist()


def test_a_list_of_quantities_has_their_unit() -> None:
    record = toolkit.open_laboratory(toolkit.example("home")).in_force("m15-virtual")
    data = {"D51": [Q(0.1, "mV/V"), Q(200, "uV/V")], "D52 [mV/V]": [0.1, 0.2], "E5 [mV/V]": [0.3, 0.3]}
    assert record.apply(data).value["FY"] == pytest.approx(record.apply(GOOD).value["FY"], rel=1e-12)


@pytest.mark.parametrize(
    ("units", "rule"),
    [
        ({"D51": "V/V"}, "two-units"),
        ({"D51 [mV/V]": "V/V"}, "two-units"),
        ({"Q": "V/V"}, "data-columns"),
        ({"d51": "mV/V"}, "data-columns"),
        ({"D51": None}, "data-columns"),
        ("mV/V", "data-columns"),
    ],
)
def test_every_stated_unit_is_of_a_column_and_agrees_with_its_header(
    record: toolkit.Record, units: Any, rule: str
) -> None:
    with pytest.raises(ToolkitError) as caught:
        record.apply(GOOD, units=units)
    assert caught.value.rule == rule


def test_a_unit_that_agrees_with_the_header_is_no_contradiction(record: toolkit.Record) -> None:
    assert record.apply(GOOD, units={"D51": "mV/V", "D52 [mV/V]": "mV/V"}, uncertainty=False)


@pytest.mark.parametrize(
    "tare",
    [
        {"D51": 0.0, "D52": 0.0, "E5": np.nan},
        {"D51": 0.0, "D52": 0.0, "E5": [0.0, 0.1]},
        {"D51": 0.0, "D52": 0.0, "E5": 0.0, "e5": 0.1},
        {"D51": 0.0, "D52": 0.0},
        [0.0, 0.0, 0.0],
    ],
)
def test_a_tare_is_one_number_of_every_indication(record: toolkit.Record, tare: Any) -> None:
    with pytest.raises(ToolkitError) as caught:
        record.apply(GOOD, tare=tare)
    assert caught.value.rule == "data-columns"


def test_columns_whose_rows_have_other_names_are_not_put_side_by_side(record: toolkit.Record) -> None:
    data: dict[str, Any] = {name: pd.Series(values) for name, values in GOOD.items()}
    assert record.apply(data, uncertainty=False)
    data["E5 [mV/V]"] = pd.Series([0.3, 0.3], index=[1, 0])
    with pytest.raises(ToolkitError, match="rows") as caught:
        record.apply(data, uncertainty=False)
    assert caught.value.rule == "data-columns"


@pytest.mark.parametrize("data", [None, 3, "a.csv", [1, 2], np.ones((2, 2)), object()])
def test_what_is_no_table_is_refused(record: toolkit.Record, data: Any) -> None:
    tire = toolkit.read_tire(toolkit.example("tire"))
    for door in (record.apply, tire.evaluate):
        with pytest.raises(ToolkitError) as caught:
            door(data)
        assert caught.value.rule == "data-columns"
    if not isinstance(data, str):
        with pytest.raises(ToolkitError) as caught:
            toolkit.fit_tire(data)
        assert caught.value.rule == "data-columns"


def test_a_table_of_any_library_with_columns_is_one(record: toolkit.Record) -> None:
    class Frame:
        """As polars has it: iterated it gives its columns, not their names."""

        columns = tuple(GOOD)

        def __iter__(self) -> Any:
            return iter(GOOD.values())

        def __getitem__(self, name: str) -> Any:
            return GOOD[name]

    expected = record.apply(GOOD, uncertainty=False).value["FY"].tolist()
    assert record.apply(Frame(), uncertainty=False).value["FY"].tolist() == expected  # type: ignore[arg-type]


def test_a_refusal_names_the_row_of_the_frame_and_no_file() -> None:
    frame = pd.DataFrame(table([1.0, np.nan]), index=["first", "second"])
    with pytest.raises(ToolkitError) as caught:
        toolkit.fit_tire(frame)
    assert "row 2 (second)" in str(caught.value.where)
    frame = pd.DataFrame(table([1.0, 1e9]))
    with pytest.raises(ToolkitError) as caught:
        toolkit.fit_tire(frame)
    assert caught.value.rule == "impossible-value"
    assert str(caught.value.where).startswith("the data, row 2, column 'FY [N]'")


def test_the_example_of_a_unit_is_of_the_columns_kind() -> None:
    with pytest.raises(ToolkitError) as caught:
        toolkit.fit_tire({"SA": [0.0], "FZ [N]": [1.0], "FY [N]": [1.0]})
    assert "'SA [deg]'" in str(caught.value.expected)
    assert "[N]" not in str(caught.value.expected)
