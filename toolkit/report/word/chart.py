"""A figure as a chart of Word's own: DrawingML with its numbers in a workbook, so that Word can edit it.

Source of the elements and their order: ECMA-376, part 1, 21.2 (charts) and 11.3.4 (embedded package).

LibreOffice leaves the alternative texts of charts out of a PDF, and they are put in. A chart is an element
*Figure* of the PDF's tree of structure, with elements of its own for the texts in it (ISO 32000-1, 14.7 and
14.9.3). It is known by its size on the page, and by its order.
"""

from __future__ import annotations

import codecs
import io
import math
import re
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Any
from xml.sax.saxutils import escape

from toolkit.report.content import Curve, Plot
from toolkit.report.figures import COLOURS
from toolkit.report.word.package import undated
from toolkit.report.word.xml import NS, clean
from toolkit.trust.seal.pdf import pdf_writer

CHART_TYPE = "application/vnd.openxmlformats-officedocument.drawingml.chart+xml"
BOOK_TYPE = "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet"
BOOK_RELATION = "rId1"

# LibreOffice draws no outline around a marker: an empty one would be white on white, a cross is not.
_MARKERS, _OPEN = ("circle", "square", "triangle", "diamond"), "x"
_GREY, _GRID, _AXIS = "8A8A8A", "D9D9D9", "606060"
_POINT = 12700  # EMU
_SMALLEST = 300  # hundredths of a point
_STEPS = 8  # of the upright axis, at most
_SHEET_NAME = 31  # characters that Excel allows
_MODIFIED = re.compile(rb"<dcterms:(created|modified)[^>]*>[^<]*</dcterms:\1>")


@dataclass(frozen=True, slots=True, kw_only=True)
class Chart:
    """A chart of Word's own: its alternative text, its size on the page, and the texts that it shows."""

    tag: str
    alt: str
    width_emu: int
    height_emu: int
    texts: tuple[str, ...]


def chart_xml(plot: Plot, language: str, *, scale: float = 1.0) -> bytes:
    """Return the chart part of a figure.

    Parameters
    ----------
    language : a locale such as ``de-DE``
    scale : of its texts and markers, which shrink with a narrow figure as those of a picture do
    """
    spaces = " ".join(f'xmlns:{prefix}="{NS[prefix]}"' for prefix in ("c", "a", "r"))
    legend = _legend(plot) if _has_legend(plot) else ""
    title = _title(plot.watermark, 14 * scale, colour=_GREY, bold=True) if plot.watermark else ""
    return (
        '<?xml version="1.0" encoding="UTF-8" standalone="yes"?>\n'
        f'<c:chartSpace {spaces}><c:date1904 val="0"/>'
        f'<c:lang val="{language}"/><c:roundedCorners val="0"/><c:chart>{title}'
        f'<c:autoTitleDeleted val="{0 if title else 1}"/><c:plotArea><c:layout/><c:scatterChart>'
        f'<c:scatterStyle val="lineMarker"/><c:varyColors val="0"/>{_series(plot, scale)}'
        f'<c:axId val="1"/><c:axId val="2"/></c:scatterChart>{_axes(plot, scale)}</c:plotArea>{legend}'
        '<c:plotVisOnly val="1"/><c:dispBlanksAs val="gap"/></c:chart>'
        '<c:spPr><a:solidFill><a:srgbClr val="FFFFFF"/></a:solidFill><a:ln><a:noFill/></a:ln></c:spPr>'
        f"<c:txPr><a:bodyPr/><a:lstStyle/><a:p><a:pPr><a:defRPr {_size(9 * scale)}/></a:pPr>"
        f'<a:endParaRPr lang="{language}"/></a:p></c:txPr>'
        f'<c:externalData r:id="{BOOK_RELATION}"><c:autoUpdate val="0"/></c:externalData></c:chartSpace>'
    ).encode()


