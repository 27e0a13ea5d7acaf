"""Charts of a record as the page's script draws them: numbers of the answers, in the session's units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def residual_chart(rows: Mapping[str, Any], unit: str) -> dict[str, Any]:
    """Return residuals over the reference load, by direction where the session states it.

    >>> rows = {"reference": [2.0, 1.0], "residual": [0.1, -0.1], "direction": ["up", "down"]}
    >>> residual_chart(rows, "N")["data"]
    [[1.0, 2.0], [None, 0.1], [-0.1, None]]
    """
    senses = rows["direction"] or [""] * len(rows["reference"])
    names = list(dict.fromkeys(sorted(senses, reverse=True)))
    order = sorted(range(len(senses)), key=lambda at: float(rows["reference"][at]))
    return {
        "x_label": f"reference [{unit}]",
        "y_label": f"residual [{unit}]",
        "series": [{"label": f"residual {name}".strip()} for name in names],
        "data": [
            [rows["reference"][at] for at in order],
            *([rows["residual"][at] if senses[at] == name else None for at in order] for name in names),
        ],
    }


def budget_chart(load: str, budget: Mapping[str, Any]) -> dict[str, Any]:
    """Return U over the range of a load."""
    unit = budget["unit"]
    return {
        "x_label": f"{load} [{unit}]",
        "y_label": f"U [{unit}]",
        "series": [{"label": "U", "line": True}],
        "data": [[point["value"] for point in budget["range"]], [point["U"] for point in budget["range"]]],
    }
