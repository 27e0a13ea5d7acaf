"""Workbooks for the tests of recording/, made by hand: the XML is the subject, not a library's habit."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping, Sequence

HEADERS = ("FZ load", "D52 (Filtered)", "D51 (Filtered)", "E5 (Filtered)", "SA (Filtered)", "Fy", "Mz")
DATA = (
    (248.8146, 86.06072, 98.59261, -182.415, -0.30197, 371.3554, -0.35393),
    (250.0319, 86.05929, 98.59098, -182.414, -0.30197, 371.3506, -0.35392),
    (587.4521, 178.8015, 211.9537, -289.719, -0.3018, 686.6269, -2.83066),
)
MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
LINKS = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
PACKAGE = "http://schemas.openxmlformats.org/package/2006"
PROLOG = '<?xml version="1.0" encoding="UTF-8" standalone="yes"?>\n'
CONTENT_MAIN = "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet.main+xml"
SHEET = "xl/worksheets/sheet1.xml"


def text_cell(reference: str, text: str) -> str:
    text = text.replace("&", "&amp;").replace("<", "&lt;")
    return f'<c r="{reference}" t="inlineStr"><is><t>{text}</t></is></c>'


def row_xml(number: int, values: Sequence[object]) -> str:
    """A number is a number cell, a text that begins with ``<`` is XML as it stands, None is no cell."""
    cells = []
    for column, value in enumerate(values):
        place = f"{chr(ord('A') + column)}{number}"
        if value is None:
            continue
        if isinstance(value, str):
            cells.append(value.replace("@", place) if value.startswith("<") else text_cell(place, value))
        else:
            cells.append(f'<c r="{place}"><v>{value!r}</v></c>')
    return f'<row r="{number}">{"".join(cells)}</row>'


def sheet_xml(rows: Sequence[str], *, dimension: str = "") -> str:
    where = f'<dimension ref="{dimension}"/>' if dimension else ""
    return f'{PROLOG}<worksheet xmlns="{MAIN}">{where}<sheetData>{"".join(rows)}</sheetData></worksheet>'


def table_xml(rows: Sequence[Sequence[object]], *, first: int = 1, dimension: str = "") -> str:
    return sheet_xml([row_xml(first + i, row) for i, row in enumerate(rows)], dimension=dimension)


def members(
    sheets: Mapping[str, str] | None = None, *, hidden: Sequence[str] = (), keywords: str | None = None
) -> dict[str, bytes]:
    """The parts of a workbook with the sheets that are given, name -> XML."""
    sheets = {"Sheet1": table_xml([HEADERS, *DATA])} if sheets is None else sheets
    overrides = "".join(
        f'<Override PartName="/xl/worksheets/sheet{i}.xml" ContentType="application/vnd.openxmlformats-'
        f'officedocument.spreadsheetml.worksheet+xml"/>'
        for i in range(1, len(sheets) + 1)
    )
    entries = "".join(
        f'<sheet name="{name}" sheetId="{i}"{_state(name in hidden)} r:id="rId{i}"/>'
        for i, name in enumerate(sheets, start=1)
    )
    links = "".join(
        f'<Relationship Id="rId{i}" Type="{LINKS}/worksheet" Target="worksheets/sheet{i}.xml"/>'
        for i in range(1, len(sheets) + 1)
    )
    parts = {
        "[Content_Types].xml": f'{PROLOG}<Types xmlns="{PACKAGE}/content-types"><Default Extension="rels" '
        f'ContentType="application/vnd.openxmlformats-package.relationships+xml"/><Default Extension="xml" '
        f'ContentType="application/xml"/><Override PartName="/xl/workbook.xml" '
        f'ContentType="{CONTENT_MAIN}"/>{overrides}</Types>',
        "_rels/.rels": f'{PROLOG}<Relationships xmlns="{PACKAGE}/relationships"><Relationship Id="rId1" '
        f'Type="{LINKS}/officeDocument" Target="xl/workbook.xml"/></Relationships>',
        "xl/workbook.xml": f'{PROLOG}<workbook xmlns="{MAIN}" xmlns:r="{LINKS}"><sheets>{entries}</sheets>'
        f"</workbook>",
        "xl/_rels/workbook.xml.rels": f'{PROLOG}<Relationships xmlns="{PACKAGE}/relationships">{links}'
        f"</Relationships>",
    }
    for i, xml in enumerate(sheets.values(), start=1):
        parts[f"xl/worksheets/sheet{i}.xml"] = xml
    if keywords is not None:
        parts["docProps/core.xml"] = (
            f'{PROLOG}<cp:coreProperties xmlns:cp="{PACKAGE}/metadata/core-properties">'
            f"<cp:keywords>{keywords}</cp:keywords></cp:coreProperties>"
        )
    return {name: text.encode() for name, text in parts.items()}


def _state(hidden: bool) -> str:
    return ' state="hidden"' if hidden else ""


def packed(parts: Mapping[str, bytes], *, method: int = zipfile.ZIP_DEFLATED) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", method) as archive:
        for name, content in parts.items():
            archive.writestr(name, content)
    return stream.getvalue()


def workbook(rows: Sequence[Sequence[object]] | None = None, *, dimension: str = "", first: int = 1) -> bytes:
    """A whole workbook with one sheet; default: headers and three rows of Figure 4.4."""
    table = [HEADERS, *DATA] if rows is None else rows
    return packed(members({"Sheet1": table_xml(table, dimension=dimension, first=first)}))


def with_cell(row: int, column: int, value: object) -> bytes:
    """The default workbook with one cell replaced; ``row`` and ``column`` from 0 at the header row."""
    table: list[list[object]] = [list(one) for one in [HEADERS, *DATA]]
    table[row][column] = value
    return workbook(table)
