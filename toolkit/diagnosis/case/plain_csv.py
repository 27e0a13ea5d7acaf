"""CSV: a header row of column names, then numbers; columns that nobody names may hold anything.

Commas, semicolons or tabs part the cells; a header may state its unit (`toolkit.headers`).
"""

from __future__ import annotations

import csv
import difflib
import io
import math
from collections.abc import Collection, Iterable, Mapping
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from toolkit.errors import CellError, ColumnError, UnitError, UnreadableError
from toolkit.headers import split_header
from toolkit.recording.csvfile import SEPARATORS, decimal_sign, decode, first_line, separator_of
from toolkit.units import unit

if TYPE_CHECKING:
    from numpy.typing import NDArray

_MISSING = frozenset(("", "nan", "na", "n/a", "null", "none"))
_LARGEST = 1e100  # in no unit does an instrument reach it; its square must stay a number


def read_csv(data: bytes, units: Mapping[str, str], *, where: Path) -> dict[str, NDArray[np.float64]]:
    """Return the wanted columns that the file has, each (n,), NaN where a sample is missing.

    Parameters
    ----------
    units : the unit of each wanted column; a header that states another of its dimension is converted

    Raises
    ------
    UnreadableError
        it is no text, no CSV, or has no rows; ColumnError: a wanted column stands twice; CellError: a cell
        of a wanted column is no finite number, or a row has another number of cells than the header;
        UnitError: a header states a unit of another dimension
    """
    text = decode(data, where=where)
    wanted = units.keys()
    try:
        separator = _separator(text, wanted, where)
        decimal = _decimal(text, separator, where)
        if decimal == ",":
            text = text.replace(",", ".")
        rows = csv.reader(io.StringIO(text, newline=""), delimiter=separator, skipinitialspace=True)
        parted = [split_header(cell, wanted.__contains__) for cell in next(rows, [])]
        header = [name for name, _ in parted]
        doubled = sorted({name for name in header if name in wanted and header.count(name) > 1})
        if doubled:
            raise ColumnError(
                "a column stands twice", where=where, got=", ".join(doubled), expected="different names",
                next_step="rename or remove one", rule="case-run",
            )  # fmt: skip
        made = _quick(text, header, separator)
        if made is None:
            made = _careful(rows, header, wanted, where)
    except csv.Error as error:
        raise _unreadable(where, str(error), "CSV: a header row and rows of numbers") from error
    if not len(made):
        raise _unreadable(where, "no rows of numbers", "a header and rows")
    return {
        name: _converted(made[:, i], stated, units[name], f"{where}, column {name}")
        for i, (name, stated) in enumerate(parted)
        if name in wanted
    }


def _separator(text: str, wanted: Collection[str], where: Path) -> str:
    def known(header: str) -> bool:
        return split_header(header, wanted.__contains__)[0] in wanted

    head = first_line(text)
    # Where no separator parts any name, the one that parts the most cells says best what is wrong.
    return separator_of(head, known, where=where) or max(SEPARATORS, key=head.count)


def _decimal(text: str, separator: str, where: Path) -> str:
    rows = csv.reader(io.StringIO(text, newline=""), delimiter=separator)
    next(rows, None)
    return decimal_sign(chain.from_iterable(rows), separator, where=where)


def _converted(
    values: NDArray[np.float64], stated: str | None, wanted: str, where: str
) -> NDArray[np.float64]:
    if stated is None or stated == wanted:
        return values
    source, target = unit(stated, where=where), unit(wanted, where=where)
    if source.dimension != target.dimension:
        raise UnitError(
            "a channel's unit does not fit the recording's", where=where, got=target.text,
            expected=source.text, next_step="correct the unit in the case", rule="case",
        )  # fmt: skip
    if (source.factor, source.offset) == (target.factor, target.offset):
        return values
    return (values * source.factor + source.offset - target.offset) / target.factor


def missing_column(where: Path, name: str, names: Iterable[str]) -> ColumnError:
    """Return the error of a column that a file has not, with the nearest one that it has."""
    listed = list(names)
    near = difflib.get_close_matches(name, listed, n=1, cutoff=0.5)
    step = f"did you mean {near[0]!r}?" if near else "correct the case or the file"
    return ColumnError(
        f"the recording has no column {name!r}", where=where, got=", ".join(listed) or "no columns",
        expected=f"a column {name!r} in the header row", next_step=step, rule="case-column",
    )  # fmt: skip


def header_of(data: bytes, wanted: Collection[str] = (), *, where: Path) -> list[str]:
    """Return the names in a file's header row; none where it cannot be read."""
    try:
        text = decode(data, where=where)
        rows = csv.reader(
            io.StringIO(text, newline=""), delimiter=_separator(text, wanted, where), skipinitialspace=True
        )
        return [split_header(cell, wanted.__contains__)[0] for cell in next(rows, []) if cell.strip()]
    except (UnreadableError, csv.Error):
        return []


def _quick(text: str, header: list[str], separator: str) -> NDArray[np.float64] | None:
    """Return a file of finite numbers alone, None for anything that must be looked at cell by cell."""
    start = text.find("\n")
    if start < 0 or '"' in text or "\r" in text[:start].rstrip("\r") or not text[start + 1 :].strip():
        return None
    try:
        table = np.loadtxt(
            io.StringIO(text[start + 1 :]), delimiter=separator, dtype=np.float64, ndmin=2, comments=None
        )
    except ValueError:
        return None
    fits = table.shape[1] == len(header) and bool((np.abs(table) < _LARGEST).all())
    return table if fits else None


def _careful(
    rows: Iterable[list[str]], header: list[str], wanted: Collection[str], where: Path
) -> NDArray[np.float64]:
    table: list[list[float]] = []
    used = [name in wanted for name in header]
    for number, row in enumerate(rows, start=2):
        if not any(cell.strip() for cell in row):
            continue
        if len(row) != len(header):
            raise CellError(
                "a row has another number of cells than the header", where=f"{where}, line {number}",
                got=f"{len(row)} cells", expected=f"{len(header)}",
                next_step="correct the row", rule="case-run",
            )  # fmt: skip
        table.append(
            [
                _number(cell, f"{where}, line {number}, column {name}") if use else math.nan
                for cell, name, use in zip(row, header, used, strict=True)
            ]
        )
    return np.array(table, dtype=np.float64).reshape(len(table), len(header))


def _number(cell: str, where: str) -> float:
    text = cell.strip()
    if text.lower() in _MISSING:
        return math.nan
    try:
        # Python alone reads 1_000 and digits of other scripts as numbers; no instrument writes them.
        value = float(text) if text.isascii() and "_" not in text else math.inf
    except ValueError:
        value = math.inf
    if not abs(value) < _LARGEST:
        raise CellError(
            "a cell is no number", where=where, got=repr(text[:60]),
            expected="a finite number with a decimal point, or nothing where a sample is missing",
            next_step="correct the cell, or leave it empty", rule="case-run",
        )  # fmt: skip
    return value


def _unreadable(where: Path, got: str, expected: str) -> UnreadableError:
    return UnreadableError(
        "a run cannot be read as CSV", where=where, got=got, expected=expected,
        next_step="check the file; save it as plain CSV in UTF-8", rule="case-run",
    )  # fmt: skip
