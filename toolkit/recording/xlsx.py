"""Workbooks: python-calamine reads the members that passed the gate, but for a plain grid of numbers."""

from __future__ import annotations

import io
import posixpath
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from typing import Any, NoReturn
from xml.etree import ElementTree as ET

from toolkit.errors import CellError, RecordingError, ToolkitError, UnreadableError
from toolkit.recording.archive import stored_archive
from toolkit.recording.cells import error_cells
from toolkit.recording.hidden import hidden_rows
from toolkit.recording.safe_open import Gated
from toolkit.recording.table import Table, header_row

_MAIN = "{http://schemas.openxmlformats.org/spreadsheetml/2006/main}"
_ID = "{http://schemas.openxmlformats.org/officeDocument/2006/relationships}id"
_STRICT_MAIN = "{http://purl.oclc.org/ooxml/spreadsheetml/main}"
_CELL = re.compile(rb"<(?:[\w.-]+:)?c[\s/>]")
_Errors = Mapping[str, tuple[tuple[str, str], ...]]  # sheet -> (reference, text) of each error value
_STRICT_ID = "{http://purl.oclc.org/ooxml/officeDocument/relationships}id"


def read_sheet(gated: Gated, is_header: Callable[[str], bool], *, grids: bool = True) -> tuple[str, Table]:
    """Return the name and the cells of the one visible worksheet that holds the data.

    Hidden worksheets are never read. With several visible ones, it is the one whose header row has a header
    that is ``known``, and numbers below it.
    ``grids=False`` has python-calamine read every cell, with the same result.

    Raises
    ------
    UnreadableError
        rule ``no-data unreadable``: nothing visible, or the reader fails
    CellError
        rule ``error-cell``: an error value that the reader cannot represent
    RecordingError
        rule ``several-sheets``: more than one worksheet looks like a recording
    """
    errors = _errors_by_sheet(gated.members)
    sheets = (grids and _around_grid(gated, errors)) or _visible_sheets(gated, gated.members, errors)
    filled = [
        (name, sheet)
        for name, sheet in sheets
        if any(any(c not in ("", None) for c in r) for r in sheet.rows)
    ]
    if not filled:
        raise UnreadableError(
            "the workbook has no data",
            where=gated.path,
            got=f"{len(sheets)} visible worksheets, all of them empty",
            expected="a worksheet with a header row and rows of numbers",
            next_step="repeat the recording; hidden worksheets are not read",
            rule="no-data",
        )
    with_header = [sheet for sheet in filled if any(map(is_header, _headers(sheet[1].rows)))]
    # A sheet of titles and remarks may have what reads as a header; a recording has numbers below it.
    fitting = [sheet for sheet in with_header if _has_numbers(sheet[1])] or with_header[:1] or filled[:1]
    if len(fitting) > 1:
        raise RecordingError(
            "more than one worksheet looks like a recording",
            where=gated.path,
            got=", ".join(repr(name) for name, _ in fitting),
            expected="one",
            next_step="save each worksheet as a file of its own",
            rule="several-sheets",
        )
    name, table = fitting[0]
    return name, replace(table, hidden=_hidden(gated.members, name))


def _hidden(members: Mapping[str, bytes], sheet: str) -> tuple[int, ...]:
    parts = {name: hidden_rows(xml) for name, xml in members.items() if b"sheetData" in xml}
    if not any(parts.values()):
        return ()
    part = _sheet_parts(members).get(sheet)
    # Where the package does not say which part the sheet is, every one may be.
    return parts.get(part, ()) if part else tuple(sorted(set(chain.from_iterable(parts.values()))))


def _around_grid(gated: Gated, errors: _Errors) -> list[tuple[str, Table]]:
    """Return the visible sheets where one part alone has cells, and these are one row above a grid.

    The parser is given the workbook without the grid's rows, and names the sheets. Empty where anything is
    not as plain as that: the workbook is then read whole, and what is wrong with it is told from there.
    """
    cells = [name for name, xml in gated.members.items() if b"sheetData" in xml and _CELL.search(xml)]
    if len(cells) != 1 or cells[0] not in gated.grids:
        return []
    grid, xml = gated.grids[cells[0]], gated.members[cells[0]]
    numbers = grid.numbers(xml)
    if numbers is None:
        return []
    try:
        sheets = _visible_sheets(gated, {**gated.members, cells[0]: grid.without_rows(xml)}, errors)
    except ToolkitError:
        return []
    tables: list[tuple[str, Table]] = []
    for name, table in sheets:
        if table.rows:  # of the part with the cells: there is no other
            if len(table.rows) != grid.first_row - 1 or len(table.rows[-1]) != numbers.shape[1]:
                return []
            table = Table(where=table.where, rows=table.rows, errors=table.errors, numbers=numbers)
        tables.append((name, table))
    return tables if any(sheet.rows for _, sheet in tables) else []