def chart_book(plot: Plot) -> bytes:
    """Return the workbook behind a chart: x, y and the half length of its bars, a series after the other.

    The same figure is the same bytes on any day.
    """
    from openpyxl import Workbook

    book = Workbook()
    sheet: Any = book.active
    sheet.title = _sheet(plot)
    for (curve, name), column in zip(_named(plot), count(1, 3), strict=False):
        columns = [(plot.x_label, curve.x), (name, curve.y)]
        columns += [(f"± {name}", curve.error)] if curve.error is not None and any(curve.error) else []
        for at, (head, numbers) in enumerate(columns, start=column):
            cell = sheet.cell(1, at, clean(head))
            cell.data_type = "s"  # a name that begins with = is a text all the same
            for row, number in enumerate(numbers, start=2):
                sheet.cell(row, at, number if math.isfinite(number) else None)
    sheet.freeze_panes = "A2"
    stream = io.BytesIO()
    book.save(stream)
    still = io.BytesIO()
    with zipfile.ZipFile(stream) as source, zipfile.ZipFile(still, "w", zipfile.ZIP_DEFLATED) as target:
        for member in source.namelist():
            data = source.read(member)
            target.writestr(member, _MODIFIED.sub(b"", data) if member == "docProps/core.xml" else data)
    return undated(still.getvalue())


def chart_texts(plot: Plot) -> tuple[str, ...]:
    """Return the texts that a chart shows: its mark, its axes, and the names in its legend."""
    names = (name for curve, name in _named(plot) if curve.label) if _has_legend(plot) else ()
    return tuple(dict.fromkeys(text for text in (plot.watermark, plot.x_label, plot.y_label, *names) if text))


def _has_legend(plot: Plot) -> bool:
    entries = {(curve.label, curve.group) for curve in plot.curves if curve.label}
    return bool(plot.legend_title) or len(entries) > 1


def _named(plot: Plot) -> list[tuple[Curve, str]]:
    """Return the curves with the names of their series; the legend's title stands in each of them."""
    title = f"{plot.legend_title}: " if plot.legend_title else ""
    return [(curve, f"{title}{curve.label}" if curve.label else curve.note or "") for curve in plot.curves]


def _series(plot: Plot, scale: float) -> str:
    elements = []
    for (curve, name), column in zip(_named(plot), count(1, 3), strict=False):
        number = (column - 1) // 3
        bars = curve.error is not None and any(curve.error)
        elements.append(
            f'<c:ser><c:idx val="{number}"/><c:order val="{number}"/>'
            f'<c:tx><c:strRef><c:f>{_cells(plot, column + 1, 1, 1)}</c:f><c:strCache><c:ptCount val="1"/>'
            f'<c:pt idx="0"><c:v>{_text(name)}</c:v></c:pt></c:strCache></c:strRef></c:tx>'
            f"{_line_of(curve)}{_marker_of(curve, scale)}{_note_of(curve, scale)}"
            + (_bars(plot, curve, column + 2) if bars else "")
            + f"<c:xVal>{_numbers(plot, curve.x, column)}</c:xVal>"
            f'<c:yVal>{_numbers(plot, curve.y, column + 1)}</c:yVal><c:smooth val="0"/></c:ser>'
        )
    return "".join(elements)


def _colour(curve: Curve) -> str:
    return _GREY if curve.style == "grid" else COLOURS[curve.group % len(COLOURS)].lstrip("#")


def _line_of(curve: Curve) -> str:
    if curve.style == "points":
        return f'<c:spPr><a:ln w="{_POINT}"><a:noFill/></a:ln></c:spPr>'
    width, dashed = (0.7, False) if curve.style == "grid" else (1.25, curve.open)
    return f"<c:spPr>{_stroke(_colour(curve), width, dashed=dashed)}</c:spPr>"


