"""CSV recordings: commas, semicolons or tabs, a header row, numbers with a decimal point or comma."""

from __future__ import annotations

import csv
import io
from itertools import chain
from pathlib import Path

from toolkit.errors import UnreadableError
from toolkit.machine import Machine
from toolkit.recording.columns import header_of
from toolkit.recording.dialect import SEPARATORS, decimal_sign, decode, number_or_text, separator_of
from toolkit.recording.safe_open import Gated
from toolkit.recording.table import Table


def read_csv(gated: Gated, machine: Machine) -> Table:
    """Return the cells of a CSV file: numbers as floats, everything else as text.

    The separator is the one that splits the header row into the machine's headers; see
    `toolkit.recording.dialect` for the decimal sign.

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
