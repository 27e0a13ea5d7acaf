"""Write a whole test into one .xlsx file.

Rows of plain values are written straight into the sheets of a workbook that has their heads: openpyxl builds
an object and its elements for every cell, which takes ten times as long.
"""

from __future__ import annotations

import dataclasses
import functools
import io
import itertools
import math
import re
import shutil
import tempfile
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from io import BytesIO
from pathlib import Path
from typing import IO, Any

from toolkit.characteristics.characteristic import BOTH
from toolkit.characteristics.sweep_fit import SweepFit
from toolkit.errors import OutputError
from toolkit.estimate import Estimate
from toolkit.findings import Finding
from toolkit.pipeline import TestResult
from toolkit.publication import write_result
from toolkit.recording.cells import reference
from toolkit.recording.marks import mark_workbook
from toolkit.recording.model import Recording
from toolkit.testfile.layout import (
    CONDITION_FIELDS,
    DIGEST,
    HUB,
    KIND,
    SCHEMA,
    SWEEPS,
    CellsHash,
    cell,
    header,
)
from toolkit.testfile.readable import Sheet, Shown, readable_sheets
from toolkit.tires.model import CurveFit

Rows = Iterable[Sequence[Any]]

_SHEET_ROWS = 2**20 - 1  # below the head: a worksheet has 2^20 rows
_AT_A_TIME = 1 << 12  # rows, as objects
_LOOKED_AT, _WIDEST = 20, 90  # rows that set the width of a column, and its most [characters]


def write_test_file(path: Path, result: TestResult, recordings: Mapping[str, Recording] | None = None) -> str:
    """Write the file whole or not at all and return the content's SHA-256.

    ``recordings`` (by their path inside the test) fill the sheet ``raw`` with every row of every file, in the
    file's own units; beyond a worksheet's rows it goes on in ``raw 2``.
    """
    content, digest = workbook(result, recordings)
    write_result(path, content)
    return digest


def workbook(result: TestResult, recordings: Mapping[str, Recording] | None = None) -> tuple[bytes, str]:
    """Return the file that `write_test_file` writes, and the SHA-256 of its cells."""
    from lxml.etree import SerialisationError

    try:
        with ExitStack() as files:
            return _workbook(result, recordings or {}, files)
    except (OSError, SerialisationError) as error:  # the latter where lxml writes a sheet by itself
        raise OutputError(
            "the reduced test cannot be put together",
            where=f"the folder for temporary files, {tempfile.gettempdir()}",
            got=getattr(error, "strerror", None) or error,
            expected="free space for temporary files",
            next_step="free space, or name another folder in TMPDIR; nothing was changed",
        ) from error


def _workbook(result: TestResult, recordings: Mapping[str, Recording], files: ExitStack) -> tuple[bytes, str]:
    """Return the file's bytes and hash; ``files`` holds its rows while they are put together."""
    from openpyxl import Workbook

    book = Workbook(write_only=True)
    files.callback(_abandon, book)
    bodies: dict[str, IO[bytes]] = {}
    cells = CellsHash()
    use, info = result.reduced.calibration, result.reduced.info
    mark_workbook(book, simulated=info.simulated, machine=info.machine, word=use.word)
    for page in readable_sheets(result):
        _readable(book, page, use.mark, cells)
    for name, rows in (
        ("findings", _findings(result.reduced.findings)),
        ("reduced", _reduced(result)),
        ("fits", _fits(result)),
        ("fit_parameters", _parameters(result)),
        ("fit_covariance", _covariances(result)),
        ("characteristics", _characteristics(result)),
        ("at_angles", _at_angles(result)),
        ("points", _points(result)),
        ("budgets", _budgets(result)),
        ("characteristic_findings", _findings(result.characteristics.findings)),
        *([(SWEEPS, _sweeps(result))] if result.characteristics.sweeps else []),
        *_raw_sheets(recordings),
        ("provenance", _sealed(_provenance(result), cells)),  # last: it has the hash of all
    ):
        body = files.enter_context(tempfile.TemporaryFile())  # noqa: SIM115  closed with the others
        _machine_sheet(book, name, cells.rows(name, rows), use.mark, body)
        bodies[f"sheet{len(book.worksheets)}.xml"] = body
    shell = BytesIO()
    book.save(shell)
    return filled(shell.getvalue(), bodies), cells.hexdigest()


def _abandon(book: Any) -> None:
    """End what is still being written: Python prints each end that fails after the first error."""
    for sheet in book.worksheets:
        for stream in (sheet._rows, sheet._writer and sheet._writer.xf):
            with suppress(Exception):
                if stream is not None:
                    stream.close()


def _sealed(provenance: Rows, cells: CellsHash) -> Rows:
    """Yield the last sheet's rows with the hash of all cells; asked for once those before it are entered."""
    rows = list(cells.rows("provenance", provenance))
    digest = cells.hexdigest()
    yield from ((DIGEST, digest) if row[0] == DIGEST else row for row in rows)


