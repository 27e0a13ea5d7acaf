"""Read one run of a case: CSV, or what else holds a recording; columns in the units of the case.

A CSV has a header row of column names, which may state units (`toolkit.units.split_header`), then numbers;
commas, semicolons or tabs part the cells, and columns that nobody names may hold anything.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Collection, Iterable, Mapping
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.diagnosis.case.case import CaseChannel, Run
from toolkit.errors import CellError, ColumnError, UnitError, UnreadableError
from toolkit.files import sha256_bytes
from toolkit.machine import Machine, load_machine
from toolkit.recording.clock import listed, time_fault
from toolkit.recording.columns import rig
from toolkit.recording.csvfile import SEPARATORS, decimal_sign, decode, first_line, separator_of
from toolkit.recording.read import read_recording
from toolkit.recording.sniff import sniff
from toolkit.spelling import nearest
from toolkit.units import split_header, unit

if TYPE_CHECKING:
    from toolkit.arrays import Array

_TEXT = ("text", "utf-16", "binary", "empty", "blank")  # a NUL among the numbers is told with its cell


def read_run(
    path: Path,
    data: bytes,
    *,
    name: str,
    channels: tuple[CaseChannel, ...],
    time: CaseChannel | None,
    declared: Mapping[str, Any],
    simulated: Mapping[str, str],
    machine: str,
    predict: bool,
) -> Run:
    """Read one file.

    Parameters
    ----------
    data : the file's content
    simulated : output -> column of the other program's output, for a case of kind ``columns``
    machine : whose own recordings the file may be one of; empty for tables that name their channels
    predict : outputs may be absent

    Raises
    ------
    ColumnError
        a column is missing or doubled; CellError: a cell is no number; UnreadableError: no rows, no text
    """
    units = {channel.name: channel.unit for channel in channels}
    # Another program's output stands in the unit of the channel that it is held against.
    units = {column: units.get(output, "") for output, column in simulated.items()} | units
    table, present, own_names, hidden = _read(path, data, machine=machine, units=units)
    columns: dict[str, Array] = {}
    for channel in channels:
        if channel.name in table:
            columns[channel.name] = table[channel.name]
        elif channel.role != "output" or (not predict):
            raise missing_column(path, channel.name, present)
    further: dict[str, Array] = {}
    for output, column in simulated.items():
        if column not in table:
            raise missing_column(path, column, present)
        further[output] = table[column]
    if not table:
        raise missing_column(path, channels[0].name if channels else "", present)
    rows = len(next(iter(table.values())))
    if time is None:
        t = np.arange(rows, dtype=np.float64)
    else:
        t = columns[time.name] * unit(time.unit).factor
        _check_time(path, time.name, t)
    filled = []
    for channel in channels:
        if channel.role in ("input", "covariate") and channel.name in columns:
            missing = int(np.isnan(columns[channel.name]).sum())
            filled += [(channel.name, missing)] if missing else []
            columns[channel.name] = _filled(path, channel.name, t, columns[channel.name])
    return Run(
        name=name, t=t, columns=columns, conditions=conditions(declared), declared=declared,
        simulated=further, filled=tuple(filled), sha256=sha256_bytes(data), own=own_names, hidden=hidden,
    )  # fmt: skip


def conditions(declared: Mapping[str, Any]) -> dict[str, str]:
    """Return the conditions of a run's table as texts, a quantity as number and unit."""
    texts = {}
    for key, value in declared.items():
        if isinstance(value, dict) and set(value) == {"value", "unit"}:
            texts[key] = f"{value['value']} {value['unit']}"
        elif key != "file":
            texts[key] = str(value)
    return texts


def _read(
    path: Path, data: bytes, *, machine: str, units: Mapping[str, str]
) -> tuple[dict[str, Array], list[str], bool, tuple[int, ...]]:
    """Return the wanted columns that a file has and the names of all.

    And whether it is the machine's own, and the rows of a worksheet that it hides.
    """
    is_text = sniff(data).id in _TEXT
    header = header_of(data, units, where=path) if is_text else []
    # The acquisition program's own headers, in a workbook or as text.
    if machine and (not is_text or (not units.keys() & set(header) and _is_of_machine(header, machine))):
        columns, hidden = _read_recording(path, data, load_machine(machine), units)
        return columns, list(columns), True, hidden
    if is_text:
        return read_csv(data, units, where=path), header, False, ()
    columns, hidden = _read_recording(path, data, rig("the case", units), units)
    return columns, list(columns), False, hidden


