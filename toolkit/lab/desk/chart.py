"""Charts of the workbench: one form for tests, files, sized models, predictions, records and plans.

Every series has its own x. Where one belongs to a load and a direction, the page's switches show and hide it;
where it has a label, the page has a word for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NotRequired, TypedDict

if TYPE_CHECKING:
    from toolkit.arrays import Array

    Rows = Sequence[float] | Array

SAMPLES = 3 * 2**10
"""Rows that a chart draws at most: the others are left out, each by its place."""
_UNITS = {"FY": "N", "MZ": "N·m"}


class Condition(TypedDict):
    """Where a series belongs: a load, by its place among those of the test too, and a direction."""

    load: int
    load_N: float
    rotation: str


class Series(TypedDict):
    """Values that a chart draws as a line, or as symbols with their U."""

    x: Sequence[float]
    y: Sequence[float]
    line: NotRequired[bool]
    label: NotRequired[str]
    U: NotRequired[Sequence[float]]
    U_x: NotRequired[Sequence[float]]
    dash: NotRequired[bool]
    condition: NotRequired[Condition]


class Chart(TypedDict):
    """Series over one pair of axes; a range holds an axis still."""

    x_label: str
    y_label: str
    series: list[Series]
    x_range: NotRequired[list[float]]
    y_range: NotRequired[list[float]]


def sampling(rows: int) -> int:
    """Return every how many of some rows a chart draws.

    >>> sampling(3072), sampling(3073)
    (1, 2)
    """
    return max(1, -(-rows // SAMPLES))


def row_chart(load: str, old: Rows | None, new: Rows) -> Chart:
    """Return a load of one file over its rows: by the record in force, and as the file has it."""
    step = sampling(len(new))
    rows = list(range(1, len(new) + 1, step))
    curves = {"file": old, "record": new}
    return {
        "x_label": "row",
        "y_label": f"{load} [{_UNITS[load]}]",
        "series": [
            {"label": label, "x": rows, "y": [float(value) for value in values[::step]], "line": True}
            for label, values in curves.items()
            if values is not None
        ],
    }


def common_ranges(charts: Sequence[Chart]) -> dict[str, list[float]]:
    """Return the ranges of both axes that hold every point of some charts with its U."""
    series = [drawn for chart in charts for drawn in chart["series"]]
    extents = {
        "x_range": [_ends(drawn["x"], drawn.get("U_x")) for drawn in series],
        "y_range": [_ends(drawn["y"], drawn.get("U")) for drawn in series],
    }
    ranges = {}
    for axis, each in extents.items():
        if ends := [end for pair in each for end in pair]:
            pad = 0.04 * (max(ends) - min(ends) or 1.0)
            ranges[axis] = [min(ends) - pad, max(ends) + pad]
    return ranges


def _ends(values: Sequence[float], U: Sequence[float] | None) -> list[float]:
    halves = U or [0.0] * len(values)
    return [end for v, half in zip(values, halves, strict=True) for end in (v - half, v + half)]
