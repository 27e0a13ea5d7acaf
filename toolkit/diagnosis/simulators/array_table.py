"""Inputs as plain columns: what a simulator reads of a table, without the price of a DataFrame.

A simulator of a few hundred rows is called many thousand times, and nearly all its time goes into pandas'
bookkeeping: a sum of two columns takes fifty times as long as that of two arrays. Most simulators ask a table
for nothing but its columns; these get them as arrays. Whether the outputs are the same is tried on the first
call of every run, and again on ever fewer of the later ones; a simulator that asks for more of a table (a
shifted column, a position by label), or to which arrays mean something else, gets a DataFrame as ever.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from toolkit.arrays import Array, Arrays


_SAME = 1e-12  # relative: what another order of the same additions leaves


class ArrayColumn(np.ndarray):
    """One column; it gives its numbers by the names by which a Series gives them."""

    @property
    def values(self) -> Array:
        """The numbers."""
        return np.array(self)

    def to_numpy(self) -> Array:
        """Return the numbers."""
        return np.array(self)


class ArrayTable:
    """Columns of one length by their names."""

    def __init__(self, columns: Arrays) -> None:
        self._columns = {name: column.view(ArrayColumn) for name, column in columns.items()}
        self._rows = len(next(iter(columns.values()), ()))

    def __getitem__(self, name: str) -> ArrayColumn:
        return self._columns[name]

    def __getattr__(self, name: str) -> ArrayColumn:
        columns = self.__dict__.get("_columns", {})
        if name not in columns:
            raise AttributeError(name)
        return columns[name]  # type: ignore[no-any-return]

    def __contains__(self, name: object) -> bool:
        return name in self._columns

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return self._rows

    @property
    def columns(self) -> list[str]:
        """Names of the columns."""
        return list(self._columns)

    @property
    def index(self) -> Any:
        """Labels of the rows."""
        import pandas as pd

        return pd.RangeIndex(self._rows)


class Trials:
    """Whether arrays may stand for a DataFrame: until a call shows that they may not."""

    def __init__(self) -> None:
        self.same = True
        self._calls: dict[object, int] = {}

    def due(self, run: object) -> bool:
        """Tell whether this call of a run is made in both ways: its first, second, fourth, eighth ..."""
        count = self._calls[run] = self._calls.get(run, 0) + 1
        return count & (count - 1) == 0

    def judge(self, of_arrays: Mapping[str, Array] | None, of_table: Arrays) -> None:
        """Note whether both ways gave the same; None where arrays were not taken."""
        self.same = self.same and of_arrays is not None and all(
            np.allclose(of_arrays[name], column, rtol=_SAME, atol=0) for name, column in of_table.items()
        )  # fmt: skip