def _is_of_machine(header: Collection[str], machine: str) -> bool:
    """Tell whether a header row is that of a machine's acquisition program."""
    return any(column.header in header for column in load_machine(machine).columns)


def _read_recording(
    path: Path, data: bytes, machine: Machine, units: Mapping[str, str]
) -> tuple[dict[str, Array], tuple[int, ...]]:
    """Return a file's columns by symbol, each in the unit that the case states for it; and its hidden rows.

    Raises
    ------
    UnreadableError
        it is no recording of the machine; UnitError: a stated unit is of another dimension
    """
    columns = {}
    recording = read_recording(path, machine, data=data)
    for series in recording.series:
        if series.symbol not in units:
            continue
        stated = unit(units[series.symbol])
        if stated.dimension != unit(series.unit).dimension:
            raise UnitError(
                "a channel's unit does not fit the recording's",
                where=f"{path}: {series.symbol}",
                got=stated.text,
                expected=series.unit,
                next_step="correct the unit in the case",
                rule="case",
            )
        columns[series.symbol] = (series.si - stated.offset) / stated.factor
    return columns, recording.hidden


def _check_time(path: Path, name: str, t: Array) -> None:
    fault = time_fault(t)
    if fault is None:
        return
    row = fault.rows[0]
    got = f"{t[row - 1]:.10g} s after {t[row - 2]:.10g} s" if np.isfinite(t[row - 1]) else "nothing"
    raise CellError(
        fault.problem,
        where=f"{path}, row {row}, column {name}",
        got=f"{got}; the same in {listed(fault.rows)} below the header" if len(fault.rows) > 1 else got,
        expected="a time in every row that is above that of the row before",
        next_step=fault.remedy,
        rule="case-run",
    )


def _filled(path: Path, name: str, t: Array, x: Array) -> Array:
    good = np.isfinite(x)
    if good.all():
        return x
    if not good.any():
        raise ColumnError(
            "an input has no value at all",
            where=f"{path}, column {name}",
            got="no number",
            expected="numbers",
            next_step="remove the channel from the case, or give its values",
            rule="case-run",
        )
    return np.interp(t, t[good], x[good])


_MISSING = frozenset(("", "nan", "na", "n/a", "null", "none"))
_LARGEST = 1e100  # in no unit does an instrument reach it; its square must stay a number


def read_csv(data: bytes, units: Mapping[str, str], *, where: Path) -> dict[str, Array]:
    """Return the wanted columns that the file has, each (n,), NaN where a sample is missing.

    Parameters
    ----------
    units : the unit of each wanted column; a header that states another of its dimension is converted

    Raises
    ------
    UnreadableError
        it is no text, no CSV, or has no rows; ColumnError: a wanted column stands twice; CellError: a cell
        of a wanted column is no finite number, or a row has another number of cells than the header;
        UnitError: a header states a unit of another dimension
    """
    text = decode(data, where=where)
    columns = units.keys()
    try:
        separator = _separator(text, columns, where)
        decimal = _decimal(text, separator, where)
        if decimal == ",":
            text = text.replace(",", ".")
        rows = csv.reader(io.StringIO(text, newline=""), delimiter=separator, skipinitialspace=True)
        parted = [split_header(cell, columns.__contains__) for cell in next(rows, [])]
        header = [name for name, _ in parted]
        doubled = sorted({name for name in header if name in columns and header.count(name) > 1})
        if doubled:
            raise ColumnError(
                "a column stands twice", where=where, got=", ".join(doubled), expected="different names",
                next_step="rename or remove one", rule="case-run",
            )  # fmt: skip
        table = _quick(text, header, separator)
        if table is None:
            table = _careful(rows, header, columns, where)
    except csv.Error as error:
        raise _unreadable(where, str(error), "CSV: a header row and rows of numbers") from error
    if not len(table):
        raise _unreadable(where, "no rows of numbers", "a header and rows")
    return {
        name: _converted(table[:, i], stated, units[name], f"{where}, column {name}")
        for i, (name, stated) in enumerate(parted)
        if name in columns
    }