def _sheet(book: Any, name: str, mark: str | None) -> Any:
    sheet = book.create_sheet(name)
    if mark is not None:
        # In the header of every printed page; "&" begins a code of the format there.
        sheet.oddHeader.center.text = mark.replace("&", "&&")
    return sheet


def _readable(book: Any, page: Sheet, mark: str | None, cells: CellsHash) -> None:
    """Write a sheet for people: one page wide in print, its head frozen and repeated, with a filter."""
    from openpyxl.worksheet.properties import PageSetupProperties

    sheet = _sheet(book, page.name, mark)
    sheet.sheet_view.showGridLines = bool(page.head)
    sheet.page_setup.orientation = "landscape" if page.head else "portrait"
    sheet.page_setup.paperSize = 9  # A4
    sheet.page_setup.fitToHeight = 0
    sheet.sheet_properties.pageSetUpPr = PageSetupProperties(fitToPage=True)
    for column, width in enumerate(page.widths):
        sheet.column_dimensions[_letter(column)].width = width
    if page.head:
        sheet.freeze_panes = "A2"
        sheet.print_title_rows = "1:1"
        sheet.auto_filter.ref = f"A1:{_letter(len(page.head) - 1)}{len(page.rows) + 1}"
        numbers = {at for row in page.rows for at, value in enumerate(row) if isinstance(value, Shown)}
        head = [
            Shown(value=text, bold=True, side="right" if at in numbers else None)
            for at, text in enumerate(page.head)
        ]
    rows = [*([head] if page.head else []), *page.rows]
    shown = [[value if isinstance(value, Shown) else Shown(value=value) for value in row] for row in rows]
    for row, _ in zip(
        shown, cells.rows(page.name, ([value.value for value in row] for row in shown)), strict=True
    ):
        sheet.append([_cell(sheet, value) for value in row])


def _machine_sheet(book: Any, name: str, rows: Rows, mark: str | None, body: IO[bytes]) -> None:
    """Begin a sheet for programs, its head frozen and with a filter; what is below goes into ``body``."""
    sheet = _sheet(book, name, mark)
    sheet.freeze_panes = "A2"
    lines = iter(rows)
    first = list(itertools.islice(lines, _LOOKED_AT))
    for column, texts in enumerate(zip(*first, strict=True)):
        longest = max(len(str(text)) for text in texts if isinstance(text, str) or text is texts[0])
        sheet.column_dimensions[_letter(column)].width = max(11, min(longest + 2, _WIDEST))
    sheet.append([_cell(sheet, Shown(value=text, bold=True)) for text in first[0]])
    count = 1
    for count, row in enumerate(itertools.chain(first[1:], lines), start=2):
        body.write(sheet_row(count, [cell(value) for value in row]))
    sheet.auto_filter.ref = f"A1:{_letter(len(first[0]) - 1)}{count}"


def _cell(sheet: Any, shown: Shown) -> Any:
    """Return a value as a sheet for people takes it."""
    from openpyxl.cell import WriteOnlyCell
    from openpyxl.styles import Alignment, Font

    content = cell(shown.value)
    # openpyxl writes 16 digits; a double that needs 17 is given as its own shortest decimal, typed as the
    # number that it is. A text is a text even where it begins like a formula: openpyxl would guess otherwise.
    long = isinstance(content, float) and float(f"{content:.16g}") != content
    styled = WriteOnlyCell(sheet, value=repr(content) if long else content)
    if isinstance(styled.value, str):
        styled.data_type = "n" if long else "s"
    if shown.number_format != "General":
        styled.number_format = shown.number_format
    if shown.bold or shown.size or shown.warning:
        colour = "B3261E" if shown.warning else None
        styled.font = Font(name="Calibri", bold=shown.bold, size=shown.size or 11, color=colour)
    if shown.side:
        styled.alignment = Alignment(horizontal=shown.side)
    return styled


def _letter(column: int) -> str:
    from openpyxl.utils import get_column_letter

    return str(get_column_letter(column + 1))


