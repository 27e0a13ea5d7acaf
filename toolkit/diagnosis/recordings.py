"""Read one run of a case: plain CSV, or the machine's own .xlsx; columns in the recording's units."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.diagnosis.case import CaseChannel, Run
from toolkit.errors import CellError, ColumnError, UnreadableError
from toolkit.files import read_bytes
from toolkit.units import unit

if TYPE_CHECKING:
    from numpy.typing import NDArray

_MISSING = {"", "nan", "na", "n/a", "null", "none"}
_LIMIT = 2_000_000_000


def read_run(
    path: Path,
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
    simulated : output -> column of the other program's output, for a case of kind ``columns``
    machine : whose own workbooks the file may be one of; empty for plain CSV alone
    predict : outputs may be absent

    Raises
    ------
    ColumnError
        a column is missing or doubled; CellError: a cell is no number; UnreadableError: no rows, no text
    """
    table = _read(path, machine=machine, units={one.name: one.unit for one in channels})
    columns: dict[str, NDArray[np.float64]] = {}
    for channel in channels:
        if channel.name in table:
            columns[channel.name] = table[channel.name]
        elif channel.role != "output" or (not predict):
            raise _missing(path, channel.name, table)
    others: dict[str, NDArray[np.float64]] = {}
    for output, column in simulated.items():
        if column not in table:
            raise _missing(path, column, table)
        others[output] = table[column]
    rows = len(next(iter(table.values())))
    if time is None:
        t = np.arange(rows, dtype=np.float64)
    else:
        t = columns[time.name] * unit(time.unit).factor
        _check_time(path, time.name, t)
    for channel in channels:
        if channel.role in ("input", "covariate") and channel.name in columns:
            columns[channel.name] = _filled(path, channel.name, t, columns[channel.name])
    return Run(
        name=name, t=t, columns=columns, conditions=conditions(declared), declared=declared, simulated=others
    )


def conditions(declared: Mapping[str, Any]) -> dict[str, str]:
    """Return the conditions of a run's table as texts, a quantity as number and unit."""
    made = {}
    for key, value in declared.items():
        if isinstance(value, dict) and set(value) == {"value", "unit"}:
            made[key] = f"{value['value']} {value['unit']}"
        elif key != "file":
            made[key] = str(value)
    return made


def _read(path: Path, *, machine: str, units: Mapping[str, str]) -> dict[str, NDArray[np.float64]]:
    data = read_bytes(path)
    if data[:4] == b"PK\x03\x04":
        if machine:
            from toolkit.diagnosis.workbook import read_workbook

            return read_workbook(path, machine, units)
        raise UnreadableError(
            "a run is a workbook",
            where=path,
            got="an .xlsx",
            expected="a CSV (workbooks only for kind machine)",
            next_step="save the run as CSV",
            rule="case-run",
        )
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise UnreadableError(
            "a run is no text",
            where=path,
            got=f"byte {error.start} is not UTF-8",
            expected="CSV in UTF-8",
            next_step="save the run as CSV in UTF-8",
            rule="case-run",
        ) from error
    lines = text.splitlines()
    if len(lines) < 2:
        raise UnreadableError(
            "a run has no rows",
            where=path,
            got=f"{len(lines)} lines",
            expected="a header and rows",
            next_step="check the file",
            rule="case-run",
        )
    header = [cell.strip() for cell in next(csv.reader([lines[0]]))]
    doubled = {one for one in header if one and header.count(one) > 1}
    if doubled:
        raise ColumnError(
            "a column stands twice",
            where=path,
            got=", ".join(sorted(doubled)),
            expected="different names",
            next_step="rename or remove one",
            rule="case-run",
        )
    cells = _numbers(path, header, text)
    return {name: cells[:, i] for i, name in enumerate(header) if name}


def _numbers(path: Path, header: list[str], text: str) -> NDArray[np.float64]:
    body = text[text.index("\n") + 1 :] if "\n" in text else ""
    try:
        # The quick way, for a file of numbers alone; anything unusual goes through the slow one.
        made = np.loadtxt(io.StringIO(body), delimiter=",", dtype=np.float64, ndmin=2, comments=None)
        if made.shape[1] == len(header):
            return np.where(np.isfinite(made), made, np.nan)
    except ValueError:
        pass
    rows = []
    for number, row in enumerate(csv.reader(io.StringIO(text)), start=1):
        if number == 1 or not any(cell.strip() for cell in row):
            continue
        if len(row) != len(header):
            raise CellError(
                "a row has another number of cells than the header",
                where=f"{path}, line {number}",
                got=f"{len(row)} cells",
                expected=f"{len(header)}",
                next_step="correct the row",
                rule="case-run",
            )
        rows.append([_cell(path, number, name, cell) for name, cell in zip(header, row, strict=True)])
    if not rows:
        raise UnreadableError(
            "a run has no rows",
            where=path,
            got="a header alone",
            expected="rows",
            next_step="check the file",
            rule="case-run",
        )
    made = np.array(rows, dtype=np.float64)
    return np.where(np.isfinite(made), made, np.nan)


def _cell(path: Path, line: int, name: str, cell: str) -> float:
    if cell.strip().lower() in _MISSING:
        return float("nan")
    try:
        return float(cell)
    except ValueError:
        # A column of text that no channel names does no harm; one that is named is found by its NaN.
        if not name:
            return float("nan")
        raise CellError(
            "a cell is no number",
            where=f"{path}, line {line}, column {name}",
            got=repr(cell),
            expected="a number with a decimal point, or nothing where a sample is missing",
            next_step="correct the cell",
            rule="case-run",
        ) from None


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


def _missing(path: Path, name: str, table: Mapping[str, object]) -> ColumnError:
    import difflib

    near = difflib.get_close_matches(name, list(table), n=1, cutoff=0.5)
    return ColumnError(
        f"the recording has no column {name!r}",
        where=path,
        got=", ".join(table) or "no columns",
        expected=f"a column {name!r} in the header row",
        next_step=f"did you mean {near[0]!r}?" if near else "correct the case or the file",
        rule="case-column",
    )
