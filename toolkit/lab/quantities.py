"""Columns with units: a DataFrame or a mapping, plain numbers or pint quantities, to numbers in SI.

A unit is never guessed. It stands in the header, ``D51 [mV/V]``, in ``units``, or in the values themselves:
a pint quantity, a column of them, or a column of pint-pandas, which is not needed for it.
"""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from decimal import Decimal
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.arrays import Array
from toolkit.errors import ColumnError, UnitError
from toolkit.units import split_header, unit

if TYPE_CHECKING:
    import pandas as pd

    from toolkit.tires.table import TireTable

    # Column -> its values: an array, a list, a pandas Series or a pint quantity.
    Columns = pd.DataFrame | Mapping[str, Any]

Stated = defaultdict[str, list[str]]
"""Units beside the data, by the name of the column."""


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """One column: its numbers (rows,) as they are, and their unit."""

    numbers: Array
    unit: str

    def to(self, other: str, *, where: str) -> Array:
        """Return the values in another unit of the same dimension; the very numbers where it is the same.

        Raises
        ------
        UnitError
            a unit is unknown, or of another dimension
        """
        source, target = unit(self.unit, where=where), unit(other, where=where)
        if source.dimension != target.dimension:
            raise UnitError(
                f"the unit of {where} is of another dimension", where=where,
                got=f"{self.unit} ({source.dimension})", expected=f"{other} ({target.dimension})",
                next_step="correct the unit of the column", rule="unit-dimension",
            )  # fmt: skip
        if (source.factor, source.offset) == (target.factor, target.offset):
            return self.numbers
        return (self.numbers * source.factor + source.offset - target.offset) / target.factor


def columns_of(
    data: Columns, wanted: Mapping[str, str], *, units: Mapping[str, str] | None = None
) -> dict[str, Column]:
    """Return the columns of these names with their units; others are passed over.

    Parameters
    ----------
    data : columns of equal length, headers with units or without
    wanted : columns that must be there, each with a unit of its dimension
    units : unit by column name, for columns whose header and values have none

    Raises
    ------
    ColumnError
        the data are no table; a column is missing, doubled, of another length or with other names of its
        rows, or holds what is no finite number; ``units`` name a column that is not there
    UnitError
        a column has no unit, or two that differ
    """
    table = _headers(data, wanted.__contains__)
    stated = _stated(units, table)
    columns = {
        name: _column(name, data[header], [*_listed(text), *stated[name]], wanted[name])
        for name, (header, text) in table.items()
        if name in wanted
    }
    if missing := [name for name in wanted if name not in columns]:
        present = ", ".join(header for header, _ in table.values()) or "no column"
        raise _refused(
            f"a column is missing: {', '.join(missing)}", present, ", ".join(wanted), "add it, or name it so"
        )
    _demand_alike({name: data[table[name][0]] for name in columns}, columns)
    return columns


def tire_table(
    data: Columns, *, units: Mapping[str, str] | None = None, axes: str = "SAE", measured: bool = True
) -> TireTable:
    """Return columns of tire data as `toolkit.tires.table.read_table` returns a file, with all its checks.

    Raises
    ------
    ToolkitError
        as `columns_of`, and as ``read_table``
    """
    from toolkit.channels import channel_of
    from toolkit.tires.table import MARKS, example_unit, table_of

    table = _headers(data, lambda name: channel_of(name) is not None)
    stated = _stated(units, table)
    marks = next((header for header, _ in table.values() if header.lower() == MARKS), None)
    texts = () if marks is None else tuple(value.strip() for value in data[marks] if isinstance(value, str))
    header, columns = [], {}
    for name, (text, unit_text) in table.items():
        if text == marks:
            continue
        if channel_of(name) is None:
            header.append(text)
            continue
        column = _column(name, data[text], [*_listed(unit_text), *stated[name]], example_unit(name))
        header.append(f"{name} [{column.unit}]")
        columns[name] = column
    _demand_alike({name: data[table[name][0]] for name in columns}, columns)
    return table_of(
        header, [column.numbers for column in columns.values()], path=Path(_DATA), axes=axes,
        measured=measured, marks=tuple(dict.fromkeys(filter(None, texts))),
    )  # fmt: skip