def _provenance(result: TestResult) -> Rows:
    reduced = result.reduced
    yield ("item", "value")
    yield ("kind", KIND)
    yield ("schema", SCHEMA)
    yield (DIGEST, None)
    if reduced.info.simulated:
        yield ("SIMULATED", "these values come from the virtual machine, not from a tire")
    yield ("code_version", reduced.code_version)
    yield ("axes", reduced.axes)
    yield ("averaging", reduced.averaging)
    yield ("protocol", reduced.protocol)
    yield ("machine_title", reduced.machine_title)
    if reduced.definition:  # by lines: a cell holds no more than some ten thousand characters
        lines = reduced.definition.split("\n")
        yield from ((f"definition.{number}", text) for number, text in enumerate(lines, start=1))
    use = reduced.calibration
    if use.mark is not None:
        yield (str(use.word or "MARK"), use.mark)
    for name in ("id", "sha256", "unverified", "draft", "signature"):
        yield (f"calibration.{name}", getattr(use, name))
    for name, texts in (("draft_reason", use.draft_reasons), ("since", use.since)):
        yield from ((f"calibration.{name}.{number}", text) for number, text in enumerate(texts, start=1))
    yield ("tare.source", reduced.tare.source)
    yield ("tare.unit", reduced.tare.unit)
    for name, value in reduced.tare.values:
        yield (f"tare.values.{name}", value)
    for name, value in reduced.tare.u:
        yield (f"tare.u.{name}", value)
    for statement in reduced.stated:
        for field in dataclasses.fields(statement)[1:]:
            yield (f"stated.{statement.symbol}.{field.name}", getattr(statement, field.name))
    for field in dataclasses.fields(reduced.info):
        yield (f"info.{field.name}", getattr(reduced.info, field.name))


def _reduced(result: TestResult) -> Rows:
    conditions = result.reduced.conditions
    cells = len(conditions[0].indications) if conditions else 0
    hub = [entry.load for entry in conditions[0].hub] if conditions else []
    yield [
        *(header(name) for name in CONDITION_FIELDS),
        *(f"indication_{i + 1}" for i in range(cells)),
        *(header(f"{lead}{HUB}{load}") for load in hub for lead in ("", "u_")),
    ]
    for condition in conditions:
        loads = [number for entry in condition.hub for number in (entry.value, entry.u)]
        yield [*(getattr(condition, name) for name in CONDITION_FIELDS), *condition.indications, *loads]


def _all_fits(result: TestResult) -> list[tuple[str, float, CurveFit]]:
    return [
        (direction.rotation, direction.load_N, fit)
        for direction in result.characteristics.fits
        for fit in (direction.FY, direction.MZ)
        if fit is not None
    ]


def _fits(result: TestResult) -> Rows:
    fits = _all_fits(result)
    plain = [
        field.name
        for field in dataclasses.fields(fits[0][2])
        if field.name not in ("parameters", "covariance", "slope_at_zero", "value_at_zero")
    ] if fits else []  # fmt: skip
    estimates = ("slope_at_zero", "value_at_zero")
    yield [
        "rotation",
        "group_load_N",
        *plain,
        *(f"{name} {part}" for name in estimates for part in ("value", "u", "dof", "unit")),
    ]
    for rotation, load, fit in fits:
        flat = [getattr(fit, name) for name in plain]
        flat = [" ".join(value) if isinstance(value, tuple) else value for value in flat]
        numbers = [part for name in estimates for part in _parts(getattr(fit, name))]
        yield [rotation, load, *flat, *numbers]


def _parts(estimate: Estimate | None) -> list[Any]:
    if estimate is None:
        return [None, None, None, None]
    return [estimate.value, estimate.u, estimate.dof, estimate.unit]


def _parameters(result: TestResult) -> Rows:
    yield ("fit", "parameter", "value", "standard_error", "dof", "low_95", "high_95", "unit")
    for index, (_, _, fit) in enumerate(_all_fits(result)):
        for parameter in fit.parameters:
            low, high = parameter.interval95 or (None, None)
            yield (
                index,
                parameter.name,
                parameter.value,
                parameter.standard_error,
                parameter.dof,
                low,
                high,
                parameter.unit,
            )


def _covariances(result: TestResult) -> Rows:
    yield ("fit", "parameter", "with", "covariance")
    for index, (_, _, fit) in enumerate(_all_fits(result)):
        for parameter, row in zip(fit.parameters, fit.covariance, strict=False):
            for partner, value in zip(fit.parameters, row, strict=False):
                yield (index, parameter.name, partner.name, value)


def _characteristics(result: TestResult) -> Rows:
    yield ("load_N", "rotation", "name", "value", "u", "dof", "unit")
    for direction in result.characteristics.fits:
        yield (direction.load_N, direction.rotation, "group", None, None, None, None)
    rows = [row for row in result.characteristics.rows if row.SA_rad is None]
    for row in sorted(rows, key=lambda row: row.rotation == BOTH):
        yield (row.load_N, row.rotation, row.name, *_parts(row.estimate))


def _at_angles(result: TestResult) -> Rows:
    yield ("load_N", "rotation", "SA_rad", "name", "value", "u", "dof", "unit")
    for row in result.characteristics.rows:
        if row.SA_rad is not None:
            yield (row.load_N, row.rotation, row.SA_rad, row.name, *_parts(row.estimate))


def _points(result: TestResult) -> Rows:
    yield ("file", "first_row", "u_FY [N]", "u_MZ [N*m]")
    for point in result.characteristics.points:
        yield (point.file, point.first_row, point.u_FY, point.u_MZ)


