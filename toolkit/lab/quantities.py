"""Columns with units: a DataFrame or a mapping, plain numbers or pint quantities, to numbers in SI.

A unit is never guessed. It stands in the header, ``D51 [mV/V]``, in ``units``, or in the values themselves:
a pint quantity, a column of them, or a column of pint-pandas, which is not needed for it.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.errors import ColumnError, UnitError
from toolkit.units import split_header, unit

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

    # Column -> its values: an array, a list, a pandas Series or a pint quantity.
    Columns = pd.DataFrame | Mapping[str, Any]


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """One column: its numbers (rows,) as they are, and their unit."""

    numbers: NDArray[np.float64]
    unit: str

    def to(self, other: str, *, where: str) -> NDArray[np.float64]:
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
    data: Columns,
    names: Iterable[str],
    *,
    units: Mapping[str, str] | None = None,
    optional: Iterable[str] = (),
) -> dict[str, Column]:
    """Return the columns of these names with their units; others are passed over.

    Parameters
    ----------
    data : columns of equal length, headers with units or without
    names : columns that must be there
    units : unit by column name, for columns whose header and values have none
    optional : columns that are returned where they are there

    Raises
    ------
    ColumnError
        a column is missing, doubled, of another length, or holds what is no number
    UnitError
        a column has no unit, or two that differ
    """
    needed, known_names = tuple(names), {*names, *optional}
    columns: dict[str, Column] = {}
    for header in map(str, data):
        name, text = split_header(header, known_names.__contains__)
        if name not in known_names:
            continue
        if name in columns:
            raise _refused(f"the column {name} stands twice", header, f"one {name}", "leave one of them out")
        stated = [text, (units or {}).get(name)]
        columns[name] = _column(name, data[header], [text for text in stated if text is not None])
    if missing := [name for name in needed if name not in columns]:
        present = ", ".join(map(str, data)) or "no column"
        raise _refused(
            f"a column is missing: {', '.join(missing)}", present, ", ".join(needed), "add it, or name it so"
        )
    lengths = {name: len(column.numbers) for name, column in columns.items()}
    if len(set(lengths.values())) > 1:
        present = ", ".join(f"{name} {length}" for name, length in lengths.items())
        raise _refused(
            "the columns differ in length", present, "one length", "give every column the same rows"
        )
    return columns


def value_of(name: str, value: Any, plain: str) -> Column:
    """Return one value as a column of one row: a pint quantity, or a number in the unit ``plain``."""
    return _column(name, value, [] if _is_quantity(value) else [plain])


def _column(name: str, values: Any, stated: list[str]) -> Column:
    magnitudes, from_values = _magnitudes(values)
    texts = [*stated, *([] if from_values is None else [from_values])]
    if not texts:
        raise UnitError(
            f"the column {name} has no unit", where=name, got="plain numbers", rule="no-unit",
            expected=f"a header such as '{name} [N]', pint quantities, or units={{'{name}': 'N'}}",
            next_step="state its unit; none is guessed",
        )  # fmt: skip
    read = [unit(text, where=name) for text in texts]
    if len({(unit_read.factor, unit_read.offset, unit_read.dimension) for unit_read in read}) > 1:
        raise UnitError(
            f"the column {name} has two units", where=name, got=" and ".join(texts), expected="one",
            next_step="leave one of them out", rule="two-units",
        )  # fmt: skip
    try:
        array = np.atleast_1d(np.asarray(magnitudes, dtype=np.float64))
    except (TypeError, ValueError) as error:
        raise _refused(
            f"the column {name} holds what is no number", error, "numbers", "correct the column"
        ) from error
    return Column(numbers=array, unit=texts[0])


def _magnitudes(values: Any) -> tuple[Any, str | None]:
    """Return plain numbers and the unit that the values themselves state, None where they state none."""
    array = getattr(values, "array", values)
    quantity = getattr(array, "quantity", array)  # a column of pint-pandas holds one quantity
    if _is_quantity(quantity):
        return quantity.magnitude, _text(quantity)
    if str(getattr(values, "dtype", "")) == "object" and len(values) and _is_quantity(next(iter(values))):
        first = next(iter(values))
        return [value.m_as(first.units) if _is_quantity(value) else value for value in values], _text(first)
    return values, None


def _is_quantity(value: Any) -> bool:
    return hasattr(value, "magnitude") and hasattr(value, "units")


def _text(quantity: Any) -> str:
    # The spelling is read by the toolkit's own registry: any registry's quantities will do.
    return re.sub(r"\s*([*/])\s*", r"\1", f"{quantity.units:~}")


def _refused(problem: str, actual: object, expected: str, next_step: str) -> ColumnError:
    return ColumnError(
        problem, where="the data's columns", got=actual, expected=expected, next_step=next_step,
        rule="data-columns",
    )  # fmt: skip
