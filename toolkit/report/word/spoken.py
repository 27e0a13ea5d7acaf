"""Charts as they are heard: LibreOffice leaves their alternative texts out of a PDF, and they are put in.

A chart is an element *Figure* of the PDF's tree of structure, with elements of its own for the texts in it
(ISO 32000-1, 14.7 and 14.9.3). It is known by its size on the page, and by its order.
"""

from __future__ import annotations

import codecs
import io
from collections.abc import Iterator, Sequence
from typing import Any

from toolkit.report.word.chart import Chart
from toolkit.report.word.xml import clean
from toolkit.trust.seal.pdf import pdf_writer

_EMU_POINT = 12700
_NEAR = 1.0  # points: LibreOffice rounds to a hundredth of a millimetre


def with_alternatives(pdf: bytes, charts: Sequence[Chart]) -> bytes:
    """Return a PDF whose charts have their alternative texts; one that is not found stays without."""
    from pyhanko.pdf_utils import generic

    writer = pdf_writer(pdf)
    mute = [figure for figure in _figures(writer.root["/StructTreeRoot"]) if "/Alt" not in figure]
    for chart in charts:
        figure = next((figure for figure in mute if _is_of(figure, chart)), None)
        if figure is None:
            continue
        mute.remove(figure)
        text = codecs.BOM_UTF16_BE + clean(chart.alt).replace("\n", " ").encode("utf-16-be")
        figure["/Alt"] = generic.ByteStringObject(text)
        writer.mark_update(figure.container_ref)
    stream = io.BytesIO()
    writer.write(stream)
    return stream.getvalue()


def _figures(element: Any) -> Iterator[Any]:
    """Yield the figures of a tree of structure in the order of reading."""
    for child in _elements(element):
        if child["/S"] == "/Figure":
            yield child
        yield from _figures(child)


def _is_of(figure: Any, chart: Chart) -> bool:
    """Tell whether a figure has the chart's size, and texts within as no picture has."""
    box = figure["/A"].get("/BBox") if "/A" in figure else None
    if box is None or next(_elements(figure), None) is None:
        return False
    left, low, right, high = (float(edge) for edge in box)
    off = (right - left - chart.width_emu / _EMU_POINT, high - low - chart.height_emu / _EMU_POINT)
    return max(map(abs, off)) < _NEAR


def _elements(element: Any) -> Iterator[Any]:
    """Yield the elements right below one; what else stands there is content of a page."""
    below = element.get("/K", [])
    for reference in below if isinstance(below, list) else (below,):
        child = reference.get_object()
        if hasattr(child, "get") and "/S" in child:
            yield child