def _budgets(result: TestResult) -> Rows:
    yield ("load_N", "rotation", "name", "source", "u", "unit")
    for row in result.characteristics.rows:
        if row.SA_rad is None and row.estimate is not None:
            for source, u in row.sources or (("", None),):
                yield (row.load_N, row.rotation, row.name, source, u, row.estimate.unit)


def _sweeps(result: TestResult) -> Rows:
    names = [field.name for field in dataclasses.fields(SweepFit)]
    yield names
    for sweep in result.characteristics.sweeps:
        yield [getattr(sweep, name) for name in names]


def _findings(findings: Sequence[Finding]) -> Rows:
    yield ("level", "rule", "where", "message")
    for finding in findings:
        yield (finding.level, finding.rule, finding.where, finding.message)


def _raw_sheets(recordings: Mapping[str, Recording]) -> Iterator[tuple[str, Rows]]:
    # A sheet has so many rows and no more: what is beyond goes on in another one under the same head.
    rows = iter(_raw(recordings))
    head = next(rows)
    count = sum(recording.rows for recording in recordings.values())
    for sheet in range(max(1, math.ceil(count / _SHEET_ROWS))):
        name = "raw" if sheet == 0 else f"raw {sheet + 1}"
        yield name, itertools.chain([head], itertools.islice(rows, _SHEET_ROWS))


def _raw(recordings: Mapping[str, Recording]) -> Rows:
    if not recordings:
        yield ("file", "row")
        return
    columns = list(
        dict.fromkeys((s.symbol, s.unit) for recording in recordings.values() for s in recording.series)
    )
    yield ["file", "row", *(f"{symbol} [{unit}]" for symbol, unit in columns)]
    for name, recording in recordings.items():
        mine = {(s.symbol, s.unit): s.values for s in recording.series}
        for start in range(0, recording.rows, _AT_A_TIME):
            rows = slice(start, min(start + _AT_A_TIME, recording.rows))
            lists = [
                mine[key][rows].tolist() if key in mine else [None] * (rows.stop - start) for key in columns
            ]
            for row, values in enumerate(zip(*lists, strict=True), start=start + 1):
                yield [name, row, *values]


_END = b"</sheetData>"
_MARKUP = str.maketrans({"&": "&amp;", "<": "&lt;", ">": "&gt;", "\r": "&#13;"})
_NO_TEXT = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f]")
_MOST = 32_767  # characters of a cell


def sheet_row(row: int, values: Sequence[float | str | None]) -> bytes:
    """Return the XML of a row (1-based): None is no cell, a text is one even where it begins like a formula.

    A number has 16 digits at most, and 17 where only so many read back as it is.

    Raises
    ------
    ValueError
        a text has a control character, which no worksheet can hold
    """
    cells = [
        _cell_xml(f"{letters}{row}", value)
        for letters, value in zip(_letters(len(values)), values, strict=True)
        if value is not None
    ]
    return f'<row r="{row}">{"".join(cells)}</row>'.encode()


def _cell_xml(place: str, value: float | str) -> str:
    if not isinstance(value, str):
        if isinstance(value, bool):
            return f'<c r="{place}" t="b"><v>{value:d}</v></c>'
        number = f"{value:.16g}"
        exact = number if float(number) == value else float.__repr__(value)
        return f'<c r="{place}" t="n"><v>{exact}</v></c>'
    if _NO_TEXT.search(value):
        raise ValueError(f"{value!r} has a control character, which no worksheet can hold")
    if not value:
        return f'<c r="{place}" t="inlineStr"></c>'
    text = value[:_MOST].translate(_MARKUP)
    space = ' xml:space="preserve"' if value != value.strip() else ""
    return f'<c r="{place}" t="inlineStr"><is><t{space}>{text}</t></is></c>'


@functools.lru_cache(maxsize=64)
def _letters(columns: int) -> tuple[str, ...]:
    return tuple(reference(1, column)[:-1] for column in range(1, columns + 1))


def filled(shell: bytes, bodies: Mapping[str, IO[bytes]]) -> bytes:
    """Return a workbook with rows below those of its sheets; ``bodies`` by member, such as ``sheet1.xml``."""
    stream = io.BytesIO()
    with (
        zipfile.ZipFile(io.BytesIO(shell)) as source,
        zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as target,
    ):
        for info in source.infolist():
            content = source.read(info)
            body = bodies.get(info.filename.removeprefix("xl/worksheets/"))
            if body is None:
                target.writestr(info, content)
                continue
            head, end, tail = content.partition(_END)
            info.file_size = len(content) + body.tell()
            body.seek(0)
            with target.open(info, "w") as member:
                member.write(head)
                shutil.copyfileobj(body, member)
                member.write(end + tail)
    return stream.getvalue()
