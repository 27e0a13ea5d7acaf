"""An organisation's own words in figures and tables: ``[words]`` of the style file.

What people wrote, names, notes and findings, is never touched: only the terms that the toolkit itself prints.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

from toolkit.report.content import Plot, Table, Value

_VALUES = (
    "test.directions test.averaging test.tare simulated calibration.status report.title report.deviations"
).split()
_COLUMNS = ("rotation", "quantity", "level", "channel")


def say(text: str, words: Mapping[str, str]) -> str:
    """Return a text with every term replaced, the longest first, once each place.

    >>> say("slip angle SA [deg]", {"slip angle": "Schräglaufwinkel", "angle": "Winkel"})
    'Schräglaufwinkel SA [deg]'
    """
    if not words:
        return text
    terms = sorted(words, key=len, reverse=True)
    pattern = "|".join(rf"(?<!\w){re.escape(term)}(?!\w)" for term in terms)
    return re.sub(pattern, lambda found: words[found[0]], text)


def say_values(values: dict[str, Value], words: Mapping[str, str]) -> dict[str, Value]:
    """Return the values with the toolkit's own texts in the organisation's words."""
    return values | {
        path: replace(values[path], value=say(text, words))
        for path in _VALUES
        if path in values and isinstance(text := values[path].value, str)
    }


def say_table(table: Table, words: Mapping[str, str]) -> Table:
    """Return a table with its direction, quantity and level columns in the organisation's words."""
    ours = [column.name in _COLUMNS for column in table.columns]
    rows = tuple(
        tuple(
            say(cell, words) if own and isinstance(cell, str) else cell
            for own, cell in zip(ours, row, strict=True)
        )
        for row in table.rows
    )
    return replace(table, rows=rows)


def say_plot(plot: Plot, words: Mapping[str, str], alt: Mapping[str, str]) -> Plot:
    """Return a figure with its axes, legend and caption in the organisation's words.

    Its alternative text is made of sentences: for these ``alt`` has words that would be too short elsewhere.
    """
    return replace(
        plot,
        alt=say(plot.alt, {**words, **alt}),
        x_label=say(plot.x_label, words),
        y_label=say(plot.y_label, words),
        caption=say(plot.caption, words),
        watermark=None if plot.watermark is None else say(plot.watermark, words),
        legend_title=None if plot.legend_title is None else say(plot.legend_title, words),
        curves=tuple(replace(one, label=say(one.label, words)) for one in plot.curves),
    )
