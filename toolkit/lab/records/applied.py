"""Files of indications to files of loads: what `toolkit calibration apply` reads, computes and writes.

The recording needs no machine definition and no tire: the record names its indications, every other column of
numbers with a unit goes through as it is. Each row names the record that computed it; a draft says so in
every row and in the file's own properties.
"""

from __future__ import annotations

import dataclasses
import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, TypedDict

import numpy as np
from numpy.typing import NDArray

from toolkit.calibration.records.use import CalibrationUse, UsedRecord
from toolkit.errors import ConfigError, OutputError
from toolkit.findings import Finding, FindingEntry
from toolkit.inputs import RECORDING_FILE, read_input
from toolkit.lab.records.record import Loads, Record
from toolkit.recording.columns import rig
from toolkit.recording.cut import cut_findings
from toolkit.recording.extras import needed
from toolkit.recording.formats.mdf import mdf_bytes
from toolkit.recording.formats.tdms import tdms_bytes
from toolkit.recording.formats.vectors import Vector, Vectors, Written, read_by_library, series_of
from toolkit.recording.hidden import hidden_findings
from toolkit.recording.marks import GENERATOR, OWN_OUTPUT, STAMP
from toolkit.recording.model import Series
from toolkit.recording.read import read_recording
from toolkit.recording.sniff import sniff


class AppliedRange(TypedDict):
    """The range of a load that was computed."""

    unit: str
    least: float
    largest: float
    U_largest: Annotated[float | None, "largest expanded uncertainty; null where it is not determined"]


class ApplyAnswer(TypedDict):
    """Loads of a file of indications, computed by a record."""

    out: Annotated[Path, "file that was written"]
    rows: int
    calibration: UsedRecord
    mark: Annotated[str | None, "what the file is marked with"]
    loads: Annotated[Mapping[str, AppliedRange], "by load"]
    findings: list[FindingEntry]


Table = Mapping[str, "NDArray[Any]"]

EXTRAPOLATED = "extrapolated [1]"
"""Column of a result: how many indications of the row lie beyond their calibrated range."""

_SHEET_ROWS = 2**20 - 1  # below the head: a worksheet has 2^20 rows
_AT_A_TIME = 1 << 14  # rows that are made text together


def read_indications(path: Path, record: Record) -> tuple[tuple[Series, ...], list[Finding]]:
    """Return the columns of a file that holds the indications of a record, each with its unit; and findings.

    Raises
    ------
    RecordingError
        see `toolkit.recording.read.read_recording`; a column without a unit is refused
    ConfigError
        ``missing-extra``
    """
    machine = rig(record.result.instrument, record.indications)
    data = read_input(path, RECORDING_FILE)
    if sniff(data).id == "parquet":
        return series_of(_parquet(data, path), machine), []
    recording = read_recording(path, machine, data=data)
    cut = cut_findings(recording.cut, path.name)
    return recording.series, [*hidden_findings(recording.hidden, path.name), *cut]


def _parquet(data: bytes, path: Path) -> Vectors:
    parquet: Any = needed("pyarrow.parquet", extra="parquet", to="read a Parquet table", where=path)
    with read_by_library(
        "the Parquet table cannot be read", where=path,
        expected="a Parquet file with one column a channel, 'NAME [unit]'", next_step="write it again",
    ):  # fmt: skip
        table = parquet.read_table(io.BytesIO(data))
        names = table.column_names
        columns = [np.asarray(table.column(at).to_numpy()) for at in range(len(names))]
    vectors = [
        Vector(name=name, unit=None, values=values) for name, values in zip(names, columns, strict=True)
    ]
    return Vectors(where=str(path), vectors=[vector for vector in vectors if vector.values.dtype.kind != "O"])


