"""Pictures that stand in a page as SVG: elements, whose texts and attributes are escaped when written."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from xml.etree import ElementTree as ET

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
        return Markup(ET.tostring(self._root, encoding="unicode"))  # noqa: S704  escaped by the writer

    def _add(self, tag: str, kind: str, values: Mapping[str, float | str]) -> ET.Element:
        attributes = {
            name: value if isinstance(value, str) else f"{value:.1f}" for name, value in values.items()
        }
        return ET.SubElement(self._root, tag, {"class": kind} | attributes if kind else attributes)
