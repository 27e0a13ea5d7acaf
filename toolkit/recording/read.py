"""One file to one recording, by its content: the thesis's files have no extension."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from toolkit.errors import RecordingError, UnreadableError
from toolkit.machine import Machine
from toolkit.recording.columns import header_of
from toolkit.recording.csvfile import read_csv
from toolkit.recording.formats import READERS
from toolkit.recording.formats.vectors import series_of
from toolkit.recording.marks import OWN_OUTPUT, SIMULATED, keywords_of, machine_named, saved_on
from toolkit.recording.model import Recording
from toolkit.recording.safe_open import gate
from toolkit.recording.table import read_table
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
        return Recording(
            path=path,
            sha256=gated.sha256,
            machine=machine,
            series=read_table(read_csv(gated, machine), machine),
            simulated=machine.simulated,
            format="csv",
        )
    if gated.kind in READERS:
        return Recording(
            path=path,
            sha256=gated.sha256,
            machine=machine,
            series=series_of(READERS[gated.kind](gated, machine), machine),
            simulated=machine.simulated,
            format=gated.kind,
        )
    properties = gated.members.get("docProps/core.xml", b"")
    keywords = keywords_of(properties)
    _check_origin(path, keywords, machine)
    sheet, table = read_sheet(gated, header_of(machine))
    series = read_table(table, machine)
    if reader == "both":
        from toolkit.recording.crosscheck import cross_check

        cross_check(gated, sheet, table)
    return Recording(
        path=path,
        sha256=gated.sha256,
        machine=machine,
        series=series,
        simulated=machine.simulated or SIMULATED in keywords,
        format="xlsx",
        saved=saved_on(properties),
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