def _visible_sheets(gated: Gated, members: Mapping[str, bytes], errors: _Errors) -> list[tuple[str, Table]]:
    from python_calamine import CalamineWorkbook, SheetTypeEnum, SheetVisibleEnum

    sheets: list[tuple[str, Table]] = []
    name = "?"
    try:
        with CalamineWorkbook.from_filelike(io.BytesIO(stored_archive(members))) as workbook:
            for meta in workbook.sheets_metadata:
                if meta.typ == SheetTypeEnum.WorkSheet and meta.visible == SheetVisibleEnum.Visible:
                    name = meta.name
                    rows = workbook.get_sheet_by_name(name).to_python(skip_empty_area=False)
                    where = f"{gated.path}, sheet {name!r}"
                    sheets.append((name, Table(where=where, rows=rows, errors=errors.get(name, ()))))
    except BaseException as error:
        # A panic of the reader's Rust code derives from BaseException; whatever fails, the file is at fault.
        if not isinstance(error, Exception) and type(error).__name__ != "PanicException":
            raise
        _refuse(gated, name, errors.get(name, ()), error)
    return sheets


def _refuse(gated: Gated, name: str, errors: tuple[tuple[str, str], ...], error: BaseException) -> NoReturn:
    if errors:
        place, text = errors[0]
        raise CellError(
            f"cell {place}: an error value",
            where=f"{gated.path}, sheet {name!r}, cell {place}",
            got=text,
            expected="a finite number",
            next_step="look at that cell in the file; repeat the recording or mend a copy of the file",
            rule="error-cell",
        ) from error
    raise UnreadableError(
        "the workbook cannot be read",
        where=f"{gated.path}, sheet {name!r}" if name != "?" else gated.path,
        got=f"{type(error).__name__}: {error}"[:300],
        expected="a workbook as the acquisition program or Excel writes it",
        next_step="open it in Excel and save it again, or copy it again from the machine",
        rule="unreadable",
    ) from (error if isinstance(error, Exception) else None)


def _headers(rows: Sequence[Sequence[Any]]) -> list[str]:
    at = header_row(rows)
    return [] if at is None else [cell for cell in rows[at] if isinstance(cell, str) and cell.strip()]


def _has_numbers(table: Table) -> bool:
    at = header_row(table.rows)
    below = [] if at is None else table.rows[at + 1 :]
    return table.numbers is not None or any(type(cell) in (int, float) for row in below for cell in row)


def _errors_by_sheet(members: Mapping[str, bytes]) -> dict[str, tuple[tuple[str, str], ...]]:
    parts = {name: error_cells(xml) for name, xml in members.items() if b"#" in xml and b"sheetData" in xml}
    if not any(parts.values()):
        return {}
    by_sheet: dict[str, tuple[tuple[str, str], ...]] = {}
    for name, part in _sheet_parts(members).items():
        if parts.get(part):
            by_sheet[name] = parts[part]
    return by_sheet


def _sheet_parts(members: Mapping[str, bytes]) -> dict[str, str]:
    # The package says which part is which sheet; only needed when there are error values to place.
    try:
        links = ET.fromstring(members["xl/_rels/workbook.xml.rels"])  # noqa: S314  gated: no DTD
        workbook = ET.fromstring(members["xl/workbook.xml"])  # noqa: S314
    except (KeyError, ET.ParseError, ValueError, LookupError):
        return {}
    targets = {link.get("Id"): link.get("Target", "") for link in links}
    sheets = [*workbook.iter(f"{_MAIN}sheet"), *workbook.iter(f"{_STRICT_MAIN}sheet")]
    return {
        sheet.get("name", ""): posixpath.normpath(
            posixpath.join("xl", targets.get(sheet.get(_ID) or sheet.get(_STRICT_ID), ""))
        ).lstrip("/")
        for sheet in sheets
    }