def _marker_of(curve: Curve, scale: float) -> str:
    if curve.style in ("line", "grid"):
        return '<c:marker><c:symbol val="none"/></c:marker>'
    colour = _colour(curve)
    symbol = _OPEN if curve.open else _MARKERS[curve.group % len(_MARKERS)]
    return (
        f'<c:marker><c:symbol val="{symbol}"/><c:size val="{max(2, round(5 * scale))}"/><c:spPr>'
        f'<a:solidFill><a:srgbClr val="{colour}"/></a:solidFill>{_stroke(colour, 0.9)}</c:spPr></c:marker>'
    )


def _note_of(curve: Curve, scale: float) -> str:
    """Return the label at the end of a line: the series' own name."""
    if not curve.note:
        return ""
    flags = "".join(
        f'<c:show{flag} val="{int(flag == "SerName")}"/>'
        for flag in ("LegendKey", "Val", "CatName", "SerName", "Percent", "BubbleSize")
    )
    none = flags.replace('"1"', '"0"')
    look = f"<a:pPr><a:defRPr {_size(7.5 * scale)}/></a:pPr>"
    text = f"<c:txPr><a:bodyPr/><a:lstStyle/><a:p>{look}{_END}</a:p></c:txPr>"
    return (
        f'<c:dLbls><c:dLbl><c:idx val="{len(curve.x) - 1}"/><c:spPr><a:noFill/></c:spPr>{text}'
        f'<c:dLblPos val="{"t" if curve.y[-1] >= 0 else "b"}"/>{flags}</c:dLbl>{none}</c:dLbls>'
    )


def _bars(plot: Plot, curve: Curve, column: int) -> str:
    numbers = _numbers(plot, curve.error or (), column)
    return (
        '<c:errBars><c:errDir val="y"/><c:errBarType val="both"/><c:errValType val="cust"/>'
        f'<c:noEndCap val="0"/><c:plus>{numbers}</c:plus><c:minus>{numbers}</c:minus>'
        f"<c:spPr>{_stroke(_colour(curve), 1.0)}</c:spPr></c:errBars>"
    )


def _numbers(plot: Plot, numbers: Sequence[float], column: int) -> str:
    # Every series has the rows of the longest: LibreOffice 7.4 loses a shorter one that stands before it.
    rows = max(len(curve.x) for curve in plot.curves)
    points = "".join(
        f'<c:pt idx="{at}"><c:v>{number!r}</c:v></c:pt>'
        for at, number in enumerate(numbers)
        if math.isfinite(number)
    )
    return (
        f"<c:numRef><c:f>{_cells(plot, column, 2, rows + 1)}</c:f><c:numCache><c:formatCode>General"
        f'</c:formatCode><c:ptCount val="{rows}"/>{points}</c:numCache></c:numRef>'
    )


def _axes(plot: Plot, scale: float) -> str:
    """Return both axes: they cross at zero where the figure has a line there; labels stand at the edge."""
    low, high, step = _scale(plot)
    ends = f'<c:max val="{high:.12g}"/><c:min val="{low:.12g}"/>'
    two = '<c:majorUnit val="2"/>' if plot.zero_x else ""
    across = "autoZero" if plot.zero_y else "min"
    upright = "autoZero" if plot.zero_x else "min"
    # An axis says where it crosses the other one.
    return _axis(plot, 1, 2, plot.x_label, "", across, two, scale) + _axis(
        plot, 2, 1, plot.y_label, ends, upright, f'<c:majorUnit val="{step:.12g}"/>', scale
    )


def _scale(plot: Plot) -> tuple[float, float, float]:
    """Return ends and step of the upright axis: neither program makes room for the bars of uncertainty."""
    ends = [
        value + side * error
        for curve in plot.curves
        for value, error in zip(curve.y, curve.error or (0.0,) * len(curve.y), strict=True)
        for side in (-1.0, 1.0)
        if math.isfinite(value + error)
    ] + ([0.0] if plot.zero_y else [])
    low, high = min(ends, default=0.0), max(ends, default=1.0)
    rough = (high - low or abs(high) or 1.0) / _STEPS
    decade = 10.0 ** math.floor(math.log10(rough))
    step = next(size * decade for size in (1, 2, 2.5, 5, 10) if size * decade >= rough)
    return step * math.floor(low / step), step * math.ceil(high / step), step


