"""Named vectors, as files of channels hold them, to checked columns of numbers; what their files are refused
for.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.errors import CellError, ColumnError, RecordingError, UnitError, UnreadableError
from toolkit.machine import Machine
from toolkit.recording.columns import assign_columns, header_of
from toolkit.recording.model import Series
from toolkit.units import split_header, unit

_AGAIN = "copy the file again from the machine; it was cut off or damaged on its way"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Vector:
    """One channel of a file: its name, the unit that the file states beside it (None: none), its values.

    ``half``: half the step in which the file could store a value (rows,), in the channel's unit; None where
    that is finer than its printed digits.
    """

    name: str
    unit: str | None
    values: NDArray[Any]
    half: Array | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Vectors:
    """The channels that a file keeps together, and where they stand, for the messages."""

    where: str
    vectors: Sequence[Vector]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Written:
    """One channel to write: symbol, header, unit and values (rows,) in that unit."""

    symbol: str
    header: str
    unit: str
    values: Array

    @property
    def name(self) -> str:
        """The header without its unit."""
        return split_header(self.header)[0]


@contextlib.contextmanager
def read_by_library(what: str, *, where: object, expected: str, next_step: str) -> Iterator[None]:
    """Refuse a file at which a library fails, whatever it raises; what is refused for a reason stays so.

    Raises
    ------
    UnreadableError
        rule ``unreadable``; ``what`` is its first sentence
    """
    try:
        yield
    except (UnreadableError, CellError):
        raise
    except Exception as error:
        got = f"{type(error).__name__}: {error}"[:300]
        raise UnreadableError(
            what, where=where, got=got, expected=expected, next_step=next_step, rule="unreadable"
        ) from error


def one_table(tables: Sequence[Vectors], machine: Machine, *, where: object) -> Vectors:
    """Return the one of a file's groups of channels that is the recording.

    Raises
    ------
    RecordingError
        rule ``several-sheets``: more than one has headers of the machine
    UnreadableError
        rule ``no-data``: there is no group with channels
    """
    filled = [table for table in tables if table.vectors]
    if not filled:
        raise UnreadableError(
            "the file has no channels", where=where, got="no channel", expected="channels with values",
            next_step="repeat the recording, or leave the file out of the test", rule="no-data",
        )  # fmt: skip
    fitting = [
        candidate for candidate in filled if any(map(header_of(machine), (v.name for v in candidate.vectors)))
    ]
    if len(fitting) > 1:
        raise RecordingError(
            "more than one group of channels looks like a recording",
            where=where,
            got="; ".join(candidate.where for candidate in fitting)[:300],
            expected="one",
            next_step="save each group as a file of its own",
            rule="several-sheets",
        )
    return (fitting or filled)[0]


def series_of(table: Vectors, machine: Machine) -> tuple[Series, ...]:
    """Return the channels of a table by the machine's definition.

    Raises
    ------
    ColumnError
        see `toolkit.recording.columns.assign_columns`; ``doubled-unit``: a name and its unit disagree
    CellError
        rule ``text-cell boolean-cell date-cell empty-cell nan-cell``: the first bad value, by its row
    UnreadableError
        rule ``no-data not-numbers``
    """
    headers = [_header(vector, table.where) for vector in table.vectors]
    assigned = assign_columns(headers, machine, where=table.where)
    rows = max(len(vector.values) for vector in table.vectors)
    if rows == 0:
        raise UnreadableError(
            "the recording has no data", where=table.where, got="channels without values",
            expected="at least one row of numbers",
            next_step="repeat the recording, or leave the file out of the test", rule="no-data",
        )  # fmt: skip
    return tuple(
        Series(
            symbol=column.symbol,
            header=column.header,
            unit=column.unit,
            role=column.role,
            values=_numbers(table.vectors[column.index], column.header, rows, table.where),
            half=table.vectors[column.index].half,
        )
        for column in assigned
    )


def quantum(raw: NDArray[Any], values: NDArray[Any]) -> Array | None:
    """Return half the step in which a file stores values: of a digitiser's counts, or of a single float.

    Parameters
    ----------
    raw : (rows,) as they are stored
    values : (rows,) after the file's own conversion, in its unit

    Returns
    -------
    (rows,), or None: doubles, and whole numbers without a conversion, show their digits themselves. Also None
    for counts whose conversion is not linear.
    """
    size = np.abs(values.astype(np.float64))
    if raw.dtype.kind == "f" and raw.dtype.itemsize == 4:
        return np.asarray(np.spacing(size.astype(np.float32)).astype(np.float64) / 2)
    if raw.dtype.kind not in "iu" or raw.dtype == values.dtype:
        return None
    counts = raw.astype(np.float64)
    low, high = int(np.argmin(counts)), int(np.argmax(counts))
    if counts[low] == counts[high]:
        return None
    slope = (float(values[high]) - float(values[low])) / (counts[high] - counts[low])
    straight = values[low] + slope * (counts - counts[low])
    if not np.allclose(straight, values, rtol=0, atol=1e-9 * float(size.max())):
        return None
    return np.full(len(counts), abs(slope) / 2)


def _header(vector: Vector, where: str) -> str:
    name, printed = split_header(vector.name)
    stated = (vector.unit or "").strip()
    if not stated:
        return vector.name
    if printed is None:
        return f"{name} [{stated}]"
    try:
        agree = unit(printed, where=where).text == unit(stated, where=where).text
    except UnitError:
        agree = printed.strip() == stated
    if not agree:
        raise ColumnError(
            f"channel {vector.name!r} has two units",
            where=where,
            got=f"{printed!r} in its name, {stated!r} beside it",
            expected="one unit",
            next_step="correct the channel's unit in a copy of the file",
            rule="doubled-unit",
        )
    return vector.name


def _numbers(vector: Vector, header: str, rows: int, where: str) -> Array:
    values = vector.values
    if values.ndim != 1 or values.dtype.kind not in "fiubSUM":
        raise UnreadableError(
            f"channel {header!r} holds no column of numbers", where=where,
            got=f"{values.dtype} of shape {values.shape}", expected="one number a row",
            next_step="export the channel as an array of numbers", rule="not-numbers",
        )  # fmt: skip
    kind = {"b": "boolean-cell", "S": "text-cell", "U": "text-cell", "M": "date-cell"}.get(values.dtype.kind)
    if kind is not None and len(values):
        _bad_cell(kind, repr(values[0])[:80], header, 1, where)
    if len(values) < rows:
        _bad_cell("empty-cell", f"the channel ends after {len(values)} of {rows} rows", header,
                  len(values) + 1, where)  # fmt: skip
    numbers = np.array(values, dtype=np.float64)
    bad = ~np.isfinite(numbers)
    if bad.any():
        first = int(np.argmax(bad))
        _bad_cell("nan-cell", str(numbers[first]), header, first + 1, where)
    numbers.setflags(write=False)
    return numbers


def _bad_cell(rule: str, actual: str, header: str, row: int, where: str) -> None:
    raise CellError(
        f"data row {row}, channel {header!r}: no number",
        where=f"{where}, data row {row}, channel {header!r}",
        got=actual,
        expected="a finite number",
        next_step="look at that value in the file; repeat the recording or mend a copy of the file",
        rule=rule,
    )


def truncated(where: object, problem: str, actual: object, expected: object) -> NoReturn:
    """Refuse a file that ends before its own headers say (rule ``truncated``)."""
    raise UnreadableError(
        problem, where=where, got=actual, expected=expected, next_step=_AGAIN, rule="truncated"
    )


def damaged(where: object, what: str, actual: object, expected: object) -> NoReturn:
    """Refuse a file whose lengths or links contradict each other (rule ``damaged``)."""
    raise UnreadableError(what, where=where, got=actual, expected=expected, next_step=_AGAIN, rule="damaged")


def too_large(where: object, actual: object, most: int) -> NoReturn:
    """Refuse a file that grows out of all proportion (rule ``inflation``)."""
    raise UnreadableError(
        "the file grows out of all proportion when it is unpacked",
        where=where,
        got=actual,
        expected=f"at most {most // 2**20} MB in all",
        next_step="find out where the file comes from; the machine does not write such files",
        rule="inflation",
    )


def version(where: object, what: str, actual: object, expected: object, next_step: str) -> NoReturn:
    """Refuse a version of a format that is not read (rule ``format-version``)."""
    raise UnreadableError(
        what, where=where, got=actual, expected=expected, next_step=next_step, rule="format-version"
    )


def no_numbers(where: object, problem: str, actual: object) -> NoReturn:
    """Refuse objects, texts or complex values where columns of numbers are read (rule ``not-numbers``)."""
    raise UnreadableError(
        problem,
        where=where,
        got=actual,
        expected="columns of real numbers",
        next_step="export the channels as arrays of numbers",
        rule="not-numbers",
    )