def _separator(text: str, columns: Collection[str], where: Path) -> str:
    def is_column(header: str) -> bool:
        return split_header(header, columns.__contains__)[0] in columns

    head = first_line(text)
    # Where no separator parts any name, the one that parts the most cells says best what is wrong.
    return separator_of(head, is_column, where=where) or max(SEPARATORS, key=head.count)


def _decimal(text: str, separator: str, where: Path) -> str:
    rows = csv.reader(io.StringIO(text, newline=""), delimiter=separator)
    next(rows, None)
    return decimal_sign(chain.from_iterable(rows), separator, where=where)


def _converted(values: Array, stated: str | None, channel_unit: str, where: str) -> Array:
    if stated is None or stated == channel_unit:
        return values
    source, target = unit(stated, where=where), unit(channel_unit, where=where)
    if source.dimension != target.dimension:
        raise UnitError(
            "a channel's unit does not fit the recording's", where=where, got=target.text,
            expected=source.text, next_step="correct the unit in the case", rule="case",
        )  # fmt: skip
    if (source.factor, source.offset) == (target.factor, target.offset):
        return values
    return (values * source.factor + source.offset - target.offset) / target.factor


def missing_column(where: Path, name: str, names: Iterable[str]) -> ColumnError:
    """Return the error of a column that a file has not, with the nearest one that it has."""
    listed = list(names)
    near = nearest(name, listed)
    step = f"did you mean {near!r}?" if near else "correct the case or the file"
    return ColumnError(
        f"the recording has no column {name!r}", where=where, got=", ".join(listed) or "no columns",
        expected=f"a column {name!r} in the header row", next_step=step, rule="case-column",
    )  # fmt: skip


def header_of(data: bytes, columns: Collection[str] = (), *, where: Path) -> list[str]:
    """Return the names in a file's header row; none where it cannot be read."""
    try:
        text = decode(data, where=where)
        rows = csv.reader(
            io.StringIO(text, newline=""), delimiter=_separator(text, columns, where), skipinitialspace=True
        )
        return [split_header(cell, columns.__contains__)[0] for cell in next(rows, []) if cell.strip()]
    except (UnreadableError, csv.Error):
        return []


def _quick(text: str, header: list[str], separator: str) -> Array | None:
    """Return a file of finite numbers alone, None for anything that must be looked at cell by cell."""
    start = text.find("\n")
    if start < 0 or '"' in text or "\r" in text[:start].rstrip("\r") or not text[start + 1 :].strip():
        return None
    try:
        table = np.loadtxt(
            io.StringIO(text[start + 1 :]), delimiter=separator, dtype=np.float64, ndmin=2, comments=None
        )
    except ValueError:
        return None
    fits = table.shape[1] == len(header) and bool((np.abs(table) < _LARGEST).all())
    return table if fits else None


def _careful(rows: Iterable[list[str]], header: list[str], columns: Collection[str], where: Path) -> Array:
    table: list[list[float]] = []
    is_used = [name in columns for name in header]
    for number, row in enumerate(rows, start=2):
        if not any(cell.strip() for cell in row):
            continue
        if len(row) != len(header):
            raise CellError(
                "a row has another number of cells than the header", where=f"{where}, line {number}",
                got=f"{len(row)} cells", expected=f"{len(header)}",
                next_step="correct the row", rule="case-run",
            )  # fmt: skip
        table.append(
            [
                _number(cell, f"{where}, line {number}, column {name}") if use else math.nan
                for cell, name, use in zip(row, header, is_used, strict=True)
            ]
        )
    return np.array(table, dtype=np.float64).reshape(len(table), len(header))


def _number(cell: str, where: str) -> float:
    text = cell.strip()
    if text.lower() in _MISSING:
        return math.nan
    try:
        # Python alone reads 1_000 and digits of other scripts as numbers; no instrument writes them.
        value = float(text) if text.isascii() and "_" not in text else math.inf
    except ValueError:
        value = math.inf
    if not abs(value) < _LARGEST:
        raise CellError(
            "a cell is no number", where=where, got=repr(text[:60]),
            expected="a finite number with a decimal point, or nothing where a sample is missing",
            next_step="correct the cell, or leave it empty", rule="case-run",
        )  # fmt: skip
    return value


def _unreadable(where: Path, got: str, expected: str) -> UnreadableError:
    return UnreadableError(
        "a run cannot be read as CSV", where=where, got=got, expected=expected,
        next_step="check the file; save it as plain CSV in UTF-8", rule="case-run",
    )  # fmt: skip
