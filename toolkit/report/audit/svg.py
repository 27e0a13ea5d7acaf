"""Pictures of an audit as SVG: the timeline of the versions, and the rows of a file, old and new."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

import numpy as np

from toolkit.arrays import Array
from toolkit.audit.timeline import Stretch, Timeline
from toolkit.report.pages.kit import drawn

if TYPE_CHECKING:
    from markupsafe import Markup


class Drawing:
    """A picture of a width and height in pixels, drawn from the upper left; ``label`` says what it shows.

    The classes (``kind``) are those of the page's style sheet.
    """

    def __init__(self, *, width: int, height: int, label: str) -> None:
        size = {"viewBox": f"0 0 {width} {height}", "width": str(width), "height": str(height)}
        self._root = ET.Element("svg", size | {"role": "img", "aria-label": label})

    def line(self, start: tuple[float, float], end: tuple[float, float], kind: str) -> None:
        """Draw a straight line."""
        (x1, y1), (x2, y2) = start, end
        self._add("line", kind, {"x1": x1, "y1": y1, "x2": x2, "y2": y2})

    def polyline(self, points: Iterable[tuple[float, float]], kind: str) -> None:
        """Draw a line through points."""
        self._add("polyline", kind, {"points": " ".join(f"{x:.1f},{y:.1f}" for x, y in points)})

    def text(self, at: tuple[float, float], kind: str, *spans: str | tuple[str, str]) -> None:
        """Write a line of text; a span of a class of its own is a pair of text and class."""
        element = self._add("text", kind, {"x": at[0], "y": at[1]})
        for span in spans:
            text, span_kind = (span, None) if isinstance(span, str) else span
            if span_kind is not None:
                ET.SubElement(element, "tspan", {"class": span_kind}).text = text
            elif len(element):
                element[-1].tail = (element[-1].tail or "") + text
            else:
                element.text = (element.text or "") + text

    def bar(self, at: tuple[float, float], size: tuple[float, float], kind: str, title: str) -> None:
        """Draw a rectangle from its upper left corner; its title shows under the pointer."""
        place = {"x": at[0], "y": at[1], "width": size[0], "height": size[1]}
        ET.SubElement(self._add("rect", kind, place), "title").text = title

    def dot(
        self, at: tuple[float, float], radius: float, kind: str, *, title: str = "", grade: str = ""
    ) -> None:
        """Draw a filled circle, in the colour of a grade where it has one."""
        element = self._add("circle", kind, {"cx": at[0], "cy": at[1], "r": radius})
        if grade:
            element.set("data-grade", grade)
        if title:
            ET.SubElement(element, "title").text = title

    def markup(self) -> Markup:
        """Return the picture as it stands in a page."""
        return drawn(ET.tostring(self._root, encoding="unicode"))

    def _add(self, tag: str, kind: str, values: Mapping[str, float | str]) -> ET.Element:
        attributes = {
            name: value if isinstance(value, str) else f"{value:.1f}" for name, value in values.items()
        }
        return ET.SubElement(self._root, tag, {"class": kind} | attributes if kind else attributes)


_MOST_POINTS = 600


def timeline(versions: Timeline) -> Markup:
    """Return when each record was in force, and the files that it computed: a lane a record or grade."""
    counts, first, last = versions.counts, versions.first, versions.last
    programs = sorted({computer for computer, _, _ in counts} - {lane.record for lane in versions.stretches})
    lanes = [*versions.stretches, *(Stretch(record=name, begin=None, end=None) for name in programs)]
    margin_left, margin_right, top, height, width = 130, 20, 14, 24, 1040
    days = max((last - first).days, 1)
    right, bottom = width - margin_right, top + height * len(lanes)

    def x(day: dt.date) -> float:
        inside = min(max((day - first).days, 0), days)
        return margin_left + inside / days * (right - margin_left)

    def y(lane: int) -> float:
        return top + height * lane + height / 2

    drawing = Drawing(width=width, height=bottom + 30, label="timeline of the calibrations")
    step = max(1, -(-(last.year - first.year + 1) // 14))
    for year in range(first.year, last.year + 2, step):
        new_year = dt.date(year, 1, 1)
        if first <= new_year <= last:
            drawing.line((x(new_year), top), (x(new_year), bottom), "grid")
            drawing.text((x(new_year), bottom + 16), "middle", str(year))
    for number, lane in enumerate(lanes):
        drawing.text((margin_left - 8, y(number) + 4), "end", lane.record)
        drawing.line((margin_left, y(number)), (right, y(number)), "grid")
        if lane.begin is not None:
            begin, end = x(lane.begin), x(lane.end or last)
            status = "void" if lane.void else "in force"
            until = f" to {lane.end}" if lane.end else ""
            drawing.bar(
                (begin, y(number) - 8), (max(end - begin, 1.0), 16.0), "void" if lane.void else "force",
                title=f"{lane.record} {status} from {lane.begin}{until}",
            )  # fmt: skip
    lane_of = {lane.record: number for number, lane in enumerate(lanes)}
    for (computer, month, grade), count in sorted(counts.items(), key=lambda item: (-item[1], item[0])):
        drawing.dot(
            (x(dt.date.fromisoformat(f"{month}-15")), y(lane_of[computer])), min(2.0 + count**0.5, 9.0),
            "dot", title=f"{month}: {count} {grade}, {computer}", grade=grade,
        )  # fmt: skip
    return drawing.markup()


def rows_of(load: str, unit: str, old: Array, new: Array, *, width: int = 500) -> Markup:
    """Return one load of a file against its rows, as the file has it and by the record in force."""
    left, top, height = 62, 10, 150
    right = width - 10
    low = float(min(old.min(), new.min()))
    high = float(max(old.max(), new.max()))
    if high <= low:
        low, high = low - 1.0, high + 1.0
    pad = 0.06 * (high - low)
    low, high = low - pad, high + pad
    plotted = np.unique(
        np.linspace(0, len(old) - 1, min(len(old), _MOST_POINTS)).round().astype(int)
    ).tolist()
    span = max(len(old) - 1, 1)

    def y(value: float) -> float:
        return top + (high - value) / (high - low) * height

    drawing = Drawing(width=width, height=top + height + 34, label=f"{load} by row")
    for value in _ticks(low, high):
        drawing.line((left, y(value)), (right, y(value)), "grid")
        drawing.text((left - 6, y(value) + 4), "end", f"{value:g}")
    for values, kind in ((old, "file"), (new, "right")):
        drawing.polyline(((left + i / span * (right - left), y(float(values[i]))) for i in plotted), kind)
    foot = top + height + 26
    drawing.text((left, foot), "start", f"row 1 to {len(old)}; {load} [{unit}]")
    drawing.text((right, foot), "end", ("file", "file"), " \u2003", ("record in force", "right"))
    return drawing.markup()


def _ticks(low: float, high: float) -> list[float]:
    rough = (high - low) / 5
    power = 10.0 ** np.floor(np.log10(rough))
    step = float(power * min((m for m in (1, 2, 5, 10) if m * power >= rough), default=10))
    first = float(np.ceil(low / step) * step)
    return [round(first + i * step, 10) for i in range(int((high - first) / step + 1e-9) + 1)]
