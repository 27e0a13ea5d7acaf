"""The answer of a diagnosis that a home keeps, as a page shows it: answer, figures, predictions.

The figures are those of the answer's own page: drawings in SVG, shown as pictures, in which no script runs.
"""

from __future__ import annotations

import csv
import html
import io
import json
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from toolkit.errors import UnreadableError
from toolkit.inputs import RESULT_FILE, TABLE_FILE, read_input, read_regular
from toolkit.lab.desk.chart import Chart, Series, sampling
from toolkit.lab.desk.holdings import ANSWER

PAGE, PREDICTIONS = "diagnosis.html", "predictions"
_FIGURE = re.compile(r'<img alt="([^"]*)" src="(data:image/svg\+xml;base64,[A-Za-z0-9+/=]+)">')
_NEEDED = (
    "title", "verdict", "remaining", "complete", "mismatch", "effects", "nominal_parameters", "fit",
    "not_found", "next_measurements", "findings", "draft_reasons",
)  # fmt: skip
_CURVES = ("nominal", "refitted", "augmented")
_FIRST = f"_{_CURVES[0]}"
_MOST_CHARTS = 24


@dataclass(frozen=True, slots=True, kw_only=True)
class SeenDiagnosis:
    """An answer; ``figures`` are (text, address of the picture), ``charts`` (file and channel, chart)."""

    answer: dict[str, Any]
    figures: tuple[tuple[str, str], ...]
    charts: tuple[tuple[str, Chart], ...]


def read_diagnosis(folder: Path) -> SeenDiagnosis:
    """Read the answer of a diagnosis.

    Raises
    ------
    UnreadableError
        it is none; what stands beside it may lack
    """
    data = read_input(folder / ANSWER, RESULT_FILE)
    try:
        answer = json.loads(data)
        lacking = [key for key in _NEEDED if key not in answer]
    except (ValueError, TypeError) as error:
        raise _none(folder, str(error)) from error
    if lacking or not isinstance(answer, dict):
        raise _none(folder, f"no {', '.join(lacking)}")
    charts = tuple(zip(range(_MOST_CHARTS), _charts(folder / PREDICTIONS), strict=False))
    return SeenDiagnosis(
        answer=answer, figures=tuple(_figures(folder / PAGE)), charts=tuple(chart for _, chart in charts)
    )


def _figures(path: Path) -> Iterator[tuple[str, str]]:
    try:
        text = read_regular(path, RESULT_FILE).decode()
    except (OSError, ValueError):
        return
    yield from ((html.unescape(alt), source) for alt, source in _FIGURE.findall(text))


def _charts(folder: Path) -> Iterator[tuple[str, Chart]]:
    """Yield the predictions of each channel over the time of its file, else over its rows."""
    for path in sorted(folder.glob("*.csv")):
        try:
            rows = list(csv.reader(io.StringIO(read_regular(path, TABLE_FILE).decode())))
            columns = dict(zip(rows[0], zip(*rows[1:], strict=True), strict=True))
            step = sampling(len(rows) - 1)
            numbers = {name: [float(text) for text in column[::step]] for name, column in columns.items()}
        except (OSError, ValueError, IndexError):
            continue
        channels = [name.removesuffix(_FIRST) for name in numbers if name.endswith(_FIRST)]
        # The first column is the time, where the case has one: each channel brings its own columns.
        first = next(iter(numbers), "")
        timed = bool(first) and not any(first == f"{name}_{curve}" for name in channels for curve in _CURVES)
        x_label, x = (first, numbers[first]) if timed else ("row", list(range(1, len(rows), step)))
        for channel in channels:
            series: list[Series] = [
                {"label": curve, "x": x, "y": numbers[f"{channel}_{curve}"], "line": True}
                for curve in _CURVES
                if f"{channel}_{curve}" in numbers and all(map(math.isfinite, numbers[f"{channel}_{curve}"]))
            ]
            if series:
                yield f"{path.name}: {channel}", {"x_label": x_label, "y_label": channel, "series": series}


def _none(folder: Path, actual: str) -> UnreadableError:
    return UnreadableError(
        "the answer of the diagnosis cannot be read", where=folder / ANSWER, got=actual,
        expected="diagnosis.json as 'toolkit diagnose' writes it", next_step="run the diagnosis again",
        rule="no-file",
    )  # fmt: skip