def tare_of(tare: Mapping[str, Any], columns: Mapping[str, Column]) -> dict[str, Column]:
    """Return the value of every indication without load: a pint quantity, or a number in its column's unit.

    Raises
    ------
    ColumnError
        an indication is missing, a name is of none, a value is not one finite number
    """
    if not isinstance(tare, Mapping):
        raise _refused(
            "the tare is no mapping", type(tare).__name__, "a value by the name of each indication",
            f"state it as {{{', '.join(map(repr, columns))}: ...}}", where="tare",
        )  # fmt: skip
    if set(tare) != set(columns):
        raise _refused(
            "the tare is not of the record's indications", ", ".join(map(str, tare)) or "nothing",
            ", ".join(columns), "state one value of each, under its own name", where="tare",
        )  # fmt: skip
    values = {
        name: _column(name, tare[name], [] if _is_quantity(tare[name]) else [columns[name].unit], "mV/V")
        for name in columns
    }
    for name, value in values.items():
        if len(value.numbers) != 1:
            raise _refused(
                f"the tare of {name} is no single value", f"{len(value.numbers)} values", "one number",
                "give the mean of the unloaded rows", where=f"tare, {name}",
            )  # fmt: skip
    return values


_DATA = "the data"


def _headers(data: Columns, is_name: Callable[[str], bool]) -> dict[str, tuple[str, str | None]]:
    """Return header and unit as written of every column by its name."""
    names = getattr(data, "columns", None)
    if names is None and isinstance(data, Mapping):
        names = list(data)
    if names is None or not hasattr(data, "__getitem__"):
        raise _refused(
            "the data are no table", type(data).__name__, "a DataFrame, or a mapping of columns",
            "give the columns by their names, such as {'SA [deg]': [0.0, 2.0], ...}",
        )  # fmt: skip
    table: dict[str, tuple[str, str | None]] = {}
    for header in names:
        if not isinstance(header, str):
            raise _refused(
                "the header of a column is no text", repr(header), "a name such as 'FZ [N]'",
                "name the columns by texts",
            )  # fmt: skip
        name, text = split_header(header, is_name)
        if name in table:
            raise _refused(f"the column {name} stands twice", header, f"one {name}", "leave one of them out")
        table[name] = (header, text)
    return table


def _stated(units: Mapping[str, str] | None, table: Mapping[str, tuple[str, str | None]]) -> Stated:
    """Return the units beside the data, by the name of the column; a key may be its whole header."""
    if units is None:
        return defaultdict(list)
    if not isinstance(units, Mapping):
        raise _refused(
            "the units are no mapping", type(units).__name__, "a unit by the name of each column",
            "write units={'FZ': 'N', ...}", where="units",
        )  # fmt: skip
    names = {header: name for name, (header, _) in table.items()} | {name: name for name in table}
    stated: Stated = defaultdict(list)
    for key, text in units.items():
        if key not in names or not isinstance(text, str):
            raise _refused(
                "the units are not of the data's columns", f"{key!r}: {text!r}",
                f"a text such as 'N' by one of {', '.join(table)}",
                "name a column of the data, or leave it out", where="units",
            )  # fmt: skip
        stated[names[key]].append(text)
    return stated


def _listed(text: str | None) -> list[str]:
    return [] if text is None else [text]


def _demand_alike(values: Mapping[str, Any], columns: Mapping[str, Column]) -> None:
    """Refuse columns of several lengths, and pandas Series whose rows have several names or orders."""
    lengths = {name: len(column.numbers) for name, column in columns.items()}
    if len(set(lengths.values())) > 1:
        present = ", ".join(f"{name} {length}" for name, length in lengths.items())
        raise _refused(
            "the columns differ in length", present, "one length", "give every column the same rows"
        )
    indices = {name: index for name, value in values.items() if (index := _index(value)) is not None}
    first = next(iter(indices.values()), None)
    for name, index in indices.items():
        if not index.equals(first):
            raise _refused(
                "the columns differ in the names of their rows", f"{name}: {_shown(index)}",
                f"{next(iter(indices))}: {_shown(first)}",
                "make one DataFrame of them, or drop the index with .to_numpy()",
            )  # fmt: skip


def _index(values: Any) -> Any:
    index = getattr(values, "index", None)  # a list has a method of that name
    return index if hasattr(index, "equals") else None


