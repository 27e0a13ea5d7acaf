"""Reference-load data: a table with units in its header, whole or not at all.

The same reader serves a session and the load-time refit of a record, so that what is checked is what was
fitted; for a plain CSV file it needs numpy alone.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.calibration.session.cells import Cells, is_empty, read_cells
from toolkit.calibration.session.header import (
    COMMENT,
    RUNS,
    Wanted,
    header_error,
    is_known,
    read_head,
    with_units_row,
)
from toolkit.errors import RecordingError, SessionError
from toolkit.units import si_scale, unit

_GROUPED = re.compile(r"[+-]?[1-9][0-9]{0,2}\.[0-9]{3}")
_POINT_AND_COMMA = (
    "the file has numbers with a decimal point and numbers with a comma, or marks between thousands: write "
    "all of them with one decimal sign and nothing between thousands; nothing was written"
)
_DECIMAL_COMMA = (
    "the number has a decimal comma, and commas stand between the cells too: save the file with semicolons "
    "or tabs between the cells, or with a decimal point; nothing was written"
)
_SPACED = re.compile(r"[+-]?\d{1,3}(?:[\s'\u2019]\d{3})+(?:[.,]\d+)?")
_THOUSANDS = "nothing may stand between thousands: write the number without it; nothing was written"
_MOST_FAULTS = 1000  # a file of another kind has millions
_MOST_PLACES = 9  # of further cells in one message; `SessionError.further` has them all
_CORRECT = "correct the cell, or remove the whole row with a reason in the laboratory's notes"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Table:
    """A read file: ``names`` and ``units`` of the numeric columns, ``values`` (rows, columns) as written.

    ``run`` (rows,), ``up`` (rows,), True where the load was increased, and ``rotation`` [deg] are None where
    the file has no such column; ``labels`` are columns of names (name, a text a row), see `known_errors`.
    ``lines`` (rows,) are the numbers of the rows in the file, for messages; ``hidden`` those of them that a
    workbook hides.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    run: Array | None
    up: NDArray[np.bool_] | None
    rotation: Array | None
    labels: tuple[tuple[str, tuple[str, ...]], ...] = ()
    lines: Sequence[int] = ()
    hidden: tuple[int, ...] = ()

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(self.values)

    @property
    def direction(self) -> tuple[str, ...] | None:
        """The column ``direction`` in words."""
        return None if self.up is None else tuple("up" if rising else "down" for rising in self.up.tolist())

    def has(self, name: str) -> bool:
        """Tell whether the file has a numeric column."""
        return name in self.names

    def column(self, name: str) -> Array:
        """Return a column (rows,) in the unit of the file."""
        return self.values[:, self.names.index(name)]

    def unit(self, name: str) -> str:
        """Return a column's unit."""
        return self.units[self.names.index(name)]

    def columns(self, names: Sequence[str]) -> dict[str, Array]:
        """Return columns by name."""
        return {name: self.column(name) for name in names}

    def in_units(self, wanted: Mapping[str, str]) -> Table:
        """Return the table with columns brought to other units of the same dimension; UnitError otherwise."""
        factors = {
            name: si_scale(text, unit(wanted[name]).dimension, where=f"column {name}")
            / unit(wanted[name]).factor
            for name, text in zip(self.names, self.units, strict=True)
            if text != wanted.get(name, text)
        }
        return self.scaled(factors, wanted)

    def scaled(self, factors: Mapping[str, float], units: Mapping[str, str]) -> Table:
        """Return the table with columns multiplied by factors, and named in their new units."""
        by = [factors.get(name, 1.0) for name in self.names]
        values = self.values if set(by) == {1.0} else self.values * by
        told = tuple(
            units[name] if name in factors else text
            for name, text in zip(self.names, self.units, strict=True)
        )
        return dataclasses.replace(self, units=told, values=values)

    def only(self, rows: NDArray[np.bool_]) -> Table:
        """Return the table of some of its rows (rows,)."""

        def chosen(column: NDArray[Any] | None) -> NDArray[Any] | None:
            return None if column is None else column[rows]

        at = np.flatnonzero(rows).tolist()
        return dataclasses.replace(
            self,
            values=self.values[rows],
            run=chosen(self.run),
            up=chosen(self.up),
            rotation=chosen(self.rotation),
            labels=tuple((name, tuple(texts[row] for row in at)) for name, texts in self.labels),
            lines=[self.lines[row] for row in at] if len(self.lines) else (),
        )

    def matrix(self, names: Sequence[str]) -> Array:
        """Return columns side by side (rows, names)."""
        # Column by column in memory, as every computation reads it.
        return np.array([self.column(name) for name in names]).T


