"""TABLE.csv: measured forces and moments of a tire, one row a sample, units in the header.

    SA [deg],FZ [N],FY [N],MZ [N*m]        optional: IA [deg], P [kPa], V [km/h], FX [N], KAPPA [1], t [s]

Where semicolons or tabs stand between the cells, numbers may have decimal commas; the text may be in UTF-8,
UTF-16 or Windows-1252, as a recording may (`toolkit.recording.csvfile`). A column is called by its
channel's symbol, name or alias, in any case. FZ may have either sign, one in all rows, and is the load. The
axis system is declared, never guessed. A column of text, named `calibration` and without a unit, may say how
the record stands that the numbers rest on: `convert` writes it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import compress
from pathlib import Path
from typing import NoReturn, get_args

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.channels import AXES, CHANNELS, Axes, channel_of
from toolkit.declared import nearest
from toolkit.errors import CellError, ColumnError, UnreadableError, refuse_unknown
from toolkit.findings import Finding
from toolkit.inputs import TABLE_FILE, read_input
from toolkit.recording.csvfile import Line, pointed, read_lines
from toolkit.recording.table import shown
from toolkit.tires.plausibility import LARGEST, load_of
from toolkit.units import split_header, unit

MARKS = "calibration"
_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,4})?")
_AXES: dict[str, Axes] = {axes: axes for axes in get_args(Axes)}
_EDGE = 1 + 1e-9
_SHAPE = "a header such as 'SA [deg],FZ [N],FY [N],MZ [N*m]' and rows of numbers"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TireTable:
    """A table in SI: ``columns`` by symbol (rows,), in the declared ``axes``; FZ is the positive load.

    ``header`` and ``cells`` are the same as written, so that a grid comes back with its own digits. ``marks``
    are the texts of its column `calibration`, each once.
    """

    path: Path
    axes: Axes
    columns: tuple[tuple[str, Array], ...]
    header: tuple[str, ...] = ()
    cells: tuple[tuple[str, ...], ...] = ()
    marks: tuple[str, ...] = ()

    @property
    def mark_findings(self) -> tuple[Finding, ...]:
        """What the table says of the record that its numbers rest on."""
        return tuple(
            Finding(
                rule="known-since" if mark.startswith("KNOWN SINCE") else "unverified",
                where=self.path.name,
                message=mark,
            )
            for mark in self.marks
        )

    def take(self, rows: NDArray[np.bool_]) -> TireTable:
        """Return some of the rows, by a mask."""
        columns = tuple((symbol, column[rows]) for symbol, column in self.columns)
        return replace(self, columns=columns, cells=tuple(compress(self.cells, rows)))

    def get(self, symbol: str) -> Array | None:
        """Return a column [SI], None where the table has none."""
        return dict(self.columns).get(symbol)

    def __getitem__(self, symbol: str) -> Array:
        """Return a column [SI]."""
        return dict(self.columns)[symbol]


def read_table(
    path: Path, *, axes: str = "SAE", required: tuple[str, ...] = ("SA", "FZ"), measured: bool = True
) -> TireTable:
    """Read a table; all of it or nothing.

    Parameters
    ----------
    axes : the axis system that the table is in
    required : columns that it must have
    measured : one of FY and MZ too; False for a grid, which has only slips and loads

    Raises
    ------
    ConfigError
        the axis system is unknown
    UnreadableError
        no text, no rows
    ColumnError
        a column is unknown, doubled, missing, or without a unit
    UnitError
        a unit is unknown or of another dimension
    CellError
        text, an empty cell, NaN or infinity in a number's place, a value that no tire can have, loads of
        both signs
    """
    refuse_unknown("axis system", axes, AXES, where="--axes", rule="unknown-axes")
    lines, marks = _without_marks(_cells(path))
    row, header = lines[0]
    _demand_columns(header, path, required=required, measured=measured)
    if len(lines) == 1:
        raise UnreadableError(
            "the table has no data", where=path, got=f"a header in row {row} and nothing below it",
            expected=_SHAPE, next_step="add the rows", rule="no-data",
        )  # fmt: skip
    values = np.array([_numbers(cells, header, path, row) for row, cells in lines[1:]], dtype=np.float64).T
    return table_of(
        header, list(values), path=path, axes=axes, required=required, measured=measured, marks=marks,
        rows=[number for number, _ in lines[1:]],
        cells=tuple(tuple(cell.strip() for cell in cells) for _, cells in lines[1:]),
    )  # fmt: skip


def table_of(
    header: Sequence[str],
    values: Sequence[Array],
    *,
    path: Path,
    axes: str,
    required: tuple[str, ...] = ("SA", "FZ"),
    measured: bool,
    marks: tuple[str, ...] = (),
    rows: Sequence[int] | None = None,
    cells: tuple[tuple[str, ...], ...] = (),
) -> TireTable:
    """Return the table of columns in the units of their headers: the end of `read_table`, and its checks.

    Parameters
    ----------
    values : columns (rows,) of finite numbers, as many as headers
    path : what messages call the table by
    rows : the number of every row in messages; default from 1 on

    Raises
    ------
    ToolkitError
        as `read_table`, but for what a file's cells may hold
    """
    refuse_unknown("axis system", axes, AXES, where="--axes", rule="unknown-axes")
    names = _demand_columns(header, path, required=required, measured=measured)
    numbered = list(rows) if rows is not None else list(range(1, len(values[0]) + 1))
    if not numbered:
        raise UnreadableError(
            "the table has no data", where=path, got="columns without a row", expected=_SHAPE,
            next_step="add the rows", rule="no-data",
        )  # fmt: skip
    columns = []
    for (symbol, factor, offset), cell, column in zip(names, header, values, strict=True):
        with np.errstate(over="ignore"):
            si = column * factor + offset
        _refuse_impossible(symbol, cell.strip(), column, si, (factor, offset), path, numbered)
        where = f"{path}, column {cell.strip()!r}"
        columns.append((symbol, load_of(si, where=where, rows=numbered) if symbol == "FZ" else si))
    return TireTable(
        path=path,
        axes=_AXES[axes],
        columns=tuple(columns),
        header=tuple(cell.strip() for cell in header),
        cells=cells,
        marks=marks,
    )


def _demand_columns(
    header: Sequence[str], path: Path, *, required: tuple[str, ...], measured: bool
) -> list[tuple[str, float, float]]:
    """Return symbol, factor and offset to SI of every column."""
    names = [_symbol(cell, path) for cell in header]
    symbols = [name for name, _, _ in names]
    listed = ", ".join(header)
    for symbol in symbols:
        if symbols.count(symbol) > 1:
            _refuse(path, "doubled-column", f"the column {symbol} stands twice", listed, f"one {symbol}")
    for symbol in required:
        if symbol not in symbols:
            _refuse(path, "missing-column", f"the table has no column {symbol}", listed, f"{symbol} [unit]")
    if measured and not {"FY", "MZ"} & set(symbols):
        _refuse(path, "missing-column", "the table has neither FY nor MZ", listed, "FY [N] or MZ [N*m]")
    return names


def example_unit(name: str) -> str:
    """Return a unit that a column of this channel may have, for a message.

    >>> example_unit("SA"), example_unit("KAPPA"), example_unit("FZ")
    ('deg', '%', 'N')
    """
    channel = channel_of(name)
    if channel is None:
        return "unit"
    return {"rad": "deg", "1": "%", "Pa": "kPa"}.get(channel.si, channel.si)


def _without_marks(lines: list[Line]) -> tuple[list[Line], tuple[str, ...]]:
    # The lines without the column of marks, and its texts.
    header = lines[0][1]
    at = [i for i, cell in enumerate(header) if cell.strip().lower() == MARKS]
    if len(at) != 1:
        return lines, ()
    unmarked = [(row, cells[: at[0]] + cells[at[0] + 1 :]) for row, cells in lines]
    texts = [cells[at[0]].strip() for _, cells in lines[1:] if len(cells) > at[0]]
    return unmarked, tuple(dict.fromkeys(mark for mark in texts if mark))


def _cells(path: Path) -> list[Line]:
    lines, separator = read_lines(read_input(path, TABLE_FILE), _is_channel, where=path)
    if not lines:
        raise UnreadableError(
            "the table is empty", where=path, got="no text", expected=_SHAPE, next_step="check the path",
            rule="no-data",
        )  # fmt: skip
    return [lines[0], *pointed(lines[1:], separator, where=path)]


def _is_channel(header: str) -> bool:
    return channel_of(split_header(header, lambda name: channel_of(name) is not None)[0]) is not None


def _symbol(cell: str, path: Path) -> tuple[str, float, float]:
    # "SA [deg]" -> symbol, factor and offset to SI.
    name, text = split_header(cell, lambda name: channel_of(name) is not None)
    channel = channel_of(name)
    if channel is None:
        known = "SA FZ FY MZ, optional IA P V FX KAPPA t"
        near = nearest(name, [*CHANNELS])
        _refuse(
            path, "unknown-column", f"unknown column {name!r}", repr(cell),
            f"{near} [unit]; known are {known}" if near else known,
            "mend the header row; of a machine's recording --machine names the definition that knows it",
        )  # fmt: skip
    if text is None:
        _refuse(
            path,
            "unknown-unit",
            f"the column {name} has no unit",
            repr(cell),
            f"'{name} [unit]', e.g. [{example_unit(name)}]",
        )
    where = f"{path}, column {cell.strip()!r}"
    stated = unit(text, where=where)
    if stated.dimension != channel.dimension:
        from toolkit.units import si_scale

        si_scale(text, channel.dimension, where=where)
    return channel.symbol, stated.factor, stated.offset


def _numbers(cells: list[str], header: list[str], path: Path, row: int) -> list[float]:
    if len(cells) != len(header):
        raise CellError(
            f"row {row} has another number of cells than the header", where=f"{path}, row {row}",
            got=len(cells), expected=len(header), next_step="mend that row; decimals take a point",
            rule="ragged-row",
        )  # fmt: skip
    numbers = []
    for name, cell in zip(header, cells, strict=True):
        text = cell.strip()
        number = float(text) if _NUMBER.fullmatch(text) else math.nan
        if not math.isfinite(number):
            raise CellError(
                f"row {row}, column {name.strip()!r}: no number",
                where=f"{path}, row {row}, column {name.strip()!r}",
                got=shown(text) if text else "an empty cell",
                expected="a finite number, with the decimal sign of the others",
                next_step="remove or mend that row",
                rule="text-cell" if text else "empty-cell",
            )
        numbers.append(number)
    return numbers


def _refuse_impossible(
    symbol: str, cell: str, column: Array, si: Array, scale: tuple[float, float], path: Path, rows: list[int]
) -> None:
    limit = LARGEST.get(symbol, LARGEST[CHANNELS[symbol].dimension])
    lowest = 0.0 if CHANNELS[symbol].dimension == "temperature" else -limit
    bad = np.flatnonzero(~((si >= lowest * _EDGE) & (si <= limit * _EDGE)))
    if not len(bad):
        return
    row, (factor, offset) = rows[bad[0]], scale
    low, high = (lowest - offset) / factor, (limit - offset) / factor
    raise CellError(
        f"row {row}, column {cell!r}: no tire has such a value",
        where=f"{path}, row {row}, column {cell!r}",
        got=f"{column[bad[0]]:.6g}" + (f", and {len(bad) - 1} more rows" if len(bad) > 1 else ""),
        expected=f"a value from {low:.6g} to {high:.6g} in the unit of the header",
        next_step="check the unit in the header, remove or mend that row",
        rule="impossible-value",
    )


def _refuse(
    path: Path,
    rule: str,
    problem: str,
    actual: str,
    expected: str,
    next_step: str = "mend the header row of the table",
) -> NoReturn:
    raise ColumnError(problem, where=path, got=actual, expected=expected, next_step=next_step, rule=rule)
