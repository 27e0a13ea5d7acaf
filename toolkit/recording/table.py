"""A table of cells, as any reader returns it, to checked columns of numbers."""

from __future__ import annotations

import datetime as dt
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any, NoReturn

import numpy as np

from toolkit.arrays import Array
from toolkit.errors import CellError, ColumnError, UnreadableError
from toolkit.machine import Machine
from toolkit.recording.cells import reference
from toolkit.recording.columns import Assigned, assign_columns
from toolkit.recording.model import Series

_NUMBERS = frozenset((float, int))
_WITH_COMMA = re.compile(r"[+-]?[0-9]*,[0-9]+(?:[eE][+-]?[0-9]+)?")
_EMPTY = ("", None)
_HEADER_ROWS = 50  # rows at the top in which a header is looked for


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Cells of one sheet, row by row from the first row of the sheet; ``""`` is an empty cell.

    ``errors``: (reference, text) of cells with an error value, which readers return as empty. ``numbers``
    (rows, columns): what stands below ``rows``, where that is nothing but finite numbers; as wide as the last
    of ``rows``. ``hidden`` are the numbers of rows that the workbook hides. ``cut`` is the number within
    which a text file ends.
    """

    where: str
    rows: Sequence[Sequence[Any]]
    errors: tuple[tuple[str, str], ...] = ()
    numbers: Array | None = None
    hidden: tuple[int, ...] = ()
    cut: str | None = None

    def in_rows(self) -> Table:
        """Return the same table with all of its cells in ``rows``."""
        if self.numbers is None:
            return self
        return replace(self, rows=[*self.rows, *self.numbers.tolist()], numbers=None)

    @property
    def hidden_data(self) -> tuple[int, ...]:
        """The hidden rows below the header that hold anything."""
        above = len(self.rows)
        at = header_row(self.rows)
        first = above if at is None else at
        below = above + (0 if self.numbers is None else len(self.numbers))
        return tuple(
            row
            for row in self.hidden
            if first + 1 < row <= below and (row > above or not _blank(self.rows[row - 1]))
        )


def header_row(rows: Sequence[Sequence[Any]]) -> int | None:
    """Return the index of the header row of a sheet; None where nothing is filled.

    It is the first row that is not empty. A row of groups or a title above it, as LabVIEW and people write
    them, fills fewer cells: of the rows of text that stand at the top, the first with the most texts counts.

    >>> header_row([["", ""], ["Cells", ""], ["D51 [lbf]", "FZ [N]"], [1.0, 2.0]])
    2
    >>> header_row([["D51", "FZ"], ["lbf", "N"], [1.0, 2.0]]), header_row([["", None]])
    (0, None)
    """
    best: int | None = None
    most = 0
    for index, row in enumerate(rows[:_HEADER_ROWS]):
        if _blank(row):
            continue
        texts = sum(isinstance(cell, str) and bool(cell.strip()) for cell in row)
        if best is not None and texts < sum(cell not in _EMPTY for cell in row):
            break  # the first number: the header is above it
        if best is None or texts > most:
            best, most = index, texts
    if best is None:
        return next((index for index, row in enumerate(rows) if not _blank(row)), None)
    return best


def read_table(table: Table, machine: Machine) -> tuple[Series, ...]:
    """Return the table's columns: its header row (`header_row`), and numbers below it.

    Raises
    ------
    ColumnError
        see `toolkit.recording.columns.assign_columns`
    CellError
        rule ``text-cell error-cell empty-cell nan-cell boolean-cell date-cell``: the first bad cell, with
        sheet, spreadsheet row, column header, what stands there and what should
    UnreadableError
        rule ``no-data``: there is no header or no row of data
    """
    first = header_row(table.rows)
    if table.numbers is not None and (first != len(table.rows) - 1 or _nameless(table.rows[-1])):
        table = table.in_rows()  # a row of numbers above them, or a column to be told with its first cell
    if first is None:
        _no_data(table, "an empty sheet")
    head = table.rows[first]
    if all(not isinstance(cell, str) for cell in head if cell not in _EMPTY):
        raise ColumnError(
            "the recording has no header row",
            where=f"{table.where}, row {first + 1}",
            got=", ".join(str(cell) for cell in head)[:200],
            expected=", ".join(repr(column.header) for column in machine.columns),
            next_step="add the header row",
            rule="missing-column",
        )
    headers = [cell if isinstance(cell, str) else "" if cell is None else str(cell) for cell in head]
    assigned = assign_columns(headers, machine, where=f"{table.where}, row {first + 1}")
    last = len(table.rows)
    while last > first + 1 and _blank(table.rows[last - 1]):
        last -= 1
    _check_errors(table, first, headers)
    if table.numbers is not None:
        columns = np.ascontiguousarray(table.numbers.T)
        columns.setflags(write=False)
        return tuple(_as_series(column, columns[column.index]) for column in assigned)
    if last == first + 1:
        _no_data(table, "a header row and nothing below it")
    body = table.rows[first + 1 : last]
    _check_nameless(table, body, headers, first + 2)
    matrix = _numbers(body)
    if matrix is None:  # one by one, for the first cell that is to blame
        return tuple(
            _series(column, [row[column.index] for row in body], table.where, first + 2)
            for column in assigned
        )
    return tuple(_as_series(column, matrix[column.index]) for column in assigned)


def _numbers(body: Sequence[Sequence[Any]]) -> Array | None:
    # Every column (columns, rows) where each cell is a finite number, as of most files; else None.
    width = len(body[0])
    if set(map(len, body)) != {width}:
        return None
    cells = list(chain.from_iterable(body))
    values = _array(cells)
    if values is None:
        return None
    columns = np.ascontiguousarray(values.reshape(len(body), width).T)
    columns.setflags(write=False)
    return columns


def _array(cells: list[Any]) -> Array | None:
    # The types are looked at before numpy sees them: it would take True for 1 and "12.3" for text.
    if not _NUMBERS.issuperset(map(type, cells)):
        return None
    try:
        values = np.array(cells, dtype=np.float64)
    except OverflowError:  # a whole number of more than 308 digits
        return None
    return values if np.isfinite(values).all() else None


def _series(assigned: Assigned, cells: list[Any], where: str, first_row: int) -> Series:
    values = _array(cells)
    if values is None:
        _refuse_first(assigned, cells, where, first_row)
    values.setflags(write=False)
    return _as_series(assigned, values)


def _as_series(assigned: Assigned, values: Array) -> Series:
    return Series(
        symbol=assigned.symbol, header=assigned.header, unit=assigned.unit, role=assigned.role, values=values
    )


def _refuse_first(assigned: Assigned, cells: list[Any], where: str, first_row: int) -> NoReturn:
    for offset, cell in enumerate(cells):
        rule, content = judge(cell)
        if rule:
            refuse_cell(rule, content, where, first_row + offset, assigned.index + 1, assigned.header)
    raise AssertionError("a column was refused although all its cells are numbers")


def judge(cell: object) -> tuple[str | None, str]:
    """Return why a cell is no number (a rule id, None where it is one) and what stands there."""
    if cell in _EMPTY:
        return "empty-cell", "an empty cell"
    if isinstance(cell, bool):
        return "boolean-cell", str(cell).upper()
    if isinstance(cell, int | float):
        try:
            return (None, "") if math.isfinite(cell) else ("nan-cell", str(cell))
        except OverflowError:
            return "nan-cell", "a number beyond double precision"
    if isinstance(cell, str):
        kind = "error-cell" if cell.startswith("#") else "text-cell"
        return kind, f"{'the text ' if kind == 'text-cell' else ''}{shown(cell)}"
    if isinstance(cell, dt.date | dt.time | dt.timedelta):
        return "date-cell", f"a date or time, {cell}"
    return "text-cell", repr(cell)[:80]


def shown(text: str) -> str:
    """Return a text that is no number as it stands; of a number with a comma the sign is told.

    >>> shown("0,375"), shown("n/a")
    ("'0,375', with a comma where numbers are read with points", "'n/a'")
    """
    sign = ", with a comma where numbers are read with points" if _WITH_COMMA.fullmatch(text.strip()) else ""
    return f"{text[:80]!r}{sign}"


def refuse_cell(rule: str, actual: str, where: str, row: int, column: int, header: str) -> NoReturn:
    """Raise the `CellError` of one cell; ``row`` and ``column`` count from 1 in the spreadsheet."""
    raise CellError(
        f"row {row}, column {header!r}: no number",
        where=f"{where}, row {row}, column {header!r} (cell {reference(row, column)})",
        got=actual,
        expected="a finite number",
        next_step="look at that cell in the file; repeat the recording or mend a copy of the file",
        rule=rule,
    )


def _check_errors(table: Table, first: int, headers: list[str]) -> None:
    for place, text in table.errors:
        letters = place.rstrip("0123456789")
        row = int(place[len(letters) :] or 0)
        column = 0
        for letter in letters.upper():
            column = column * 26 + ord(letter) - ord("A") + 1
        header = headers[column - 1] if 0 < column <= len(headers) else "?"
        if row != first + 1 or not header:
            refuse_cell("error-cell", f"the error value {text}", table.where, row, column, header or "?")


def _check_nameless(table: Table, body: Sequence[Sequence[Any]], headers: list[str], first_row: int) -> None:
    for index in range(max(map(len, body))):
        if index < len(headers) and headers[index].strip():
            continue
        for offset, row in enumerate(body):
            if index < len(row) and row[index] not in _EMPTY:
                place = reference(first_row + offset, index + 1)
                raise ColumnError(
                    "a column has values and no header",
                    where=f"{table.where}, cell {place}",
                    got=repr(row[index])[:80],
                    expected="a header in the first row, or an empty column",
                    next_step="name the column as 'NAME [unit]' or clear it in a copy of the file",
                    rule="unknown-column",
                )


def _nameless(row: Sequence[Any]) -> bool:
    return any(cell in _EMPTY or (isinstance(cell, str) and not cell.strip()) for cell in row)


def _blank(row: Sequence[Any]) -> bool:
    return all(cell in _EMPTY or (isinstance(cell, str) and not cell.strip()) for cell in row)


def _no_data(table: Table, actual: str) -> NoReturn:
    raise UnreadableError(
        "the recording has no data",
        where=table.where,
        got=actual,
        expected="a header row and at least one row of numbers",
        next_step="repeat the recording, or leave the file out of the test",
        rule="no-data",
    )
