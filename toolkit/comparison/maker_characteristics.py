"""A maker's characteristics against load, as the source document's figures 6.6 to 6.11 compare them.

    FZ [N],conicity [N],U_conicity [N],plysteer [N],secant_cornering [N/deg]

One row a load; any name of the catalogue that is compared, each with its unit, and optionally its expanded
uncertainty (k = 2) as ``U_<name>``. SAE axes that follow the travel; conicity and plysteer by symmetry.
"""

from __future__ import annotations

import csv
import difflib
import io
import math
from pathlib import Path
from typing import NoReturn

from toolkit.characteristics.catalogue import compared
from toolkit.characteristics.characteristic import BOTH
from toolkit.characteristics.model import Row
from toolkit.characteristics.uncertain import Part, Uncertain
from toolkit.errors import CellError, ColumnError, UnreadableError
from toolkit.headers import split_header
from toolkit.inputs import TABLE_FILE, read_input
from toolkit.tires.plausibility import demand_possible
from toolkit.units import unit

# The characteristics that a maker can state against load, by name, with their SI unit.
_STATED = {declared.name: declared for declared in compared() if declared.scope != "angle"}
_NAMES = {name: declared.unit for name, declared in _STATED.items()}


def is_characteristics_table(path: Path) -> bool:
    """Tell whether a CSV file's header has FZ and a characteristic, and no slip angle."""
    names = {split_header(cell, _is_name)[0] for cell in _header(_text(path))}
    # A misspelt name still tells which kind of table was meant, and the error then names the right columns.
    near = any(difflib.get_close_matches(name, _NAMES, n=1, cutoff=0.8) for name in names)
    return "SA" not in names and near


def maker_characteristics(path: Path, *, identity: str) -> tuple[Row, ...]:
    """Return a table's rows in SI.

    Raises
    ------
    UnreadableError
        no text, no rows
    ColumnError
        a column is unknown, doubled, missing, or without a unit; a load stands twice
    CellError
        a cell that is no finite number, a negative uncertainty, a value that no tire has; an empty one is a
        value that the maker does not give
    """
    text = _text(path)
    head = _header(text)
    columns = [_column(cell, path) for cell in head]
    names = [name for name, _ in columns]
    for name in names:
        if names.count(name) > 1:
            _refuse(path, "doubled-column", f"the column {name} stands twice", ", ".join(head), f"one {name}")
    for name in names:
        if name.startswith("U_") and name.removeprefix("U_") not in names:
            _refuse(
                path, "missing-column", f"{name} has no value beside it", ", ".join(head),
                f"a column {name.removeprefix('U_')}",
            )  # fmt: skip
    if "FZ" not in names:
        _refuse(path, "missing-column", "the table has no column FZ", ", ".join(head), "FZ [N]")
    rows: list[Row] = []
    loads: set[float] = set()
    for number, cells in enumerate(_lines(text)[1:], start=2):
        if not any(cell.strip() for cell in cells):
            continue
        if len(cells) != len(head):
            raise CellError(
                f"row {number} has another number of cells than the header", where=f"{path}, row {number}",
                got=len(cells), expected=len(head), next_step="mend that row; decimals take a point",
                rule="ragged-row",
            )  # fmt: skip
        values = {
            name: _number(cell, factor, f"{path}, row {number}, column {name}", needed=name == "FZ")
            for (name, factor), cell in zip(columns, cells, strict=True)
        }
        for name, value in values.items():
            if value is not None:
                demand_possible(
                    value,
                    "N" if name == "FZ" else _NAMES[name.removeprefix("U_")],
                    where=f"{path}, row {number}, column {name}",
                    U=name.startswith("U_"),
                )
        load = abs(values["FZ"] or 0.0)
        if load in loads or load <= 0:
            what = f"row {number}: the load {'stands twice' if load else 'is zero'}"
            _refuse(path, "doubled-load", what, f"{load:g} N", "each load once, above zero")
        loads.add(load)
        rows += _rows_of(values, load, identity)
    if not rows:
        raise UnreadableError(
            "the table has no data", where=path, got="a header and no values", expected="one row a load",
            next_step="add the rows", rule="no-data",
        )  # fmt: skip
    return tuple(rows)


def _rows_of(values: dict[str, float | None], load: float, identity: str) -> list[Row]:
    rows = []
    for name, si in _NAMES.items():
        value = values.get(name)
        if value is None:
            continue
        U = values.get(f"U_{name}")
        parts = (
            ()
            if not U
            else (Part(source="maker's statement", key=f"maker/{identity}/{name}/{load:.9g}", u=U / 2),)
        )
        rows.append(
            Row.of(
                name,
                Uncertain(value=value, unit=si, parts=parts),
                load_N=load,
                rotation=BOTH if _STATED[name].scope == "load" else "forward",
            )
        )
    return rows


def _text(path: Path) -> str:
    try:
        return read_input(path, TABLE_FILE).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise UnreadableError(
            "the table is not a text file in UTF-8", where=path, got=f"a wrong byte at {error.start}",
            expected="CSV in UTF-8", next_step="save it as 'CSV UTF-8'", rule="encoding",
        ) from error  # fmt: skip


def _header(text: str) -> list[str]:
    return next(iter(_lines(text)), [])


def _lines(text: str) -> list[list[str]]:
    # As tables of forces are read: a semicolon separates where decimals could take a comma.
    first = text.partition("\n")[0]
    return list(csv.reader(io.StringIO(text, newline=""), delimiter=max(",;", key=first.count)))


def _is_name(name: str) -> bool:
    return name == "FZ" or name.removeprefix("U_") in _NAMES


def _column(cell: str, path: Path) -> tuple[str, float]:
    name, text = split_header(cell, _is_name)
    bare = name.removeprefix("U_")
    if not _is_name(name):
        near = difflib.get_close_matches(bare, ["FZ", *_NAMES], n=1, cutoff=0.5)
        _refuse(
            path, "unknown-column", f"unknown column {name!r}", repr(cell),
            f"{near[0]} [unit]" if near else ", ".join(["FZ", *_NAMES]),
        )  # fmt: skip
    if text is None:
        _refuse(
            path, "unknown-unit", f"the column {name} has no unit", repr(cell), f"'{name} [unit]', e.g. [N]"
        )
    where = f"{path}, column {cell.strip()!r}"
    wanted = unit("N" if name == "FZ" else _NAMES[bare])
    stated = unit(text, where=where)
    # An angle has no dimension of its own: N and N/deg are told apart by what they are per.
    if stated.dimension != wanted.dimension or ("/" in stated.text) != ("/" in wanted.text):
        _refuse(path, "unit-dimension", f"the unit of {name} is of another kind", text, wanted.text)
    return name, stated.factor / wanted.factor


def _number(cell: str, factor: float, where: str, *, needed: bool) -> float | None:
    text = cell.strip()
    if not text and not needed:
        return None
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise CellError(
            "no number", where=where, got=repr(text) if text else "an empty cell",
            expected="a finite number with a decimal point", next_step="mend that cell",
            rule="text-cell" if text else "empty-cell",
        )  # fmt: skip
    return value * factor


def _refuse(path: Path, rule: str, what: str, got: str, expected: str) -> NoReturn:
    raise ColumnError(what, where=path, got=got, expected=expected, next_step="mend the table", rule=rule)
