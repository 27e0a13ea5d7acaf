"""Where the cells of a worksheet stand, read from its XML without believing its ``<dimension>``.

A reader allocates the rectangle that spans all cells: one legal cell in the far corner is enough to abort
a process. So the references are looked at before. Worksheets as Excel, LabVIEW and openpyxl write them
(every cell ``<c r="B7"``) are scanned with numpy; anything else is parsed in full.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any
from xml.parsers import expat

import numpy as np
from numpy.typing import NDArray

from toolkit.recording.grid import Grid

MAX_ROW, MAX_COLUMN = 1_048_576, 16_384

_SPARE_CELLS = 200_000
_SPREAD = 16
_REFERENCE = re.compile(r"([A-Za-z]{1,3})([0-9]{1,7})")
_PREFIXED_CELL = re.compile(rb"<[\w.-]+:c[\s/>]")
_ANY_CELL = re.compile(rb"<(?:[\w.-]+:)?c(?![A-Za-z])")
_PLAIN_CELL = re.compile(rb'<c r="([A-Z]{1,3})([0-9]{1,7})"')
# Every repetition stops at the next tag or cell, so that no text makes the search quadratic.
_ERROR_CELL = re.compile(
    rb"""<(?:\w+:)?c\s[^<>]*?\bt\s*=\s*["']e["'][^<>]*(?<!/)>"""
    rb"""(?:(?!</?(?:\w+:)?c[\s>/]).)*?<(?:\w+:)?v>([^<]*)<""",
    re.DOTALL,
)
_OWN_REFERENCE = re.compile(rb"""\sr\s*=\s*["']([A-Za-z]+[0-9]+)["']""")


