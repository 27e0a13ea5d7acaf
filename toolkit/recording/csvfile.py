"""CSV recordings: commas, semicolons or tabs, a header row, numbers with a decimal point or comma."""

from __future__ import annotations

import codecs
import contextlib
import csv
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np

from toolkit.arrays import Array
from toolkit.errors import UnreadableError
from toolkit.machine import Machine
from toolkit.recording.columns import header_of
from toolkit.recording.cut import cut_number
from toolkit.recording.table import Table

# How a text table was saved: its encoding, what separates its cells, and its decimal sign.

SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs"}
_WIDE = (b"\xff\xfe", b"\xfe\xff")
_EXPONENT = r"(?:[eE][+-]?[0-9]{1,4})?"
_NUMBER = {
    mark: re.compile(rf"[+-]?(?:[0-9]+{mark}?[0-9]*|{mark}[0-9]+){_EXPONENT}") for mark in (r"\.", ",")
}
HINT = re.compile(r"\A\"?sep=[,;\t]\"?(?=\r?\n)", re.IGNORECASE)
_GROUPED = re.compile(r"[+-]?[1-9][0-9]{0,2},[0-9]{3}")
_LINE = re.compile(r"[^\r\n]*(?:\r\n|\r|\n)|[^\r\n]+")
_PLAIN = b"0123456789+-eE \n"
_LONG_EXPONENT = re.compile(rb"[eE][+-]?[0-9]{5}")  # no number in plain digits
_PART = 1 << 20  # bytes at a time
_MOST_TITLES = 50  # lines above a header that are looked through
_BLANK_LINES = 64
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
        return HINT.sub("", data.decode("utf-16" if wide else "utf-8-sig"), count=1)
    except UnicodeDecodeError as error:
        # A file that begins with the mark of UTF-8 is no other encoding.
        if not wide and not data.startswith(codecs.BOM_UTF8):
            with contextlib.suppress(UnicodeDecodeError):
                return HINT.sub("", data.decode("cp1252"), count=1)
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
    highest = max(counts.values())
    best = [mark for mark, count in counts.items() if count == highest]
    if highest == 0:
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
    first, count, grouped = "", 0, True
    for text in map(str.strip, cells):
        if "." in text and _NUMBER[r"\."].fullmatch(text):
            return "."  # a comma among points is told with its cell
        if "," in text and _NUMBER[","].fullmatch(text):
            first, count = first or text, count + 1
            grouped = grouped and _GROUPED.fullmatch(text) is not None
    if count and grouped:
        raise UnreadableError(
            "the commas in the numbers may be decimal signs or stand between thousands",
            where=where,
            got=f"{first!r}, and {count - 1} others with three digits behind the comma",
            expected="numbers that can be read in one way only",
            next_step="save it again with a point as the decimal sign and nothing between thousands",
            rule="ambiguous-text",
        )
    return "," if count else "."


Line = tuple[int, list[str]]


def read_lines(data: bytes, is_header: Callable[[str], bool], *, where: Path) -> tuple[list[Line], str]:
    """Return (line number, cells) of every line of a text table that is not blank, and what parts the cells.

    It is the reader of every table that people bring: decoded as recordings are, parted by what splits the
    header row into the most headers that are known, else into the most cells.

    Raises
    ------
    UnreadableError
        rule ``encoding ambiguous-text unreadable``
    """
    text = decode(data, where=where)
    head = first_line(text)
    separator = separator_of(head, is_header, where=where) or max(SEPARATORS, key=head.count)
    lines = csv.reader((line[0] for line in _LINE.finditer(text)), delimiter=separator, strict=True)
    try:
        return [(lines.line_num, cells) for cells in lines if any(map(str.strip, cells))], separator
    except csv.Error as error:
        raise _no_csv(error, separator, f"{where}, line {lines.line_num}") from error


