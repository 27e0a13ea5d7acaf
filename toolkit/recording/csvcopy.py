"""A copy of a CSV recording with other numbers in some of its columns, and nothing else changed.

Encoding, byte order mark, separator, decimal sign, ends of lines, quotes, spaces, lines without a cell and
columns without a name stay byte for byte: the program that reads the original reads the copy.
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from toolkit.machine import Machine
from toolkit.recording.columns import assign_columns, header_of
from toolkit.recording.csvfile import HINT, decimal_sign, decode, first_line, separator_of, split_rows

_MARKS = (
    (codecs.BOM_UTF8, "utf-8"), (codecs.BOM_UTF16_LE, "utf-16-le"), (codecs.BOM_UTF16_BE, "utf-16-be"),
)  # fmt: skip
_FORMULA = ("=", "+", "-", "@")

Span = tuple[int, int]


def with_numbers(
    data: bytes, columns: Mapping[str, Sequence[float]], machine: Machine, *, where: Path
) -> bytes:
    """Return a recording's content with the numbers of some channels replaced.

    A header that a spreadsheet would take for a formula is made a text.

    Parameters
    ----------
    data : a CSV file that `read_csv` reads
    columns : symbol to one number a data row, in the unit of the file's column; those that it lacks are
        passed over
    machine : the machine that wrote it
    where : the file, for messages

    Raises
    ------
    UnreadableError, ColumnError
        as of `read_csv`
    """
    mark, encoding = _encoding(data)
    text = data[len(mark) :].decode(encoding)
    plain = decode(data, where=where)
    separator = separator_of(first_line(plain), header_of(machine), where=where) or ","
    filled = [row for row in split_rows(plain, separator, where=where) if any(map(str.strip, row))]
    cells = (cell for row in filled[1:] for cell in row)
    decimal = decimal_sign(cells, separator, where=where)
    hint = HINT.match(text)
    rows = _rows(text, separator, hint.end() if hint else 0)
    head = next(rows)
    names = [_unquoted(text[start:end]) for start, end in head]
    assigned = assign_columns(names, machine, where=where)
    places = [(one.index, columns[one.symbol]) for one in assigned if one.symbol in columns]
    edits: list[tuple[Span, str]] = [(span, _as_text(text[span[0] : span[1]])) for span in head]
    for number, row in enumerate(rows):
        edits += [
            (row[index], _with_number(text[row[index][0] : row[index][1]], float(values[number]), decimal))
            for index, values in places
        ]
    return mark + _edited(text, edits).encode(encoding)


def _encoding(data: bytes) -> tuple[bytes, str]:
    for mark, encoding in _MARKS:
        if data.startswith(mark):
            return mark, encoding
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return b"", "cp1252"
    return b"", "utf-8"


def _rows(text: str, separator: str, begin: int) -> Iterator[list[Span]]:
    """Yield where the cells of each row stand; a row without any is passed over."""
    mark = re.escape(separator)
    cell: Callable[[str, int], re.Match[str] | None] = re.compile(
        rf'"(?:[^"]|"")*+"[^{mark}\r\n]*|[^{mark}\r\n]*'
    ).match
    at, row = begin, list[Span]()
    while at <= len(text):
        match = cell(text, at)
        assert match is not None  # noqa: S101  it matches nothing, too
        row.append(match.span())
        at = match.end()
        if text[at : at + 1] == separator:
            at += 1
            continue
        if any(text[start:end].strip(' "\t') for start, end in row):
            yield row
        row = []
        at += 2 if text[at : at + 2] == "\r\n" else 1


def _unquoted(cell: str) -> str:
    return cell[1:-1].replace('""', '"') if len(cell) > 1 and cell[0] == cell[-1] == '"' else cell


def _as_text(cell: str) -> str:
    quote = '"' * cell.startswith('"')
    return f"{quote}'{cell[len(quote) :]}" if cell[len(quote) :].startswith(_FORMULA) else cell


def _with_number(cell: str, value: float, decimal: str) -> str:
    """Return a cell with another number in place of its own, between the same spaces and quotes."""
    bare = cell.strip(' "\t')
    before, _, after = cell.partition(bare) if bare else (cell, "", "")
    return f"{before}{repr(value).replace('.', decimal)}{after}"


def _edited(text: str, edits: Sequence[tuple[Span, str]]) -> str:
    parts, end = [], 0
    for (start, stop), cell in edits:
        parts += [text[end:start], cell]
        end = stop
    return "".join([*parts, text[end:]])
