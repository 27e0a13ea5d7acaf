"""CSV recordings: comma or semicolon, a header row, numbers with a decimal point."""

from __future__ import annotations

import csv
import io
import re

from toolkit.errors import UnreadableError
from toolkit.machine import Machine
from toolkit.recording.columns import looks_like_header
from toolkit.recording.gate import Gated
from toolkit.recording.table import Table

_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,4})?")
_NO_NUMBER = frozenset("nan +nan -nan inf +inf -inf infinity +infinity -infinity".split())


def read_csv(gated: Gated, machine: Machine) -> Table:
    """Return the cells of a CSV file: numbers as floats, everything else as text.

    The separator is the one of the two that splits the header row into the machine's headers.

    Raises
    ------
    UnreadableError
        rule ``not-a-workbook encoding unreadable``: text without such a header row, or not in UTF-8
    """
    try:
        text = gated.data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise UnreadableError(
            "the text file is not in UTF-8",
            where=gated.path,
            got=f"byte {gated.data[error.start]:#04x} at {error.start}",
            expected="a CSV file in UTF-8",
            next_step="save it again as 'CSV UTF-8'",
            rule="encoding",
        ) from error
    head = next((line for line in text.splitlines() if line.strip(" \t,;")), "")
    separator = max(",;", key=head.count)
    try:
        headers = next(csv.reader([head], delimiter=separator), [])
        if len(headers) < 2 or not looks_like_header(headers, machine):
            raise UnreadableError(
                "the file is a text file, not a recording",
                where=gated.path,
                got=f"text that begins with {head[:60]!r}",
                expected="an .xlsx workbook, or CSV with a header row such as "
                + ",".join(column.header for column in machine.columns),
                next_step="give the file that the acquisition program wrote",
                rule="not-a-workbook",
            )
        rows = [
            [number_or_text(cell) for cell in row]
            for row in csv.reader(io.StringIO(text, newline=""), delimiter=separator, strict=True)
        ]
    except csv.Error as error:
        raise UnreadableError(
            "the CSV file cannot be read",
            where=gated.path,
            got=error,
            expected=f"values separated by {separator!r}",
            next_step="mend the quotation marks in a copy of the file",
            rule="unreadable",
        ) from error
    width = max(map(len, rows), default=0)
    return Table(where=str(gated.path), rows=[row + [""] * (width - len(row)) for row in rows])


def number_or_text(cell: str) -> float | str:
    """Return a cell as a number where it is one in plain digits or a word such as ``nan``, else as text."""
    # float() alone would take '1_000' and digits of other scripts.
    text = cell.strip()
    if _NUMBER.fullmatch(text) or text.lower() in _NO_NUMBER:
        return float(text)
    return text
