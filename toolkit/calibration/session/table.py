"""Reference-load data: a CSV with units in its header, whole or not at all.

The same light reader serves a session and the load-time refit of a record, so that what is checked is
what was fitted; it needs numpy alone.
"""

from __future__ import annotations

import csv
import dataclasses
import difflib
import io
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from toolkit.calibration.session.separators import HOW_TO_SAVE, has_decimal_comma, separator_seen
from toolkit.errors import SessionError, ToolkitError
from toolkit.units import si_scale, unit

if TYPE_CHECKING:
    from numpy.typing import NDArray

_HEADER = re.compile(r"(?P<name>[^\[\]]+?)\s*(?:\[(?P<unit>[^\[\]]*)\])?\s*\Z")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Table:
    """A read file: ``names`` and ``units`` of the numeric columns, ``values`` (rows, columns) as written.

    ``run`` (rows,), ``up`` (rows,), True where the load was increased, and ``rotation`` [deg] are None where
    the file has no such column; ``labels`` are columns of names (name, a text a row), see `known_errors`.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    values: NDArray[np.float64]
    run: NDArray[np.float64] | None
    up: NDArray[np.bool_] | None
    rotation: NDArray[np.float64] | None
    labels: tuple[tuple[str, tuple[str, ...]], ...] = ()

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(self.values)

    @property
    def direction(self) -> tuple[str, ...] | None:
        """The column ``direction`` in words."""
        return None if self.up is None else tuple("up" if one else "down" for one in self.up.tolist())

    def has(self, name: str) -> bool:
        """Tell whether the file has a numeric column."""
        return name in self.names

    def column(self, name: str) -> NDArray[np.float64]:
        """Return a column (rows,) in the unit of the file."""
        return self.values[:, self.names.index(name)]

    def unit(self, name: str) -> str:
        """Return a column's unit."""
        return self.units[self.names.index(name)]

    def columns(self, names: Sequence[str]) -> dict[str, NDArray[np.float64]]:
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

    def matrix(self, names: Sequence[str]) -> NDArray[np.float64]:
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
    runs: bool = True,
) -> Table:
    """Read reference-load data.

    Parameters
    ----------
    data : the file's content
    where : the file, for messages
    required, optional : names of the numeric columns; each needs a unit in the header
    labels : names of columns that may hold names, without a unit; with one they are numeric
    runs : whether ``run`` and ``direction`` are required (and ``rotation`` allowed), or not allowed

    Raises
    ------
    SessionError
        a column is missing, doubled, unknown or without unit; a cell is no finite number; no rows
    UnitError
        a unit is unknown
    """
    plain = _plain_columns(data)
    rows = [] if plain is not None else _rows(data, where)
    header = rows[0] if plain is None else plain[0]
    head = _head(_Wanted(tuple(header), tuple(required), tuple(optional), tuple(labels), runs), where)
    columns = _turned(rows[1:], len(header), where) if plain is None else plain[1]
    if not columns[0]:
        raise _error(where, "the file has no rows", "0 rows", "one row a reference load", "no-data")
    cells = dict(zip(head.names, columns, strict=True))
    up = None
    if "direction" in cells:
        direction = cells["direction"]
        if not set(direction) <= {"up", "down"}:
            direction = tuple(cell.strip().lower() for cell in direction)
            for number, cell in enumerate(direction, start=1):
                if cell not in ("up", "down"):
                    raise _cell(where, number, "direction", cell, "up or down")
        up = np.array([cell == "up" for cell in direction])
    more = [name for name in ("run", "rotation") if name in cells]
    found = _numbers({name: cells[name] for name in (*head.numeric, *more)}, where)
    values, told = found[: len(head.numeric)].T, dict(zip(more, found[len(head.numeric) :], strict=True))
    run = told.get("run")
    if run is not None and (fraction := np.flatnonzero(run != np.floor(run))).size:
        at = int(fraction[0])
        raise _cell(where, at + 1, "run", cells["run"][at], "a whole number")
    return Table(
        names=head.numeric,
        units=head.units,
        values=values,
        run=run,
        up=up,
        rotation=told.get("rotation"),
        labels=tuple((name, _texts(cells[name], name, where)) for name in head.labels),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Head:
    """``names`` of all columns, ``numeric`` and ``units`` of those that are loads, cells, uncertainties."""

    names: tuple[str, ...]
    numeric: tuple[str, ...]
    units: tuple[str, ...]
    labels: tuple[str, ...]


class _Wanted(NamedTuple):
    """A header's cells, and what `read_table` was asked for."""

    header: tuple[str, ...]
    required: tuple[str, ...]
    optional: tuple[str, ...]
    labels: tuple[str, ...]
    runs: bool


def _head(wanted: _Wanted, where: object) -> _Head:
    try:
        return _known_head(wanted)
    except ToolkitError:
        # Said again with the file's name.
        return _read_head(wanted, where)


@lru_cache(maxsize=256)
def _known_head(wanted: _Wanted) -> _Head:
    # The files of a history have one header.
    return _read_head(wanted, "")


def _read_head(wanted: _Wanted, where: object) -> _Head:
    header, required, optional, labels, runs = wanted
    parsed = [_HEADER.match(cell.strip()) for cell in header]
    names = [
        match["name"].strip() if match else cell.strip() for match, cell in zip(parsed, header, strict=True)
    ]
    extra = ("run", "direction", "rotation") if runs else ()
    _check_header(names, list(header), [*required, *(extra[:2])], [*optional, *labels, *extra], where)
    numeric, units, texts = [], [], []
    for name, cell, match in zip(names, header, parsed, strict=True):
        if name in ("run", "direction", "rotation"):
            continue
        if match is None or match["unit"] is None:
            if name in labels and name not in required:
                texts.append(name)
                continue
            raise _error(
                f"{where}, column {name}", f"column {name} has no unit",
                cell, f"a header such as '{name} [N]' or '{name} [mV/V]'", "no-unit",
            )  # fmt: skip
        numeric.append(name)
        units.append(unit(match["unit"].strip(), where=f"{where}, column {name}").text)
    return _Head(names=tuple(names), numeric=tuple(numeric), units=tuple(units), labels=tuple(texts))


def _texts(cells: Sequence[str], name: str, where: object) -> tuple[str, ...]:
    texts = tuple(cell.strip() for cell in cells)
    if not all(texts):
        raise _cell(where, texts.index("") + 1, name, "", "a name in every row")
    return texts


def _turned(rows: list[list[str]], width: int, where: object) -> list[Sequence[str]]:
    """Return rows as columns."""
    for number, row in enumerate(rows, start=1):
        if len(row) != width:
            raise _error(
                f"{where}, row {number} (line {number + 1})",
                "a row has another number of cells than the header",
                f"{len(row)} cells: {', '.join(row)}", f"{width} cells", "columns",
                "correct the file (a number with a decimal comma makes two cells: "
                f"{HOW_TO_SAVE})" if len(row) > width else "correct the file; nothing was written",
            )  # fmt: skip
    return [[row[at] for row in rows] for at in range(width)]


def _plain_columns(data: bytes) -> tuple[list[str], list[Sequence[str]]] | None:
    """Return the header and the columns that `csv` reads, without it.

    None where there are quotes, blank rows, rows of another length, or bytes that are no text.
    """
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return None
    if '"' in text or "\r" in text or "\0" in text:
        return None
    lines = text.removesuffix("\n").split("\n")
    commas = lines[0].count(",")
    if not commas or {line.count(",") for line in lines} != {commas}:
        return None
    cells = ",".join(lines).split(",")
    width = commas + 1
    # A row of empty cells is no row, and begins with one.
    if not all(map(str.strip, cells[::width])):
        return None
    return cells[:width], [cells[width + at :: width] for at in range(width)]


def _rows(data: bytes, where: object) -> list[list[str]]:
    try:
        text = data.decode("utf-8-sig")
        read = csv.reader(io.StringIO(text, newline=""), strict=True)
        rows = [row for row in read if "".join(row).strip()]
    except (ValueError, csv.Error) as error:
        raise _error(
            where, "the file is no CSV text", str(error), "comma-separated UTF-8 text", "no-csv"
        ) from error
    if not rows:
        raise _error(where, "the file is empty", "no header", "a header with units, then rows", "no-data")
    return rows


def _check_header(
    names: list[str], header: list[str], required: list[str], optional: list[str], where: object
) -> None:
    seen = separator_seen(header)
    if seen is not None and not set(required) <= set(names):
        raise _error(
            where, f"the file's cells are separated by {seen}", ", ".join(header),
            "commas between the cells, a point in the numbers", "columns", HOW_TO_SAVE,
        )  # fmt: skip
    for name in names:
        if names.count(name) > 1:
            raise _error(
                where, f"column {name} stands twice", ", ".join(header), f"one column {name}", "columns"
            )
    for name in required:
        if name not in names:
            raise _error(
                where, f"column {name} is missing", ", ".join(header), ", ".join(required), "columns"
            )
    known = [*required, *optional]
    for name in names:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1, cutoff=0.4)
            hint = f"did you mean {near[0]!r}? " if near else ""
            raise _error(
                where, f"unknown column {name!r}", name, ", ".join(dict.fromkeys(known)), "columns",
                hint + "name it in indications or loads of the session, or remove it",
            )  # fmt: skip


