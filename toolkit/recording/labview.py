"""Write recordings as the machine's acquisition program does: one .xlsx, one header row, plain numbers."""

from __future__ import annotations

import datetime as dt
import functools
import io
import re
import zipfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from toolkit.arrays import Array
from toolkit.errors import OutputError
from toolkit.machine import Machine
from toolkit.publication import write_result
from toolkit.recording.cells import reference
from toolkit.recording.marks import GENERATOR, STAMP, recording_keywords

SIMULATED_SHEET = "simulated"
_SHEET = "Sheet1"
_ZIP_STAMP = (1980, 1, 1, 0, 0, 0)
_MODIFIED = re.compile(rb"(<dcterms:modified[^>]*>)[^<]*(<)")
_OPTIONAL_ROLES = ("acquired",)


def write_labview(
    path: Path,
    machine: Machine,
    columns: Mapping[str, Array],
    *,
    simulated: bool,
    title: str | None = None,
    created: dt.datetime = STAMP,
) -> None:
    """Write a recording in the machine's own layout, whole or not at all.

    Parameters
    ----------
    path : the file; any name, with or without an extension
    columns : symbol -> values (rows,) in the units of the machine's files, written as given: rounding to
        the printed digits is the caller's. A key ``NAME [unit]`` adds a column with that header. Computed
        columns (FY, MZ) may be left out; the order of columns is the machine's.
    simulated : marks the file for readers (core properties) and for people (name of the sheet)
    title, created : core properties; nothing else in the file depends on when it was written

    Raises
    ------
    OutputError
        a column is missing or unknown, columns differ in length, a value is not finite, or the file cannot
        be written
    """
    names = _layout(path, machine, columns)
    headers = tuple(machine.column(name).header if "[" not in name else name for name in names)
    values = [np.asarray(columns[name], dtype=np.float64) for name in names]
    _check(path, names, values)
    shell = _shell(
        headers,
        sheet=SIMULATED_SHEET if simulated else _SHEET,
        title=title or f"{machine.title}{' - SIMULATED' if simulated else ''}",
        keywords=recording_keywords(machine=machine.name, simulated=simulated),
        created=created,
    )
    write_result(path, _filled(shell, _rows_xml(values), created))


@functools.lru_cache(maxsize=4)
def _shell(headers: tuple[str, ...], *, sheet: str, title: str, keywords: str, created: dt.datetime) -> bytes:
    """Return a workbook with the head alone: that of the next file of a test is most often the same."""
    from openpyxl import Workbook
    from openpyxl.cell import WriteOnlyCell

    book = Workbook(write_only=True)
    page = book.create_sheet(sheet)
    cells = []
    for header in headers:
        cell = WriteOnlyCell(page, value=header)
        cell.data_type = "s"  # a header that begins with = is a text all the same
        cells.append(cell)
    page.append(cells)
    properties = book.properties
    properties.creator = GENERATOR
    properties.lastModifiedBy = GENERATOR
    properties.title = title
    properties.keywords = keywords
    properties.created = created.replace(tzinfo=None)
    stream = io.BytesIO()
    book.save(stream)
    return stream.getvalue()


def _rows_xml(values: list[Array]) -> bytes:
    # openpyxl writes 16 digits, one too few for a double; repr has as many as are needed.
    letters = [reference(1, column + 1)[:-1] for column in range(len(values))]
    lines = []
    for row, numbers in enumerate(np.column_stack(values).tolist(), start=2):
        cells = "".join(
            f'<c r="{letter}{row}"><v>{number!r}</v></c>'
            for letter, number in zip(letters, numbers, strict=True)
        )
        lines.append(f'<row r="{row}">{cells}</row>')
    return "".join(lines).encode()


def _filled(shell: bytes, rows: bytes, created: dt.datetime) -> bytes:
    # openpyxl stamps members and properties with the present time; equal content shall be equal bytes.
    stamp = created.strftime("%Y-%m-%dT%H:%M:%SZ").encode()
    stream = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(shell)) as source, zipfile.ZipFile(stream, "w") as target:
        for name in source.namelist():
            content = source.read(name)
            if name == "docProps/core.xml":
                content = _MODIFIED.sub(rb"\g<1>" + stamp + rb"\g<2>", content)
            elif name.startswith("xl/worksheets/"):
                head, end, tail = content.partition(b"</sheetData>")
                content = head + rows + end + tail
            info = zipfile.ZipInfo(name, date_time=_ZIP_STAMP)
            info.compress_type = zipfile.ZIP_DEFLATED
            target.writestr(info, content)
    return stream.getvalue()


def _layout(path: Path, machine: Machine, columns: Mapping[str, Array]) -> list[str]:
    by_symbol = {column.symbol: column for column in machine.columns}
    wrong = [name for name in columns if name not in by_symbol and "[" not in name]
    missing = [
        n for n, column in by_symbol.items() if n not in columns and column.role not in _OPTIONAL_ROLES
    ]
    if wrong or missing:
        raise OutputError(
            "the columns are not those of the machine",
            where=path,
            got=", ".join(columns),
            expected=", ".join(by_symbol),
            next_step=f"add {missing}" if missing else f"write {wrong} as 'NAME [unit]'",
        )
    return [name for name in by_symbol if name in columns] + [name for name in columns if "[" in name]


def _check(path: Path, names: list[str], values: list[Array]) -> None:
    rows = values[0].shape
    for name, value in zip(names, values, strict=True):
        if value.shape != rows or value.ndim != 1 or not len(value):
            raise OutputError(
                f"column {name} has another shape than the rest", where=path, got=value.shape, expected=rows,
                next_step="give one value a row for every column",
            )  # fmt: skip
        if not np.isfinite(value).all():
            raise OutputError(
                f"column {name} has a value that is not finite",
                where=path,
                got=value[~np.isfinite(value)][0],
                expected="finite numbers; the reader refuses anything else",
                next_step="find out where it was computed",
            )