def applied_columns(series: Sequence[Series], loads: Loads) -> dict[str, NDArray[Any]]:
    """Return the columns of the output by header: those of the file, then each load and its U.

    The last tells how many indications of a row lie beyond what they were calibrated over.

    Raises
    ------
    ConfigError
        ``doubled-column``: the file has a column of a load already
    """
    columns: dict[str, NDArray[Any]] = {
        f"{column.symbol} [{column.unit}]": column.values for column in series
    }
    own = {*loads.value, *(f"U({name})" for name in loads.value), EXTRAPOLATED.partition(" ")[0]}
    clash = {column.symbol for column in series} & own
    if clash:
        raise ConfigError(
            "the file has columns of results already", where=", ".join(sorted(clash)),
            got="a column in the file", expected="indications, and other columns of other names",
            next_step="take it out of a copy of the file, or rename it there", rule="doubled-column",
        )  # fmt: skip
    for name, values in loads.value.items():
        unit = loads.units[name]
        columns[f"{name} [{unit}]"] = values
        columns[f"U({name}) [{unit}]"] = loads.U[name]
    columns[EXTRAPOLATED] = loads.extrapolated
    return columns


def write_applied(path: Path, columns: Table, use: CalibrationUse) -> None:
    """Write the columns, whole or not at all; the ending names the format.

    Raises
    ------
    OutputError
        ``output-name original not-writable``: another ending, a file that is no result, a folder that cannot
        be written to
    ConfigError
        ``missing-extra``
    """
    from toolkit.publication import result_file

    write = check_output(path)
    rows = len(next(iter(columns.values())))
    if path.suffix.lower() == ".xlsx" and rows > _SHEET_ROWS:
        raise OutputError(
            "a worksheet cannot hold the rows", where=path, got=f"{rows} rows",
            expected=f"at most {_SHEET_ROWS} rows below the head", rule="output-name",
            next_step="name a file that ends in .csv or .parquet with --out; nothing was written",
        )  # fmt: skip
    with result_file(path) as staged:
        write(columns, use, staged)


def check_output(path: Path) -> Callable[[Table, CalibrationUse, Path], None]:
    """Return the writer of an ending, before anything is computed; errors as `write_applied`."""
    write = WRITERS.get(path.suffix.lower())
    if write is None:
        raise OutputError(
            "no format goes by this name", where=path, got=path.suffix or "no ending",
            expected=", ".join(WRITERS), next_step="name the file so with --out; nothing was written",
            rule="output-name",
        )  # fmt: skip
    if path.exists():
        raise OutputError(
            "the output exists", where=path, got="a file", expected="a new name: nothing is written over",
            next_step="name another file with --out, or remove that one", rule="original",
        )  # fmt: skip
    return write


def mark_line(use: CalibrationUse) -> str:
    """Return the line that a file's properties hold: record, hash, how it stood."""
    return "; ".join(filter(None, (GENERATOR, OWN_OUTPUT, f"{use.id} {use.sha256}", use.mark)))


def _texts(use: CalibrationUse) -> dict[str, str]:
    """Return what every row says of the record."""
    return {"calibration": use.id, "calibration_sha256": use.sha256, "mark": use.mark or ""}


def _blocks(columns: Table) -> Iterator[dict[str, NDArray[Any]]]:
    """Yield the rows some thousand at a time: as text they take many times their room."""
    rows = len(next(iter(columns.values())))
    for start in range(0, rows, _AT_A_TIME):
        yield {name: values[start : start + _AT_A_TIME] for name, values in columns.items()}


def _csv(columns: Table, use: CalibrationUse, path: Path) -> None:
    import pandas as pd

    with path.open("w", encoding="utf-8", newline="") as stream:
        for at, block in enumerate(_blocks(columns)):
            frame = pd.DataFrame({**block, **_texts(use)})
            frame.to_csv(stream, index=False, header=at == 0, lineterminator="\n")


def _xlsx(columns: Table, use: CalibrationUse, path: Path) -> None:
    import openpyxl

    book = openpyxl.Workbook(write_only=True)
    sheet: Any = book.create_sheet("loads")
    sheet.freeze_panes = "A2"
    texts = _texts(use)
    sheet.append([*columns, *texts])
    for block in _blocks(columns):
        for row in zip(*(values.tolist() for values in block.values()), strict=True):
            cells = [None if isinstance(cell, float) and np.isnan(cell) else cell for cell in row]
            sheet.append([*cells, *texts.values()])
    book.properties.creator, book.properties.title = GENERATOR, use.mark or f"loads by {use.id}"
    book.properties.keywords = f"{OWN_OUTPUT}; {mark_line(use)}"
    book.properties.created = book.properties.modified = STAMP
    stream = io.BytesIO()  # packed; on a full disk an archive that is open says so once more as it goes
    book.save(stream)
    path.write_bytes(stream.getvalue())


