"""Curves of a test: every point is a number of `process --json`, every series says where it belongs."""

from __future__ import annotations

import math

import pytest

from toolkit.lab.desk.chart import common_ranges, row_chart


def test_a_row_chart_keeps_few_rows_whole_and_thins_many_to_their_own_values() -> None:
    whole = row_chart("FY", [1.0, 2.0], [1.5, 2.5])["series"]
    assert [(one["label"], one["x"], one["y"]) for one in whole] == [
        ("file", [1, 2], [1.0, 2.0]), ("record", [1, 2], [1.5, 2.5]),
    ]  # fmt: skip
    values = [math.sin(row) for row in range(100_000)]
    (thin,) = row_chart("MZ", None, values)["series"]
    assert len(thin["x"]) <= 3072
    assert all(values[row - 1] == value for row, value in zip(thin["x"], thin["y"], strict=True))


def test_common_ranges_hold_every_point_of_both_with_its_uncertainty() -> None:
    left = {"series": [{"x": [0.0, 1.0], "y": [5.0, 6.0], "U": [1.0, 3.0]}]}
    right = {"series": [{"x": [-2.0], "y": [4.0], "line": True}]}
    ranges = common_ranges([left, right])
    low, high = ranges["y_range"]
    assert low < 4.0
    assert high > 9.0
    assert ranges["x_range"] == pytest.approx([-2.12, 1.12])
    assert common_ranges([{"series": []}]) == {}