def read_table(
    data: bytes,
    *,
    where: object,
    required: Sequence[str],
    optional: Sequence[str] = (),
    labels: Sequence[str] = (),
    passed: Sequence[str] = (),
    runs: bool = True,
) -> Table:
    """Read reference-load data, see `cells` for the kinds of files.

    Parameters
    ----------
    data : the file's content
    where : the file, for messages
    required, optional : names of the numeric columns; each needs a unit in the header, or in a row below it
    labels : names of columns that may hold names, without a unit; with one they are numeric
    passed : names of columns that may stand in the file and are passed over, as ``comment`` always is
    runs : whether ``run`` and ``direction`` are required and ``rotation`` is read; else they are passed over

    Raises
    ------
    SessionError
        a column is missing, doubled, unknown or without unit; no rows; cells that are no finite numbers, told
        at once: the first of them with the others as ``further``
    UnitError
        a unit is unknown
    """
    over = {*passed, COMMENT, *(() if runs else RUNS)} - {*required}
    wanted = Wanted(tuple(required), tuple(optional), tuple(labels), tuple(sorted(over)), runs)
    cells = with_units_row(read_cells(data, lambda text: is_known(text, wanted), where=where), wanted)
    head = read_head(cells, wanted)
    if not cells.lines:
        raise header_error(
            cells.where, "the file has no rows", "0 rows", "one row a reference load", "no-data"
        )
    up = None
    faults: list[tuple[int, int, SessionError]] = []
    if "direction" in head.columns:
        at = head.columns["direction"]
        direction = [str(cell).strip().lower() for cell in cells.columns[at]]
        for number, text in enumerate(direction, start=1):
            if text not in ("up", "down"):
                faults.append((number, at, _cell(cells, number, at, "up or down")))
        up = np.array([text == "up" for text in direction])
    more = [name for name in ("run", "rotation") if name in head.columns]
    columns = _numbers(cells, [head.columns[name] for name in (*head.numeric, *more)], faults)
    values, extra = columns[: len(head.numeric)].T, dict(zip(more, columns[len(head.numeric) :], strict=True))
    run = extra.get("run")
    if run is not None:
        for row in np.flatnonzero(np.isfinite(run) & (run != np.floor(run))).tolist():
            at = head.columns["run"]
            faults.append((row + 1, at, _cell(cells, row + 1, at, "a whole number")))
    _refuse_cells(faults)
    return Table(
        names=head.numeric,
        units=head.units,
        values=values,
        run=run,
        up=up,
        rotation=extra.get("rotation"),
        labels=tuple((name, _texts(cells, head.columns[name])) for name in head.labels),
        lines=cells.lines,
        hidden=tuple(sorted({*cells.lines} & {*cells.hidden})),
    )


def _texts(cells: Cells, column: int) -> tuple[str, ...]:
    # A worksheet holds a stack named 1 as a number.
    texts = tuple(
        f"{cell:.15g}" if isinstance(cell, float) else str(cell).strip() for cell in cells.columns[column]
    )
    if not all(texts):
        raise _cell(cells, texts.index("") + 1, column, "a name in every row")
    return texts


def _refuse_cells(faults: Sequence[tuple[int, int, SessionError]]) -> None:
    """Raise the first of the cells that cannot be used, by row and column; it names the others."""
    if not faults:
        return
    first, *further = (error for _, _, error in sorted(faults, key=lambda fault: fault[:2]))
    if further:
        places = [str(error.where).rpartition("/")[2].partition(", ")[2] for error in further[:_MOST_PLACES]]
        more = len(further) - len(places)
        first.got = f"{first.got}; none either in {'; '.join(places)}{f'; {more} more cells' if more else ''}"
    first.further = tuple(further)
    raise first


