"""One file to one recording, by its content: the thesis's files have no extension. And a second opinion."""

from __future__ import annotations

import io
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

from toolkit.errors import CellError, RecordingError, UnreadableError
from toolkit.files import LARGEST
from toolkit.machine import Machine
from toolkit.recording.archive import stored_archive
from toolkit.recording.cells import reference
from toolkit.recording.columns import header_of
from toolkit.recording.csvfile import read_csv
from toolkit.recording.formats import READERS
from toolkit.recording.formats.vectors import series_of
from toolkit.recording.marks import OWN_OUTPUT, SIMULATED, keywords_of, machine_named, saved_on
from toolkit.recording.model import Recording, Series
from toolkit.recording.safe_open import Gated, gate
from toolkit.recording.table import Table, read_table
from toolkit.recording.xlsx import read_sheet

Reader = Literal["calamine", "both"]


def read_recording(
    path: Path, machine: Machine, *, reader: Reader = "calamine", data: bytes | None = None
) -> Recording:
    """Read a recording whole or not at all.

    Parameters
    ----------
    path : an .xlsx workbook, a CSV file, or TDMS, LVM, MDF 4 or a MAT-file, under any name
    machine : the machine that wrote it
    reader : ``both`` has openpyxl read every cell a second time
    data : the file's content where the caller has read it already

    Raises
    ------
    UnreadableError
        the content is no recording: see `toolkit.recording.safe_open` and the rules ``no-data own-output``
    ColumnError
        a column is missing, doubled, or has no known unit
    CellError
        text, an error value, NaN or nothing stands in a number's place
    RecordingError
        several worksheets look like recordings, or the file names another machine
    ConfigError
        rule ``missing-extra``: the library that reads the file's format is not installed
    """
    gated = gate(path, data)
    if gated.kind == "text":
        table = read_csv(gated.data, path, machine)
        return Recording(
            path=path,
            sha256=gated.sha256,
            machine=machine,
            series=_loads(_measurable(path, read_table(table, machine)), machine),
            simulated=machine.simulated,
            format="csv",
            cut=table.cut,
        )
    if gated.kind in READERS:
        vectors = READERS[gated.kind](gated.members.get(gated.kind, gated.data), path, machine)
        return Recording(
            path=path,
            sha256=gated.sha256,
            machine=machine,
            series=_loads(_measurable(path, series_of(vectors, machine)), machine),
            simulated=machine.simulated,
            format=gated.kind,
        )
    properties = gated.members.get("docProps/core.xml", b"")
    keywords = keywords_of(properties)
    _check_origin(path, keywords, machine)
    sheet, table = read_sheet(gated, header_of(machine))
    series = _loads(_measurable(path, read_table(table, machine)), machine)
    if reader == "both":
        cross_check(gated, sheet, table)
    return Recording(
        path=path,
        sha256=gated.sha256,
        machine=machine,
        series=series,
        simulated=machine.simulated or SIMULATED in keywords,
        format="xlsx",
        saved=saved_on(properties),
        hidden=table.hidden_data,
    )


def _measurable(path: Path, series: tuple[Series, ...]) -> tuple[Series, ...]:
    # Finite in its own unit is not finite in SI, let alone squared; and some solvers wait for ever on inf.
    for column in series:
        largest = max(column.values.max(), -column.values.min())
        if largest > LARGEST:
            row = int(abs(column.values).argmax())
            raise CellError(
                f"data row {row + 1}, column {column.header!r}: no number that can be measured",
                where=path, got=column.values[row], expected=f"at most {LARGEST:g} in any unit",
                next_step="look at that value in the file; repeat the recording or mend a copy of the file",
                rule="nan-cell",
            )  # fmt: skip
    return series


def _loads(series: tuple[Series, ...], machine: Machine) -> tuple[Series, ...]:
    """Return the columns, the load on the tire positive.

    In SAE J670 z points down into the road, so that its vertical force is negative; many machines show the
    load all the same. Both are of the axes that the definition declares, and their sign tells them apart.
    """
    if machine.axes != "SAE":
        return series
    return tuple(
        replace(column, sign=-1)
        if column.role == "load" and -column.values.min() > abs(column.values.max())
        else column
        for column in series
    )


def _check_origin(path: Path, keywords: tuple[str, ...], machine: Machine) -> None:
    if OWN_OUTPUT in keywords:
        raise UnreadableError(
            "the file is a result of this toolkit, not a recording",
            where=path,
            got="a workbook with computed values",
            expected="a file that the acquisition program wrote",
            next_step="give the recording that it was computed from",
            rule="own-output",
        )
    origin = machine_named(keywords)
    # The headers print no units: read by another machine's definition, mV/V would become lbf.
    if origin is not None and origin != machine.name:
        raise RecordingError(
            "the recording comes from another machine",
            where=path,
            got=origin,
            expected=machine.name,
            next_step=f"read it with the machine {origin!r} (in test.toml: machine = {origin!r})",
            rule="other-machine",
        )


# The second opinion: openpyxl reads the same members, and every number must be the same.


def cross_check(gated: Gated, sheet: str, table: Table) -> None:
    """Compare a table as it was read (a grid, python-calamine) with openpyxl's reading of it.

    The full reader is used: openpyxl's read-only one believes ``<dimension>``.

    Raises
    ------
    CellError
        rule ``readers-differ``: the first cell that the two readers do not agree on
    UnreadableError
        rule ``readers-differ``: openpyxl cannot read the file at all
    """
    table = table.in_rows()
    second = _openpyxl_rows(gated, sheet)
    height = max(len(table.rows), len(second))
    width = max((len(row) for row in (*table.rows, *second)), default=0)
    for row in range(height):
        for column in range(width):
            first_value, two = _cell(table.rows, row, column), _cell(second, row, column)
            if first_value != two and not (
                first_value == "" and isinstance(two, str) and two.startswith("#")
            ):
                raise CellError(
                    f"cell {reference(row + 1, column + 1)}: two readers disagree",
                    where=f"{table.where}, cell {reference(row + 1, column + 1)}",
                    got=f"read {first_value!r}, openpyxl {two!r}"[:200],
                    expected="the same value from both",
                    next_step="look at that cell in the file; save a copy of it with Excel",
                    rule="readers-differ",
                )


def _openpyxl_rows(gated: Gated, sheet: str) -> list[tuple[Any, ...]]:
    import openpyxl

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about styles and extensions, which hold no values
            workbook = openpyxl.load_workbook(
                io.BytesIO(stored_archive(gated.members)), data_only=True, keep_links=False
            )
            return list(workbook[sheet].iter_rows(values_only=True))
    except Exception as error:
        raise UnreadableError(
            "the second reader cannot read the workbook",
            where=f"{gated.path}, sheet {sheet!r}",
            got=f"openpyxl: {error}"[:300],
            expected="a workbook that both readers read",
            next_step="open it in Excel and save it again",
            rule="readers-differ",
        ) from error


def _cell(rows: Any, row: int, column: int) -> Any:
    if row >= len(rows) or column >= len(rows[row]):
        return ""
    value = rows[row][column]
    return "" if value is None else value