class MalformedSheetError(Exception):
    """The worksheet's XML cannot be parsed, or a reference in it is none; never leaves the gate."""


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """Positions of all cells of a worksheet, 1-based, in the order of the file."""

    rows: NDArray[np.int64]
    columns: NDArray[np.int64]

    @property
    def far(self) -> str | None:
        """The reference of a cell far beyond the data, None where there is none.

        Far means that the rectangle from A1 to the last row and column is out of proportion to the number
        of cells that the worksheet really has.
        """
        if not len(self.rows):
            return None
        last_row, last_column = int(self.rows.max()), int(self.columns.max())
        beyond = last_row > MAX_ROW or last_column > MAX_COLUMN
        if not beyond and last_row * last_column <= _SPARE_CELLS + _SPREAD * len(self.rows):
            return None
        # Name the cell that stretches the rectangle most, relative to where the bulk of the data lies.
        reach = self.rows / max(np.median(self.rows), 1) + self.columns / max(np.median(self.columns), 1)
        worst = int(np.argmax(reach))
        return reference(int(self.rows[worst]), int(self.columns[worst]))

    @property
    def doubled(self) -> str | None:
        """The reference of a cell that occurs twice (readers would silently keep one), else None."""
        keys = self.rows * (MAX_COLUMN + 1) + self.columns
        if len(keys) < 2 or bool(np.all(keys[1:] > keys[:-1])):
            return None
        unique, counts = np.unique(keys, return_counts=True)
        if len(unique) == len(keys):
            return None
        key = int(unique[int(np.argmax(counts > 1))])
        return reference(key // (MAX_COLUMN + 1), key % (MAX_COLUMN + 1))


def reference(row: int, column: int) -> str:
    """Return a cell's reference from its 1-based row and column.

    >>> reference(7, 28)
    'AB7'
    """
    letters = ""
    while column:
        column, digit = divmod(column - 1, 26)
        letters = chr(ord("A") + digit) + letters
    return f"{letters}{row}"


def find_cells(xml: bytes, grid: Grid | None = None) -> Cells:
    """Return the positions of all cells of a worksheet's XML.

    ``grid`` is the sheet's rectangle of numbers where `toolkit.recording.grid` found one.

    Raises
    ------
    MalformedSheetError
        the XML is not well-formed, or a reference is none
    """
    if grid is None:
        return _scan(xml) or _parse(xml)
    remainder = grid.without_rows(xml)
    first = _few(remainder) or find_cells(remainder)
    rows, columns = np.indices(grid.starts.shape)
    return Cells(
        np.concatenate([first.rows, rows.ravel() + grid.first_row]),
        np.concatenate([first.columns, columns.ravel() + 1]),
    )


def error_cells(xml: bytes) -> tuple[tuple[str, str], ...]:
    """Return (reference, text) of every cell that holds an error value such as ``#DIV/0!``.

    python-calamine returns the empty text for them, as for an empty cell.
    """
    if b"#" not in xml:
        return ()
    errors = []
    for cell in _ERROR_CELL.finditer(xml):
        place = _OWN_REFERENCE.search(cell.group(0).partition(b">")[0])
        errors.append((place.group(1).decode() if place else "?", cell.group(1).decode("utf-8", "replace")))
    return tuple(errors)


def _few(xml: bytes) -> Cells | None:
    # The same answer as `_scan`, in less time where there are few cells.
    plain = _PLAIN_CELL.findall(xml)
    if not plain or len(plain) != len(_ANY_CELL.findall(xml)) or any(int(row) == 0 for _, row in plain):
        return None
    rows = np.array([int(row) for _, row in plain])
    return Cells(rows, np.array([_column(letters.decode()) for letters, _ in plain]))


def _scan(xml: bytes) -> Cells | None:
    # Returns None for any layout that is not the plain one; the parser then decides.
    begin = xml.find(b"sheetData") - 1
    if begin < 0 or xml[begin] != ord("<") or b"'" in xml or b"!" in xml:
        return None
    body = xml[begin:]
    if b":" in body and _PREFIXED_CELL.search(body):
        return None
    octets = np.frombuffer(body + b" " * 24, dtype=np.uint8)
    at = np.flatnonzero(octets[:-24] == ord("<"))
    at = at[octets[at + 1] == ord("c")]
    after = octets[at + 2]
    at = at[((after | 0x20) < ord("a")) | ((after | 0x20) > ord("z"))]  # <c, not <col or <cellWatch
    for step, byte in enumerate(b' r="', start=2):
        if not np.all(octets[at + step] == byte):
            return None
    rows, columns = np.zeros(len(at), np.int64), np.zeros(len(at), np.int64)
    state = np.zeros(len(at), np.int8)  # 0 in letters, 1 in digits, 2 past the closing quote
    for step in range(6, 18):
        octet = octets[at + step].astype(np.int64)
        letter = (octet >= ord("A")) & (octet <= ord("Z")) & (state == 0)
        digit = (octet >= ord("0")) & (octet <= ord("9")) & (state < 2) & (columns > 0)
        quote = (octet == ord('"')) & (state == 1)
        if not np.all(letter | digit | quote | (state == 2)):
            return None
        columns = np.where(letter, columns * 26 + octet - (ord("A") - 1), columns)
        rows = np.where(digit, rows * 10 + octet - ord("0"), rows)
        state = np.where(digit, 1, np.where(quote, 2, state)).astype(np.int8)
        if np.all(state == 2):
            return None if bool(np.any(rows == 0)) else Cells(rows, columns)
    return None


def _parse(xml: bytes) -> Cells:
    rows: list[int] = []
    columns: list[int] = []
    row = column = 0

    def start(name: str, attributes: dict[str, str]) -> None:
        nonlocal row, column
        tag = name.rpartition(":")[2]
        if tag == "row":
            text = attributes.get("r", "")
            row, column = (_row_number(text) if text else row + 1), 0
        elif tag == "c":
            column += 1
            text_reference = attributes.get("r")
            if text_reference is not None:
                match = _REFERENCE.fullmatch(text_reference)
                if match is None or int(match.group(2)) == 0:
                    raise MalformedSheetError(f"a cell with the reference {text_reference[:40]!r}")
                cell_row, column = int(match.group(2)), _column(match.group(1))
            else:
                cell_row = max(row, 1)
            rows.append(cell_row)
            columns.append(column)

    def doctype(*_: Any) -> None:
        raise MalformedSheetError("a document type definition")

    parser = expat.ParserCreate()
    parser.StartElementHandler = start
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(xml, True)
    except expat.ExpatError as error:
        raise MalformedSheetError(f"XML that is not well-formed: {error}") from error
    return Cells(np.array(rows, np.int64), np.array(columns, np.int64))


def _row_number(text: str) -> int:
    if not (text.isascii() and text.isdigit() and len(text) <= 9):
        raise MalformedSheetError(f"a row with the number {text[:40]!r}")
    return int(text)


def _column(letters: str) -> int:
    number = 0
    for letter in letters.upper():
        number = number * 26 + ord(letter) - ord("A") + 1
    return number
