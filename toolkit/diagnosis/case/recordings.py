"""Read one run of a case: CSV, or what else holds a recording; columns in the units of the case."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.diagnosis.case.case import CaseChannel, Run
from toolkit.diagnosis.case.plain_csv import header_of, missing_column, read_csv
from toolkit.errors import CellError, ColumnError, UnitError
from toolkit.files import sha256_bytes
from toolkit.machine import Machine, load_machine
from toolkit.recording.columns import rig
from toolkit.recording.read import read_recording
from toolkit.recording.sniff import sniff
from toolkit.units import unit

if TYPE_CHECKING:
    from numpy.typing import NDArray


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
    table, present, own = _read(path, data, machine=machine, units=units)
    columns: dict[str, NDArray[np.float64]] = {}
    for channel in channels:
        if channel.name in table:
            columns[channel.name] = table[channel.name]
        elif channel.role != "output" or (not predict):
            raise missing_column(path, channel.name, present)
    others: dict[str, NDArray[np.float64]] = {}
    for output, column in simulated.items():
        if column not in table:
            raise missing_column(path, column, present)
        others[output] = table[column]
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
        name=name, t=t, columns=columns, conditions=conditions(declared), declared=declared, simulated=others,
        filled=tuple(filled), sha256=sha256_bytes(data), own=own,
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
) -> tuple[dict[str, NDArray[np.float64]], list[str], bool]:
    """Return the wanted columns that a file has, the names of all, and whether it is the machine's own."""
    is_text = sniff(data).id in _TEXT
    header = header_of(data, units, where=path) if is_text else []
    # The acquisition program's own headers, in a workbook or as text.
    if machine and (not is_text or (not units.keys() & set(header) and _is_of_machine(header, machine))):
        columns = _read_recording(path, data, load_machine(machine), units)
        return columns, list(columns), True
    if is_text:
        return read_csv(data, units, where=path), header, False
    columns = _read_recording(path, data, rig("the case", units), units)
    return columns, list(columns), False


def _is_of_machine(header: Collection[str], machine: str) -> bool:
    """Tell whether a header row is that of a machine's acquisition program."""
    return any(column.header in header for column in load_machine(machine).columns)


def _read_recording(
    path: Path, data: bytes, machine: Machine, units: Mapping[str, str]
) -> dict[str, NDArray[np.float64]]:
    """Return a file's columns by symbol, each in the unit that the case states for it.

    Raises
    ------
    UnreadableError
        it is no recording of the machine; UnitError: a stated unit is of another dimension
    """
    columns = {}
    for series in read_recording(path, machine, data=data).series:
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
    return columns


def _check_time(path: Path, name: str, t: NDArray[np.float64]) -> None:
    bad = np.flatnonzero(~np.isfinite(t))
    if len(bad):
        raise CellError(
            "a row has no time",
            where=f"{path}, row {bad[0] + 1}, column {name}",
            got="nothing",
            expected="a time in every row",
            next_step="remove the row or give its time",
            rule="case-run",
        )
    back = np.flatnonzero(np.diff(t) <= 0)
    if len(back):
        raise CellError(
            "time does not rise",
            where=f"{path}, row {back[0] + 2}, column {name}",
            got=f"{t[back[0] + 1]:g} s after {t[back[0]]:g} s",
            expected="a rising time",
            next_step="sort the rows, or split the file into runs",
            rule="case-run",
        )


def _filled(path: Path, name: str, t: NDArray[np.float64], x: NDArray[np.float64]) -> NDArray[np.float64]:
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
