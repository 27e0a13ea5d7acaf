"""The file of an interlaboratory comparison: one row a result.

    measurand,laboratory,value [N],U [N],k
    conicity 4 kN,A,12.3,1.1,2

``measurand`` may be left out where there is one. A laboratory's repeats are rows of their own; its U, of the
mean, stands in one of them or is the same in all, in the results' unit or another one of its dimension. ``k``
is 2 where it is not stated. Between semicolons the numbers may have decimal commas.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from toolkit.comparison.laboratories import K, Results
from toolkit.errors import CellError, ColumnError, UnreadableError
from toolkit.inputs import TABLE_FILE, read_input
from toolkit.recording.csvfile import decimal_sign, number_or_text, read_lines
from toolkit.units import Unit, split_header, unit

_COLUMNS = ("measurand", "laboratory", "value", "U", "k")
_UNITS = ("value", "U")
_NUMBERS = (*_UNITS, "k")
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
        a cell that is no finite number or empty, a U or k that is not above 0, two statements of one U
    """
    table, separator = read_lines(read_input(path, TABLE_FILE), _is_column, where=path)
    head, lines = (table[0][1] if table else []), table[1:]
    names, text, U_scale = _columns(path, head)
    numbers = [place for place, name in enumerate(names) if name in _NUMBERS]
    decimal = decimal_sign(
        (cells[place] for _, cells in lines for place in numbers if place < len(cells)), separator, where=path
    )
    reported: dict[str, dict[str, list[tuple[float, float | None, float]]]] = {}
    for number, cells in lines:
        if len(cells) != len(head):
            _refuse_cell(path, number, "", len(cells), f"{len(head)} cells, as the header has", "ragged-row")
        row = dict(zip(names, (cell.strip() for cell in cells), strict=True))
        for name in ("measurand", "laboratory"):
            if name in row and not row[name]:
                _refuse_cell(path, number, name, "an empty cell", "a name", "cell")
        at = _Place(path=path, row=number, decimal=decimal)
        value = at.number("value", row["value"])
        U = U_scale * at.number("U", row["U"], positive=True) if row.get("U") else None
        k = at.number("k", row["k"], positive=True) if row.get("k") else K
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


def _is_column(header: str) -> bool:
    return split_header(header, _COLUMNS.__contains__)[0] in _COLUMNS


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


def _columns(path: Path, head: list[str]) -> tuple[list[str], str, float]:
    """Return the columns' names, the unit of the results, and the factor that brings U to it."""
    names: list[str] = []
    units: dict[str, Unit] = {}
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
            units[name] = unit(stated, where=f"{path}, column {name}")
    for name in ("laboratory", "value"):
        if name not in names:
            _refuse_column(
                path, "missing-column", f"the column {name} is missing", ", ".join(head), ", ".join(_COLUMNS)
            )
    results = units["value"]
    U = units.get("U", results)
    if U.dimension != results.dimension:
        _refuse_column(
            path, "unit-dimension", "U has a unit of another dimension than the results", U.text,
            f"a unit of {results.dimension}, as {results.text} is",
        )  # fmt: skip
    return names, results.text, U.factor / results.factor


@dataclass(frozen=True, slots=True, kw_only=True)
class _Place:
    # A row of a file, and the decimal sign of its numbers.
    path: Path
    row: int
    decimal: str

    def number(self, column: str, text: str, *, positive: bool = False) -> float:
        """Return the number of a cell."""
        value = number_or_text(text, self.decimal)
        if isinstance(value, str) or not math.isfinite(value) or (positive and value <= 0):
            above = " above 0, or an empty cell where none is stated," if positive else ""
            sign = "comma" if self.decimal == "," else "point"
            _refuse_cell(
                self.path, self.row, column, repr(text) if text else "an empty cell",
                f"a finite number{above} with a decimal {sign}", "cell",
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
