"""A session's data file -> its header and its columns of cells, from whatever program saved it.

The readers are those of recordings, and so is the gate before them: a workbook (one visible worksheet with
the session's headers), text with commas, semicolons or tabs, in UTF-8, UTF-16 or Windows-1252. A plain CSV
file, as nearly all that lie beside records are, is split here without any of that.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from toolkit.errors import RecordingError, SessionError
from toolkit.recording.table import header_row

FILES = "an .xlsx workbook, or a CSV file with commas, semicolons or tabs between the cells"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cells:
    """The rows of a file that are not blank.

    ``columns`` (one a header, rows): texts, or what a worksheet's cells hold; ``lines`` (rows,) are the
    numbers of the rows in the file. ``separator`` of a text; "" of a worksheet, whose cells are ``merged``
    in places where it says so, and which hides some of the ``lines`` (``hidden``).
    """

    where: str
    header: tuple[str, ...]
    columns: tuple[Sequence[Any], ...]
    lines: Sequence[int]
    separator: str
    merged: bool = False
    hidden: tuple[int, ...] = ()

    def name(self, column: int) -> str:
        """Return a column's header without its unit."""
        return re.split(r"\s*[\[(]", self.header[column])[0]

    def place(self, row: int, column: int | None = None) -> str:
        """Return where a cell stands; ``row`` from 1 at the first row of data, ``column`` from 0."""
        line = self.lines[row - 1]
        if column is None:
            return f"{self.where}, row {row} (line {line})"
        if self.separator:
            return f"{self.where}, row {row} (line {line}), column {self.name(column)}"
        from toolkit.recording.cells import reference

        return f"{self.where}, row {row} (cell {reference(line, column + 1)}), column {self.name(column)}"


def read_cells(data: bytes, known: Callable[[str], bool], *, where: object, grouped: bool = False) -> Cells:
    """Read the cells of a data file; ``known`` tells whether a text is a header of the session.

    ``grouped``: a workbook may have a row of groups or a title above its header, as a recording may.

    Raises
    ------
    SessionError
        no table, hostile, empty, an error value in a cell, or rows of different length
    """
    plain = _plain(data, where)
    if plain is not None:
        return plain
    from toolkit.recording.safe_open import gate

    try:
        gated = gate(Path(str(where)), data)
        if gated.kind not in ("xlsx", "text"):
            raise _foreign(where, f"a file of the kind {gated.kind}", "not-a-workbook")
        return (
            _sheet(gated, known, grouped=grouped) if gated.kind == "xlsx" else _text(gated.data, known, where)
        )
    except RecordingError as error:
        if error.rule == "not-a-workbook":
            raise _foreign(where, error.got, error.rule) from error
        rule = "no-data" if error.rule == "empty-file" else error.rule or "unreadable"
        raise _error(error.what, error.where, error.got, error.expected, rule, error.next_step) from error


def _plain(data: bytes, where: object) -> Cells | None:
    """Return the columns without `csv`; None for quotes, blank rows, unequal rows and what is no text."""
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return None
    if '"' in text or "\r" in text or "\0" in text:
        return None
    lines = text.removesuffix("\n").split("\n")
    commas = lines[0].count(",")
    if not commas or ";" in lines[0] or {line.count(",") for line in lines} != {commas}:
        return None
    cells = ",".join(lines).split(",")
    width = commas + 1
    # A row of empty cells is no row, and begins with one.
    if len(lines) < 2 or not all(map(str.strip, cells[::width])):
        return None
    return Cells(
        where=str(where),
        header=tuple(cells[:width]),
        columns=tuple(cells[width + at :: width] for at in range(width)),
        lines=range(2, len(lines) + 1),
        separator=",",
    )


def _text(data: bytes, known: Callable[[str], bool], where: object) -> Cells:
    from toolkit.recording.csvfile import decode, first_line, separator_of, split_rows

    path = Path(str(where))
    text = decode(data, where=path)
    head = first_line(text)
    # Where no separator parts any header, the one that parts the most cells says best what is wrong.
    separator = separator_of(head, known, where=path) or max(",;\t", key=head.count)
    return _cells(split_rows(text, separator, where=path), where=str(where), separator=separator)


def _sheet(gated: Any, known: Callable[[str], bool], *, grouped: bool) -> Cells:
    from toolkit.recording.xlsx import read_sheet

    _, table = read_sheet(gated, known)
    if table.errors:
        place, text = table.errors[0]
        raise _error(
            f"cell {place} holds an error value", f"{table.where}, cell {place}", text, "a finite number",
            "cell", "correct the cell, or remove the whole row with a reason in the laboratory's notes",
        )  # fmt: skip
    merged = any(b"<mergeCell " in xml for xml in gated.members.values())
    cells = _cells(table.in_rows().rows, where=table.where, separator="", merged=merged, grouped=grouped)
    return replace(cells, hidden=table.hidden_data)


def _cells(
    rows: Sequence[Sequence[Any]], *, where: str, separator: str, merged: bool = False, grouped: bool = False
) -> Cells:
    filled = [(line, row) for line, row in enumerate(rows, start=1) if not all(map(is_empty, row))]
    if not filled:
        raise _error("the file is empty", where, "no header", "a header with units, then rows", "no-data")
    place = (header_row([row for _, row in filled]) or 0) if grouped else 0
    head, body = filled[place][1], filled[place + 1 :]
    header = [" ".join(str("" if cell is None else cell).split()) for cell in head]
    for number, (line, row) in enumerate(body, start=1):
        if len(row) != len(header):
            split = len(row) > len(header) > 1 and separator == ","
            raise _error(
                "a row has another number of cells than the header",
                f"{where}, row {number} (line {line})",
                f"{len(row)} cells: {', '.join(map(str, row))}", f"{len(header)} cells", "columns",
                "correct the file (a number with a decimal comma makes two cells where commas stand between "
                "the cells: save it with semicolons or tabs between them, or with a decimal point)"
                if split else "take comments and titles out: the first line is the header"
                if len(header) == 1 else None,
            )  # fmt: skip
    return Cells(
        where=where,
        header=tuple(header),
        columns=tuple([row[at] for _, row in body] for at in range(len(header))),
        lines=[line for line, _ in body],
        separator=separator,
        merged=merged,
    )


def is_empty(cell: object) -> bool:
    """Tell whether a cell holds nothing but blanks."""
    return cell is None or (isinstance(cell, str) and not cell.strip())


def _foreign(where: object, actual: object, rule: str) -> SessionError:
    return _error(
        "the file is no table", where, actual, FILES, rule,
        "save it as .xlsx or as CSV, and name that file; nothing was written",
    )  # fmt: skip


def _error(
    problem: str, where: object, actual: object, expected: object, rule: str, next_step: str | None = None
) -> SessionError:
    step = next_step or "correct the file"
    if "nothing was written" not in step:
        step += "; nothing was written"
    return SessionError(problem, where=where, got=actual, expected=expected, next_step=step, rule=rule)