def _numbers(columns: Mapping[str, Sequence[str]], where: object) -> NDArray[np.float64]:
    """Return the columns' numbers (columns, rows)."""
    try:
        values = np.array([list(map(float, cells)) for cells in columns.values()])
        # float() reads 1_0 as ten; in a table an underscore is a slip.
        if np.isfinite(values).all() and not any("_" in "".join(cells) for cells in columns.values()):
            return values
    except ValueError:
        pass
    return np.array(
        [
            [_number(cell, at, name, where) for at, cell in enumerate(cells, start=1)]
            for name, cells in columns.items()
        ]
    )


def _number(cell: str, at: int, name: str, where: object) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or "_" in cell:
        raise _cell(where, at, name, cell, "a finite number")
    return value


def _cell(where: object, row: int, name: str, got: str, expected: str) -> SessionError:
    return SessionError(
        f"row {row}, column {name} holds no usable value",
        where=f"{where}, row {row} (line {row + 1}), column {name}",
        got=repr(got),
        expected=expected,
        next_step=f"the number has a decimal comma: {HOW_TO_SAVE}"
        if has_decimal_comma(got)
        else "correct the cell, or remove the whole row with a reason in the laboratory's notes",
        rule="cell",
    )


def _error(
    where: object,
    what: str,
    got: object,
    expected: object,
    rule: str,
    next_step: str = "correct the file; nothing was written",
) -> SessionError:
    return SessionError(what, where=where, got=got, expected=expected, next_step=next_step, rule=rule)