def _shown(index: Any) -> str:
    shown = ", ".join(map(str, index[:5]))
    return f"{shown}, ..." if len(index) > 5 else shown


def _column(name: str, values: Any, stated: list[str], example: str) -> Column:
    magnitudes, from_values = _magnitudes(name, values)
    texts = [*stated, *_listed(from_values)]
    if not texts:
        raise UnitError(
            f"the column {name} has no unit", where=name, got="plain numbers", rule="no-unit",
            expected=f"a header such as '{name} [{example}]', pint quantities, or "
            f"units={{'{name}': '{example}'}}",
            next_step="state its unit; none is guessed",
        )  # fmt: skip
    read = [unit(text, where=name) for text in texts]
    if len({(unit_read.factor, unit_read.offset, unit_read.dimension) for unit_read in read}) > 1:
        raise UnitError(
            f"the column {name} has two units", where=name, got=" and ".join(texts), expected="one",
            next_step="leave one of them out", rule="two-units",
        )  # fmt: skip
    return Column(numbers=_numbers(name, magnitudes, _index(values)), unit=texts[0])


def _numbers(name: str, values: Any, index: Any) -> Array:
    """Return values as numbers (rows,), each real, finite and unmasked; refuse the first row that is not."""
    try:
        array = np.asarray(values)
    except (TypeError, ValueError) as error:
        raise _no_numbers(name, error) from error
    if array.ndim > 1:
        raise _no_numbers(name, f"an array of {array.ndim} dimensions")
    if array.dtype.kind not in "fiuO":
        raise _no_numbers(name, f"values of type {array.dtype}")
    rows = np.atleast_1d(array)
    masked = np.atleast_1d(np.ma.getmaskarray(values)) if isinstance(values, np.ma.MaskedArray) else None
    if array.dtype.kind == "O":
        wrong = np.array([not _is_real(value) for value in rows], dtype=bool)
    else:
        wrong = ~np.isfinite(rows)
    if masked is not None:
        wrong |= masked
    if wrong.any():
        row = int(np.flatnonzero(wrong)[0])
        label = "" if index is None else f" ({index[row]})"
        actual = "a masked value" if masked is not None and masked[row] else repr(rows[row])
        more = f", and {int(wrong.sum()) - 1} more rows" if wrong.sum() > 1 else ""
        raise _no_numbers(name, actual + more, where=f"{_DATA}, row {row + 1}{label}, column {name!r}")
    return rows.astype(np.float64)


def _is_real(value: Any) -> bool:
    real = isinstance(value, (Real, Decimal)) and not isinstance(value, (bool, np.bool_))
    return real and math.isfinite(value)


def _no_numbers(name: str, actual: object, where: str = "") -> ColumnError:
    return _refused(
        f"the column {name} holds what is no number", actual, "finite numbers, one a row",
        "remove or mend those rows, or give the column as numbers",
        where=where or f"{_DATA}, column {name!r}",
    )  # fmt: skip


def _magnitudes(name: str, values: Any) -> tuple[Any, str | None]:
    """Return plain numbers and the unit that the values themselves state, None where they state none."""
    array = getattr(values, "array", values)
    quantity = getattr(array, "quantity", array)  # a column of pint-pandas holds one quantity
    if _is_quantity(quantity):
        return quantity.magnitude, _text(quantity)
    if not isinstance(values, list | tuple) and str(getattr(values, "dtype", "")) != "object":
        return values, None
    if not any(_is_quantity(value) for value in values):
        return values, None
    first: Any = next(iter(values))
    try:
        return [value.m_as(first.units) for value in values], _text(first)
    except (TypeError, ValueError, AttributeError) as error:
        raise _no_numbers(name, error) from error


def _is_quantity(value: Any) -> bool:
    return hasattr(value, "magnitude") and hasattr(value, "units")


def _text(quantity: Any) -> str:
    # The spelling is read by the toolkit's own registry: any registry's quantities will do.
    return re.sub(r"\s*([*/])\s*", r"\1", f"{quantity.units:~}")


def _refused(
    problem: str, actual: object, expected: str, next_step: str, *, where: str = "the data's columns"
) -> ColumnError:
    return ColumnError(
        problem, where=where, got=actual, expected=expected, next_step=next_step, rule="data-columns"
    )
