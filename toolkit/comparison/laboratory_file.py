"""The file of an interlaboratory comparison: one row a result.

    measurand,laboratory,value [N],U [N],k
    conicity 4 kN,A,12.3,1.1,2

``measurand`` may be left out where there is one. A laboratory's repeats are rows of their own; its U, of the
mean, stands in one of them or is the same in all. ``k`` is 2 where it is not stated.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from toolkit.comparison.laboratories import K, Results
from toolkit.errors import CellError, ColumnError, UnreadableError
from toolkit.headers import split_header
from toolkit.inputs import TABLE_FILE, read_input
from toolkit.units import unit

_COLUMNS = ("measurand", "laboratory", "value", "U", "k")
_UNITS = ("value", "U")
ONE = "result"
"""Name of the only measurand of a file that names none."""


def read_laboratories(path: Path) -> tuple[dict[str, Sequence[Results]], str]:
    """Return the results of every laboratory by measurand, and their unit.

    Raises
    ------
    UnreadableError
        no text, no rows
    ColumnError
        a column is unknown, doubled, missing, without a unit or with another one than the results'
    CellError
        a cell that is no finite number or empty, a negative U, a k of 0, two statements of one U
    """
    head, *lines = _lines(path)
    names, text = _columns(path, head)
    reported: dict[str, dict[str, list[tuple[float, float | None, float]]]] = {}
    for number, cells in enumerate(lines, start=2):
        if not any(cell.strip() for cell in cells):
            continue
        if len(cells) != len(head):
            _refuse_cell(path, number, "", len(cells), f"{len(head)} cells, as the header has", "ragged-row")
        row = dict(zip(names, (cell.strip() for cell in cells), strict=True))
        for name in ("measurand", "laboratory"):
            if name in row and not row[name]:
                _refuse_cell(path, number, name, "an empty cell", "a name", "cell")
        value = _number(path, number, "value", row["value"])
        U = _number(path, number, "U", row["U"], 0.0) if row.get("U") else None
        k = _number(path, number, "k", row["k"], 1e-9) if row.get("k") else K
        by_laboratory = reported.setdefault(row.get("measurand", ONE), {})
        by_laboratory.setdefault(row["laboratory"], []).append((value, U, k))
    if not reported:
        raise UnreadableError(
            "the comparison has no results", where=path, got="a header and no rows",
            expected="one row a result", next_step="add the rows", rule="no-data",
        )  # fmt: skip
    return {
        measurand: [_results(path, measurand, name, rows) for name, rows in laboratories.items()]
        for measurand, laboratories in reported.items()
    }, text


def _results(
    path: Path, measurand: str, laboratory: str, rows: list[tuple[float, float | None, float]]
) -> Results:
    stated = {(U, k) for _, U, k in rows if U is not None}
    if len(stated) > 1:
        raise CellError(
            "a laboratory states two uncertainties of one mean", where=f"{path}, {measurand}, {laboratory}",
            got=", ".join(f"U = {U:g}, k = {k:g}" for U, k in sorted(stated)), expected="one U",
            next_step="state it once, or the same in all its rows", rule="cell",
        )  # fmt: skip
    U, k = next(iter(stated), (None, K))
    return Results(laboratory=laboratory, values=tuple(value for value, _, _ in rows), U=U, k=k)


def _lines(path: Path) -> list[list[str]]:
    try:
        text = read_input(path, TABLE_FILE).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise UnreadableError(
            "the comparison is not a text file in UTF-8", where=path, got=f"a wrong byte at {error.start}",
            expected="CSV in UTF-8", next_step="save it as 'CSV UTF-8'", rule="encoding",
        ) from error  # fmt: skip
    first = text.partition("\n")[0]
    lines = list(csv.reader(io.StringIO(text, newline=""), delimiter=max(",;", key=first.count)))
    return lines or [[]]


def _columns(path: Path, head: list[str]) -> tuple[list[str], str]:
    """Return the columns' names and the unit of the results."""
    names: list[str] = []
    units: dict[str, str] = {}
    for cell in head:
        name, stated = split_header(cell, _COLUMNS.__contains__)
        if name not in _COLUMNS:
            _refuse_column(path, "unknown-column", f"unknown column {name!r}", cell, ", ".join(_COLUMNS))
        if name in names:
            _refuse_column(path, "doubled-column", f"the column {name} stands twice", cell, f"one {name}")
        names.append(name)
        if name in _UNITS:
            if stated is None:
                _refuse_column(path, "unknown-unit", f"the column {name} has no unit", cell, f"'{name} [N]'")
            units[name] = unit(stated, where=f"{path}, column {name}").text
    for name in ("laboratory", "value"):
        if name not in names:
            _refuse_column(
                path, "missing-column", f"the column {name} is missing", ", ".join(head), ", ".join(_COLUMNS)
            )
    if units.get("U", units["value"]) != units["value"]:
        _refuse_column(
            path, "unit-dimension", "U has another unit than the results", units["U"], units["value"]
        )
    return names, units["value"]


def _number(path: Path, row: int, column: str, text: str, least: float = -math.inf) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or value < least:
        at_least = "" if math.isinf(least) else " of 0 or more" if least == 0 else " above 0"
        _refuse_cell(
            path, row, column, repr(text) if text else "an empty cell",
            f"a finite number{at_least} with a decimal point", "cell",
        )  # fmt: skip
    return value


def _refuse_cell(path: Path, row: int, column: str, actual: object, expected: str, rule: str) -> NoReturn:
    where = f"{path}, row {row}" + (f", column {column}" if column else "")
    raise CellError(
        "a row cannot be used", where=where, got=actual, expected=expected, next_step="mend it", rule=rule
    )


def _refuse_column(path: Path, rule: str, problem: str, actual: str, expected: str) -> NoReturn:
    raise ColumnError(
        problem, where=path, got=actual, expected=expected, next_step="mend the header", rule=rule
    )