def pointed(lines: Iterable[Line], separator: str, *, where: Path) -> list[Line]:
    """Return lines of numbers with points for decimal commas; see `decimal_sign`. Other cells stay.

    >>> pointed([(2, ["-1,5", "a, b"])], ";", where=Path("table.csv"))
    [(2, ['-1.5', 'a, b'])]
    """
    rows = list(lines)
    if decimal_sign((cell for _, cells in rows for cell in cells), separator, where=where) == ".":
        return rows
    return [
        (row, [cell.replace(",", ".") if _NUMBER[","].fullmatch(cell.strip()) else cell for cell in cells])
        for row, cells in rows
    ]


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


def read_csv(data: bytes, where: Path, machine: Machine) -> Table:
    """Return the cells of a CSV file: numbers as floats, everything else as text.

    The separator is the one that splits the header row into the machine's headers; see
    `decimal_sign` for the decimal sign.

    Raises
    ------
    UnreadableError
        rule ``not-a-workbook encoding unreadable ambiguous-text``: text without such a header row, in
        another encoding, or that can be read in more than one way
    """
    plain = _plain_table(data, where, machine)
    if plain is not None and data.endswith(b"\n"):
        return plain
    text = decode(data, where=where)
    head = first_line(text)
    separator = separator_of(head, header_of(machine), where=where)
    if separator is None:
        what = "the file is a text file, not a recording"
        next_step = "give the file that the acquisition program wrote"
        if titles := _titles(text, header_of(machine)):
            what = f"{titles} line{'s stand' if titles > 1 else ' stands'} above the header row"
            next_step = "remove what stands above the header row in a copy of the file"
        elif _is_tabular(text):
            what = f"the table has no column of the machine {machine.name}"
            next_step = (
                "name the machine that wrote it, or define it: toolkit machine new RIG.toml --from FILE"
            )
        raise UnreadableError(
            what, where=where, got=f"text that begins with {head[:60]!r}",
            expected="an .xlsx workbook, or CSV with a header row such as "
            + ",".join(column.header for column in machine.columns),
            next_step=next_step, rule="not-a-workbook",
        )  # fmt: skip
    cut = cut_number(text[-_PART:], separator)
    if plain is not None:
        return replace(plain, cut=cut)
    below = _iterate_rows(text, separator, where=where)
    next((row for row in below if any(cell.strip() for cell in row)), None)
    decimal = decimal_sign(chain.from_iterable(below), separator, where=where)
    rows: list[list[float | str]] = [
        [number_or_text(cell, decimal) for cell in row] for row in _iterate_rows(text, separator, where=where)
    ]
    width = max(map(len, rows), default=0)
    for row in rows:
        row += [""] * (width - len(row))
    return Table(where=str(where), rows=rows, cut=cut)


def _titles(text: str, is_header: Callable[[str], bool]) -> int:
    # How many lines stand above the first that has headers; 0 where no line near the top has any.
    lines = [line for line in text[:_PART].splitlines() if line.strip(" \t,;")][:_MOST_TITLES]
    with_headers = (any(_headers(line, mark, is_header) for mark in SEPARATORS) for line in lines)
    return next((number for number, has_header in enumerate(with_headers) if has_header), 0)


def _is_tabular(text: str) -> bool:
    lines = [line for line in text[:_PART].split("\n")[:-1] if line.strip()][:4]
    counts = [{line.count(mark) for line in lines} for mark in SEPARATORS]
    return len(lines) > 1 and any(len(count) == 1 and min(count) > 0 for count in counts)


# Nearly every CSV file is a header and rows of plain numbers, all as wide. Such a table goes from bytes to
# doubles part by part, without an object for each cell; whatever departs from it is read cell by cell.