def _axis(
    plot: Plot, axis_id: int, crossing_id: int, label: str, ends: str, crosses: str, step: str, scale: float
) -> str:
    title = _title(label, 10 * scale, colour="000000", upright=axis_id == 2) if label else ""
    # LibreOffice takes the decimal sign from the language of the format, Word from the system's region.
    sign = "407" if plot.decimal_comma else "409"
    return (
        f'<c:valAx><c:axId val="{axis_id}"/><c:scaling><c:orientation val="minMax"/>{ends}</c:scaling>'
        f'<c:delete val="0"/><c:axPos val="{"b" if axis_id == 1 else "l"}"/>'
        f"<c:majorGridlines><c:spPr>{_stroke(_GRID, 0.6)}</c:spPr></c:majorGridlines>{title}"
        f'<c:numFmt formatCode="[$-{sign}]General" sourceLinked="0"/><c:majorTickMark val="out"/>'
        f'<c:minorTickMark val="none"/><c:tickLblPos val="low"/><c:spPr>{_stroke(_AXIS, 0.8)}</c:spPr>'
        f'<c:crossAx val="{crossing_id}"/><c:crosses val="{crosses}"/><c:crossBetween val="midCat"/>{step}'
        "</c:valAx>"
    )


def _legend(plot: Plot) -> str:
    """Return the legend: a measured point and its curve share an entry, lines that have a note have none."""
    styles: set[tuple[str, int]] = set()
    hidden = []
    for at, curve in enumerate(plot.curves):
        key = (curve.label, curve.group)
        if not curve.label or key in styles:
            hidden.append(f'<c:legendEntry><c:idx val="{at}"/><c:delete val="1"/></c:legendEntry>')
        styles.add(key)
    return f'<c:legend><c:legendPos val="r"/>{"".join(hidden)}<c:overlay val="0"/></c:legend>'


_END = '<a:endParaRPr lang="en-US"/>'


def _title(text: str, points: float, *, colour: str, bold: bool = False, upright: bool = False) -> str:
    body = '<a:bodyPr rot="-5400000" vert="horz"/>' if upright else "<a:bodyPr/>"
    look = f'{_size(points)} b="{int(bold)}"'
    fill = f'<a:solidFill><a:srgbClr val="{colour}"/></a:solidFill>'
    return (
        f"<c:title><c:tx><c:rich>{body}<a:lstStyle/><a:p><a:pPr><a:defRPr {look}>{fill}</a:defRPr></a:pPr>"
        f"<a:r><a:rPr {look}>{fill}</a:rPr><a:t>{_text(text)}</a:t></a:r></a:p></c:rich></c:tx>"
        '<c:overlay val="0"/></c:title>'
    )


def _stroke(colour: str, points: float, *, dashed: bool = False) -> str:
    dash = '<a:prstDash val="dash"/>' if dashed else ""
    fill = f'<a:solidFill><a:srgbClr val="{colour}"/></a:solidFill>'
    return f'<a:ln w="{round(points * _POINT)}">{fill}{dash}</a:ln>'


def _size(points: float) -> str:
    return f'sz="{max(_SMALLEST, round(100 * points))}"'


def _sheet(plot: Plot) -> str:
    # A name of the toolkit's: letters, digits and underscores.
    return plot.name[:_SHEET_NAME]


def _cells(plot: Plot, column: int, first: int, last: int) -> str:
    from openpyxl.utils import get_column_letter

    letter = get_column_letter(column)
    ends = f"${letter}${first}" + (f":${letter}${last}" if last > first else "")
    return f"'{_sheet(plot)}'!{ends}"


def _text(text: str) -> str:
    return escape(clean(text).replace("\n", " "))


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