def _parquet_table(columns: Table, use: CalibrationUse, path: Path) -> None:
    arrow: Any = needed("pyarrow", extra="parquet", to="write a Parquet table", where="--out")
    parquet: Any = needed("pyarrow.parquet", extra="parquet", to="write a Parquet table", where="--out")
    rows = len(next(iter(columns.values())))
    texts = {name: arrow.repeat(text, rows) for name, text in _texts(use).items()}
    table = arrow.table({**columns, **texts})
    marks = {"generator": GENERATOR, "marks": mark_line(use)}
    parquet.write_table(table.replace_schema_metadata(marks), path)


def _channels(columns: Table) -> list[Written]:
    written = []
    for header, values in columns.items():
        symbol, _, unit = header.removesuffix("]").rpartition(" [")
        written.append(
            Written(symbol=symbol, header=header, unit=unit, values=np.asarray(values, dtype=float))
        )
    return written


def _tdms(columns: Table, use: CalibrationUse, path: Path) -> None:
    path.write_bytes(tdms_bytes(_channels(columns), mark_line(use)))


def _mdf(columns: Table, use: CalibrationUse, path: Path) -> None:
    path.write_bytes(mdf_bytes(_channels(columns), mark_line(use)))


WRITERS: dict[str, Callable[[Table, CalibrationUse, Path], None]] = {
    ".csv": _csv,
    ".xlsx": _xlsx,
    ".parquet": _parquet_table,
    ".tdms": _tdms,
    ".mf4": _mdf,
}
"""Ending of an output -> its writer."""


def apply_answer(
    record: Record,
    source: Path,
    out: Path,
    *,
    tare: Mapping[str, float] | None,
    draft: bool,
    step: Callable[[str], None] = lambda _text: None,
) -> tuple[ApplyAnswer, str, Loads]:
    """Compute a file's loads by a record and write them; return both forms of the answer, and the loads."""
    from toolkit.lab.answers import finding_lines
    from toolkit.listing import one_line

    check_output(out)
    step("reading")
    series, of_file = read_indications(source, record)
    by_name = {column.symbol: column for column in series}
    units = {name: by_name[name].unit for name in record.indications}
    values = {name: by_name[name].values for name in record.indications}  # noqa: PD011  a Series of ours
    loads = record.apply(values, units=units, tare=tare, draft=draft, step=step)
    loads = dataclasses.replace(loads, findings=(*loads.findings, *of_file))
    step(f"writing {out.name}")
    write_applied(out, applied_columns(series, loads), loads.use)
    ranges = {name: _range(loads, name) for name in loads.value}
    rows = len(series[0].values)
    payload: ApplyAnswer = {
        "out": out, "rows": rows, "calibration": loads.use.as_dict(), "mark": loads.use.mark, "loads": ranges,
        "findings": [finding.as_dict() for finding in loads.findings],
    }  # fmt: skip
    lines = [f"{one_line(out)}: {rows} rows by {record.id} ({loads.use.status})"]
    lines += [f"  {name:4s} {_range_text(span)}" for name, span in ranges.items()]
    lines += [loads.use.mark] if loads.use.mark else []
    lines += finding_lines(loads.findings)
    return payload, "\n".join(lines), loads


def _range(loads: Loads, name: str) -> AppliedRange:
    values, U = loads.value[name], loads.U[name]
    return {
        "unit": loads.units[name], "least": float(values.min()), "largest": float(values.max()),
        "U_largest": float(U.max()),
    }  # fmt: skip


def _range_text(span: Mapping[str, Any]) -> str:
    unit, U = span["unit"], span["U_largest"]
    text = f"{span['least']:.6g} to {span['largest']:.6g} {unit}, "
    return text + ("U not determined" if np.isnan(U) else f"U up to {U:.2g} {unit}")