def _numbers(cells: Cells, at: Sequence[int], faults: list[tuple[int, int, SessionError]]) -> Array:
    """Return the numbers of columns (columns, rows), NaN with a fault in place of what is none."""
    columns = [cells.columns[index] for index in at]
    if cells.separator == ",":
        text = "".join(map("".join, columns))
        try:
            values = np.array([list(map(float, column)) for column in columns])
            # float() reads 1_0 as ten, and digits of every script; in a table they are a slip.
            if np.isfinite(values).all() and text.isascii() and "_" not in text:
                return values
        except ValueError:
            pass
    decimal = _decimal(cells, at)
    values = np.full((len(at), len(cells.lines)), np.nan)
    for place, column in enumerate(at):
        for row in range(1, len(cells.lines) + 1):
            try:
                values[place, row - 1] = _number(cells, row, column, decimal)
            except SessionError as error:
                faults.append((row, column, error))
                if len(faults) >= _MOST_FAULTS:
                    _refuse_cells(faults)
    return values


def _decimal(cells: Cells, at: Sequence[int]) -> str:
    from toolkit.recording.csvfile import decimal_sign

    texts = [
        cell for cell in chain.from_iterable(cells.columns[place] for place in at) if isinstance(cell, str)
    ]
    try:
        # Texts of a worksheet are numbers that somebody pasted: their commas are judged as a text file's.
        decimal = decimal_sign(texts, cells.separator or ";", where=Path(cells.where))
    except RecordingError as error:
        raise _ambiguous(cells, at, ",") from error
    pointed = [text.strip() for text in texts if "." in text]
    if decimal == "." and cells.separator != "," and pointed and all(map(_GROUPED.fullmatch, pointed)):
        # Where commas separate no cells they may be decimal signs, and then points stand between thousands.
        raise _ambiguous(cells, at, ".")
    return decimal


def _ambiguous(cells: Cells, at: Sequence[int], mark: str) -> SessionError:
    row, column = next(
        (row, one)
        for one in at
        for row, cell in enumerate(cells.columns[one], start=1)
        if isinstance(cell, str) and mark in cell
    )
    return SessionError(
        f"the mark {mark!r} in the numbers may be their decimal sign or stand between thousands",
        where=cells.place(row, column),
        got=f"{cells.columns[column][row - 1]!r}, and every other number with it has three digits behind it",
        expected="numbers that can be read in one way only",
        next_step="save the file with a point as the decimal sign and nothing between thousands, and more or "
        "fewer than three decimals in one of them; nothing was written",
        rule="ambiguous-text",
    )


def _number(cells: Cells, row: int, column: int, decimal: str) -> float:
    cell = cells.columns[column][row - 1]
    if isinstance(cell, str):
        from toolkit.recording.csvfile import number_or_text

        cell = number_or_text(cell, decimal)
    if isinstance(cell, bool) or not isinstance(cell, int | float):
        raise _cell(cells, row, column, "a finite number")
    try:
        value = float(cell)
    except OverflowError:
        value = math.inf
    if not math.isfinite(value):
        raise _cell(cells, row, column, "a finite number")
    return value


def _cell(cells: Cells, row: int, column: int, expected: str) -> SessionError:
    cell: Any = cells.columns[column][row - 1]
    next_step = _CORRECT
    if is_empty(cell) and cells.merged:
        next_step = "the worksheet has merged cells, which hold one value: unmerge them and fill every row"
    elif is_empty(cell) and not cells.separator:
        next_step += "; a formula has a value only once a spreadsheet has computed and saved it"
    elif isinstance(cell, str) and _SPACED.fullmatch(cell.strip()):
        next_step = _THOUSANDS
    elif isinstance(cell, str) and "," in cell:
        next_step = _DECIMAL_COMMA if cells.separator == "," else _POINT_AND_COMMA
    elif hasattr(cell, "isoformat"):
        next_step = (
            "a spreadsheet has made a date or a time of what was typed: type the number again in a cell "
            "with the format of a number"
        )
    return SessionError(
        f"row {row}, column {cells.name(column)} holds no usable value",
        where=cells.place(row, column),
        got="an empty cell" if is_empty(cell) else repr(cell) if isinstance(cell, str) else cell,
        expected=expected,
        next_step=next_step,
        rule="cell",
    )