def _plain_table(data: bytes, where: Path, machine: Machine) -> Table | None:
    try:
        if data[:2] in _WIDE:
            data = decode(data, where=where).encode()
        begin, head = _head(data, where)
        separator = separator_of(first_line(head), header_of(machine), where=where)
        if separator is None:
            return None
        top = split_rows(head, separator, where=where)
        decimal = _decimal_of(data[begin : begin + _PART], separator, where)
    except UnreadableError:
        return None  # what it is about is told when the cells are read
    if any(cell.strip() for row in top[:-1] for cell in row):
        return None
    numbers = _plain_numbers(data, begin, separator.encode(), decimal.encode(), len(top[-1]))
    if numbers is None:
        return None
    rows = [[number_or_text(cell, decimal) for cell in row] for row in top]
    return Table(where=str(where), rows=rows, numbers=numbers)


def _head(data: bytes, where: Path) -> tuple[int, str]:
    # Everything down to the end of the header row; nothing where that is not near.
    end = 0
    for _ in range(_BLANK_LINES):
        end = data.find(b"\n", end) + 1
        head = decode(data[:end], where=where)
        if not end or first_line(head):
            return end, head
    return 0, ""


def _decimal_of(part: bytes, separator: str, where: Path) -> str:
    # By the first part: where a later one departs from it, the table is not plain.
    if separator == "," or b"," not in part:
        return "."
    cells = re.split(f"[{separator}\r\n]", part.decode("ascii", "replace"))
    return decimal_sign(cells[:-1] or cells, separator, where=where)


def _plain_numbers(data: bytes, begin: int, separator: bytes, decimal: bytes, width: int) -> Array | None:
    """Return what stands from ``begin`` on (rows, columns); None where it is anything but plain numbers."""
    tail = data[max(begin, len(data) - _BLANK_LINES) :]
    end = len(data) - (len(tail) - len(tail.rstrip(b"\r\n")))
    rows = data.count(b"\n", begin, end) + 1
    if end <= begin or 2 * rows * width > end - begin + 1:  # a digit and a separator each, at least
        return None
    columns = np.empty((width, rows))
    row = 0
    while begin < end:
        stop = end if end - begin <= _PART else data.rfind(b"\n", begin, begin + _PART) + 1
        values = _numbers_of(data[begin:stop], separator, decimal, width)
        if values is None:
            return None
        columns[:, row : row + len(values)] = values.T
        row, begin = row + len(values), stop
    return columns.T


def _numbers_of(part: bytes, separator: bytes, decimal: bytes, width: int) -> Array | None:
    part = part.replace(b"\r\n", b"\n")
    if part.translate(None, _PLAIN + separator + decimal) or _LONG_EXPONENT.search(part):
        return None
    part = part.replace(decimal, b".").removesuffix(b"\n") + b"\n"
    octets = np.frombuffer(part, np.uint8)
    marks = octets[(octets == ord(separator)) | (octets == ord("\n"))]
    row = np.frombuffer(separator * (width - 1) + b"\n", np.uint8)
    if len(marks) % width or not np.all(marks.reshape(-1, width) == row):
        return None
    try:
        values = np.array([float(cell) for cell in part[:-1].replace(b"\n", separator).split(separator)])
    except ValueError:
        return None
    return values.reshape(-1, width) if np.isfinite(values).all() else None


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
    return list(_iterate_rows(text, separator, where=where))


def _iterate_rows(text: str, separator: str, *, where: Path) -> Iterator[list[str]]:
    lines = (line[0] for line in _LINE.finditer(text))
    try:
        yield from csv.reader(lines, delimiter=separator, strict=True)
    except csv.Error as error:
        raise _no_csv(error, separator, where) from error


def _no_csv(error: csv.Error, separator: str, where: object) -> UnreadableError:
    long = "field larger" in str(error)
    return UnreadableError(
        "the CSV file cannot be read",
        where=where,
        got=error,
        expected=f"values separated by {SEPARATORS[separator]}",
        next_step="look for a line without separators, or a quotation mark that is not closed"
        if long
        else "mend the quotation marks in a copy of the file",
        rule="unreadable",
    )
