"""CSV recordings: commas, semicolons or tabs, a header row, numbers with a decimal point or comma."""

from __future__ import annotations

import codecs
import contextlib
import csv
import io
import re
from collections.abc import Callable, Iterable
from itertools import chain
from pathlib import Path

from toolkit.errors import UnreadableError
from toolkit.machine import Machine
from toolkit.recording.columns import header_of
from toolkit.recording.safe_open import Gated
from toolkit.recording.table import Table

# How a text table was saved: its encoding, what separates its cells, and its decimal sign.

SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs"}
_WIDE = (b"\xff\xfe", b"\xfe\xff")
_EXPONENT = r"(?:[eE][+-]?[0-9]{1,4})?"
_NUMBER = {
    mark: re.compile(rf"[+-]?(?:[0-9]+{mark}?[0-9]*|{mark}[0-9]+){_EXPONENT}") for mark in (r"\.", ",")
}
_HINT = re.compile(r"\A\"?sep=[,;\t]\"?(?=\r?\n)", re.IGNORECASE)
_GROUPED = re.compile(r"[+-]?[1-9][0-9]{0,2},[0-9]{3}")
_NO_NUMBER = frozenset("nan +nan -nan inf +inf -inf infinity +infinity -infinity".split())


def decode(data: bytes, *, where: Path) -> str:
    """Return a text file's content: UTF-16 where its byte order mark says so, UTF-8, else Windows-1252.

    Windows-1252 holds Latin-1's letters, the degree sign and the micro sign at their places: a program of
    Western Europe writes it without saying so. Digits and separators are the same bytes in either, so that
    no number can change by it. A first line ``sep=;``, which tells a spreadsheet what separates the cells, is
    left blank.

    Raises
    ------
    UnreadableError
        rule ``encoding``: bytes that are none of these
    """
    wide = data[:2] in _WIDE
    try:
        return _HINT.sub("", data.decode("utf-16" if wide else "utf-8-sig"), count=1)
    except UnicodeDecodeError as error:
        # A file that begins with the mark of UTF-8 is no other encoding.
        if not wide and not data.startswith(codecs.BOM_UTF8):
            with contextlib.suppress(UnicodeDecodeError):
                return _HINT.sub("", data.decode("cp1252"), count=1)
        raise UnreadableError(
            f"the text file is not in UTF-{16 if wide else 8}",
            where=where,
            got=f"byte {data[error.start]:#04x} at {error.start}",
            expected="a CSV file in UTF-8, in UTF-16 with its byte order mark, or in Windows-1252 (Latin-1)",
            next_step="save it again as 'CSV UTF-8'",
            rule="encoding",
        ) from error


def separator_of(head: str, is_header: Callable[[str], bool], *, where: Path) -> str | None:
    """Return what splits a header row into the most headers that are ``known``; None where nothing does.

    Raises
    ------
    UnreadableError
        rule ``ambiguous-text``: two separators do as well
    """
    counts = {mark: _headers(head, mark, is_header) for mark in SEPARATORS}
    most = max(counts.values())
    best = [mark for mark, count in counts.items() if count == most]
    if most == 0:
        return None
    if len(best) > 1:
        raise UnreadableError(
            "the header row can be split in more than one way",
            where=where,
            got=f"{head[:120]!r}: {' or '.join(SEPARATORS[mark] for mark in best)}",
            expected="one separator between all headers",
            next_step="save it again with commas between the cells and a point in the numbers",
            rule="ambiguous-text",
        )
    return best[0]


def decimal_sign(cells: Iterable[str], separator: str, *, where: Path) -> str:
    """Return the decimal sign of a table's numbers: a comma where it can be nothing else, else a point.

    Raises
    ------
    UnreadableError
        rule ``ambiguous-text``: every comma may as well stand between thousands
    """
    if separator == ",":
        return "."
    texts = [cell.strip() for cell in cells]
    commas = [text for text in texts if "," in text and _NUMBER[","].fullmatch(text)]
    if not commas or any("." in text and _NUMBER[r"\."].fullmatch(text) for text in texts):
        return "."  # a comma among points is told with its cell
    if all(_GROUPED.fullmatch(text) for text in commas):
        raise UnreadableError(
            "the commas in the numbers may be decimal signs or stand between thousands",
            where=where,
            got=f"{commas[0]!r}, and {len(commas) - 1} others with three digits behind the comma",
            expected="numbers that can be read in one way only",
            next_step="save it again with a point as the decimal sign and nothing between thousands",
            rule="ambiguous-text",
        )
    return ","


def number_or_text(cell: str, decimal: str = ".") -> float | str:
    """Return a cell as a number where it is one in plain digits or a word such as ``nan``, else as text.

    >>> number_or_text("-1,5", ","), number_or_text("-1.5", ","), number_or_text("1_000")
    (-1.5, '-1.5', '1_000')
    """
    # float() alone would take '1_000' and digits of other scripts.
    text = cell.strip()
    if _NUMBER[","].fullmatch(text) if decimal == "," else _NUMBER[r"\."].fullmatch(text):
        return float(text.replace(",", "."))
    return float(text) if text.lower() in _NO_NUMBER else text


def _headers(head: str, separator: str, is_header: Callable[[str], bool]) -> int:
    try:
        headers = next(csv.reader([head], delimiter=separator), [])
    except csv.Error:
        return 0
    return sum(map(is_header, headers)) if len(headers) > 1 else 0


def read_csv(gated: Gated, machine: Machine) -> Table:
    """Return the cells of a CSV file: numbers as floats, everything else as text.

    The separator is the one that splits the header row into the machine's headers; see
    `decimal_sign` for the decimal sign.

    Raises
    ------
    UnreadableError
        rule ``not-a-workbook encoding unreadable ambiguous-text``: text without such a header row, in
        another encoding, or that can be read in more than one way
    """
    text = decode(gated.data, where=gated.path)
    head = first_line(text)
    separator = separator_of(head, header_of(machine), where=gated.path)
    if separator is None:
        raise UnreadableError(
            "the file is a text file, not a recording",
            where=gated.path,
            got=f"text that begins with {head[:60]!r}",
            expected="an .xlsx workbook, or CSV with a header row such as "
            + ",".join(column.header for column in machine.columns),
            next_step="give the file that the acquisition program wrote",
            rule="not-a-workbook",
        )
    cells = split_rows(text, separator, where=gated.path)
    first = next((i for i, row in enumerate(cells) if any(cell.strip() for cell in row)), len(cells))
    decimal = decimal_sign(chain.from_iterable(cells[first + 1 :]), separator, where=gated.path)
    rows = [[number_or_text(cell, decimal) for cell in row] for row in cells]
    width = max(map(len, rows), default=0)
    return Table(where=str(gated.path), rows=[row + [""] * (width - len(row)) for row in rows])


def first_line(text: str) -> str:
    """Return the first line that has more than blanks and separators; empty where there is none."""
    return next((line for line in text.splitlines() if line.strip(" \t,;")), "")


def split_rows(text: str, separator: str, *, where: Path) -> list[list[str]]:
    """Return the cells of a text table, row by row.

    Raises
    ------
    UnreadableError
        rule ``unreadable``
    """
    try:
        return list(csv.reader(io.StringIO(text, newline=""), delimiter=separator, strict=True))
    except csv.Error as error:
        raise UnreadableError(
            "the CSV file cannot be read",
            where=where,
            got=error,
            expected=f"values separated by {SEPARATORS[separator]}",
            next_step="mend the quotation marks in a copy of the file",
            rule="unreadable",
        ) from error
