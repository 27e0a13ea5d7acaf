"""Sessions whose data come from a spreadsheet or a program of any country: one reading, or a refusal."""

from __future__ import annotations

import csv
import datetime as dt
import io
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import openpyxl
import pytest

from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.stored import stored_check, stored_loads, stored_session
from toolkit.calibration.registry.verify import verify_registry
from toolkit.calibration.session.read import Session, read_session
from toolkit.calibration.session.table import Table, read_table
from toolkit.errors import SessionError, ToolkitError

Make = Callable[..., Path]
Rows = list[list[str]]
NUMBERS = 6  # columns of the factory's sessions that are numbers with decimals


def rows_of(path: Path) -> Rows:
    return list(csv.reader(path.read_text().splitlines()))


def text_of(rows: Sequence[Sequence[str]], separator: str, decimal: str, encoding: str) -> bytes:
    lines = (separator.join(cell.replace(".", decimal) for cell in row) for row in rows[1:])
    return ("\n".join([separator.join(rows[0]), *lines]) + "\n").encode(encoding)


def workbook(rows: Sequence[Sequence[Any]], change: Callable[[Any], None] | None = None) -> bytes:
    book = openpyxl.Workbook()
    for row in rows:
        book.active.append(list(row))
    if change:
        change(book.active)
    stream = io.BytesIO()
    book.save(stream)
    return stream.getvalue()


def typed(rows: Rows) -> list[list[Any]]:
    """The rows as a spreadsheet holds them: numbers as numbers, runs as 1.0."""
    return [rows[0], *[[*map(float, row[: NUMBERS + 1]), *row[NUMBERS + 1 :]] for row in rows[1:]]]


def replace(session: Path, key: str, data: bytes, suffix: str = "csv") -> None:
    """Exchange a session's data file, under another name where the suffix is another."""
    old = "loads.csv" if key == "data" else "check.csv"
    (session.parent / old).unlink()
    new = old.replace("csv", suffix)
    (session.parent / new).write_bytes(data)
    session.write_text(session.read_text().replace(f'"{old}"', f'"{new}"'))


def same(one: Session, other: Session) -> None:
    for mine, theirs in ((one.table, other.table), (one.check, other.check)):
        assert mine is not None
        assert theirs is not None
        assert (mine.names, mine.units) == (theirs.names, theirs.units)
        np.testing.assert_array_equal(mine.values, theirs.values)
    assert one.table.direction == other.table.direction


@pytest.mark.parametrize(
    ("separator", "decimal"), [(",", "."), (";", "."), (";", ","), ("\t", ","), ("\t", ".")]
)
@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "cp1252"])
def test_every_dialect_gives_the_same_session(
    make_session: Make, separator: str, decimal: str, encoding: str
) -> None:
    plain = read_session(make_session(name="plain"))
    path = make_session()
    for key, name in (("data", "loads.csv"), ("check", "check.csv")):
        rows = rows_of(path.parent / name)
        notes = ["comment", *(f'"20 °C, Prüfer {at}"' for at in range(len(rows) - 1))]
        rows = [[*row, note] for row, note in zip(rows, notes, strict=True)]
        replace(path, key, text_of(rows, separator, decimal, encoding))
    same(read_session(path), plain)


def test_a_workbook_is_kept_as_it_was_and_refitted_from_its_own_bytes(
    tmp_path: Path, make_session: Make
) -> None:
    plain = calibrate(make_session(name="plain"), Registry(tmp_path / "plain_cal")).record
    path = make_session()
    data = {}
    for key, name in (("data", "loads.csv"), ("check", "check.csv")):
        rows = rows_of(path.parent / name)
        cells = typed(rows) if key == "data" else [rows[0], *[list(map(float, row)) for row in rows[1:]]]
        data[key] = workbook([[*row, "" if at else "Comment"] for at, row in enumerate(cells)])
        replace(path, key, data[key], "xlsx")
    registry = Registry(tmp_path / "cal")
    made = calibrate(path, registry)
    record = made.record
    assert [one.coefficients for one in record.loads] == [one.coefficients for one in plain.loads]
    files = {one.role: one.file for one in record.data}
    assert files == {
        "loads": "hub-r1.loads.xlsx",
        "check": "hub-r1.check.xlsx",
        "session": "hub-r1.session.toml",
    }
    folder = registry.folder / "hub"
    assert [(folder / files[role]).read_bytes() for role in ("loads", "check")] == list(data.values())
    assert registry.load("hub-r1") == record
    assert [row.ok for row in verify_registry(registry)] == [True]
    loads, check = stored_loads(registry.folder, record), stored_check(registry.folder, record)
    assert loads is not None
    assert check is not None
    np.testing.assert_array_equal(loads.values, read_session(path).table.values)
    same(stored_session(registry.folder, record), read_session(path))
    assert calibrate(path, registry).existing
    # One changed byte of the workbook is a record that may not be used.
    changed = bytearray(data["data"])
    changed[-1] ^= 1
    (folder / files["loads"]).write_bytes(bytes(changed))
    assert [row.ok for row in verify_registry(registry)] == [False]


def table(data: bytes, *, runs: bool = True, optional: Sequence[str] = ()) -> Table:
    return read_table(data, where="loads.xlsx", required=["S", "FY"], optional=optional, runs=runs)


SHEET: list[list[Any]] = [
    ["S [mV/V]", "FY [kN]", "run", "direction"],
    [0.1, 10.0, 1.0, "Up"],
    [0.2, 20.0, 1.0, "up "],
    [0.15, 15.5, 2.0, "DOWN"],
]


def with_header(*header: Any) -> list[list[Any]]:
    return [list(header), *SHEET[1:]]


def right_of_data(sheet: Any) -> None:
    # Cells that were formatted and never filled: a used area wider and longer than the data.
    for place in ("G3", "B40"):
        sheet[place].number_format = "0.00"
        sheet[place].value = None
    sheet["F6"] = " "


SHEETS: list[tuple[list[list[Any]], Callable[[Any], None] | None]] = [
    (SHEET, None),
    (SHEET, right_of_data),
    (with_header("S (mV/V)", "FY (kN)", "Run", "Direction"), None),
    (with_header("s [mV/V]", "Fy\n[kN]", "RUN", "direction"), None),
    ([["S", "FY", "run", "direction"], ["mV/V", "kN", None, None], *SHEET[1:]], None),
    ([["S", "FY", "run", "direction"], ["[mV/V]", "(kN)", "-", ""], *SHEET[1:]], None),
    ([*SHEET[:2], [None] * 4, *SHEET[2:], [None] * 4], None),
    ([[None, *row] for row in SHEET], None),
    ([[row[0], str(row[1]).replace(".", ",") if at else row[1], *row[2:]] for at, row in enumerate(SHEET)],
     None),
    ([[row[0], str(row[1]), str(row[2]), row[3]] for row in SHEET], None),
]  # fmt: skip


@pytest.mark.parametrize(("rows", "change"), SHEETS)
def test_what_a_spreadsheet_adds_changes_no_number(
    rows: list[list[Any]], change: Callable[[Any], None] | None
) -> None:
    found = table(workbook(rows, change))
    np.testing.assert_array_equal(found.values, [[0.1, 10], [0.2, 20], [0.15, 15.5]])
    assert (found.names, found.units) == (("S", "FY"), ("mV/V", "kN"))
    assert found.direction == ("up", "up", "down")
    assert found.run is not None
    assert found.run.tolist() == [1, 1, 2]


def changed(row: int, column: int, value: Any) -> list[list[Any]]:
    rows = [list(one) for one in SHEET]
    rows[row][column] = value
    return rows


@pytest.mark.parametrize(
    ("rows", "where", "got"),
    [
        (changed(2, 1, None), "row 2 (cell B3), column FY", "an empty cell"),
        (changed(2, 1, "nan"), "row 2 (cell B3), column FY", "nan"),
        (changed(2, 1, "1,234.5"), "row 2 (cell B3), column FY", "1,234.5"),
        (changed(2, 1, "1.234,5"), "row 2 (cell B3), column FY", "1.234,5"),
        (changed(2, 1, "1 234"), "row 2 (cell B3), column FY", "1 234"),
        (changed(2, 1, "20 kN"), "row 2 (cell B3), column FY", "20 kN"),
        (changed(2, 1, True), "row 2 (cell B3), column FY", "True"),
        (changed(2, 1, dt.date(2026, 1, 5)), "row 2 (cell B3), column FY", "2026-01-05"),
        (changed(2, 2, 1.5), "row 2 (cell C3), column run", "1.5"),
        (changed(2, 3, "sideways"), "row 2 (cell D3), column direction", "sideways"),
        (changed(2, 1, "#DIV/0!"), "cell B3", "#DIV/0!"),
        (changed(2, 1, "1,234"), "row 2 (cell B3), column FY", "1,234"),
    ],
)
def test_a_cell_of_a_workbook_that_is_no_number_is_told_where_it_stands(
    rows: list[list[Any]], where: str, got: str
) -> None:
    error = refusal(workbook(rows))
    assert where in str(error.where)
    assert got in str(error.got)
    assert all(error.as_dict().values())


def test_a_formula_that_was_never_computed_is_no_number() -> None:
    error = refusal(workbook(changed(2, 1, "=B2*2")))
    assert "row 2 (cell B3)" in str(error.where)
    assert "a formula has a value only once" in str(error.next_step)


def test_merged_cells_are_named() -> None:
    error = refusal(workbook(SHEET, lambda sheet: sheet.merge_cells("B2:B3")))
    assert "row 2 (cell B3)" in str(error.where)
    assert "unmerge" in str(error.next_step)


@pytest.mark.parametrize(
    ("rows", "word"),
    [
        (with_header("S [mV/V]", None, "run", "direction"), "a column has no header"),
        (with_header("S", "FY", "run", "direction"), "has no unit"),
        ([["Calibration of the hub"], *SHEET], "first row is no header"),
        ([SHEET[0]], "no rows"),
        ([[*SHEET[0], "fy [N]"], *[[*row, 1.0] for row in SHEET[1:]]], "stands twice"),
        ([[*SHEET[0], "coment"], *[[*row, "x"] for row in SHEET[1:]]], "unknown column 'coment'"),
    ],
)
def test_headers_of_a_workbook(rows: list[list[Any]], word: str) -> None:
    assert word in refusal(workbook(rows)).what


def test_commas_that_may_stand_between_thousands_are_refused_where_they_stand() -> None:
    error = refusal(b"S [mV/V];FY [kN];run;direction\n1;2;1;up\n1,234;1,500;1;up\n")
    assert (error.rule, error.where) == ("ambiguous-text", "loads.xlsx, row 2 (line 3), column S")
    counts = "S [counts];FY [N];run;direction\n-33010;1.500;1;up\n-66020;3.000;1;up\n"
    error = refusal(counts.encode())
    assert (error.rule, error.where) == ("ambiguous-text", "loads.xlsx, row 1 (line 2), column FY")
    # One number that cannot be in thousands decides, as do commas between the cells.
    decided = counts.replace("3.000", "3.0")
    for text in (decided, counts.replace(";", ",")):
        np.testing.assert_array_equal(table(text.encode()).column("FY"), [1.5, 3.0])


def refusal(data: bytes) -> SessionError:
    with pytest.raises(SessionError) as caught:
        table(data)
    return caught.value


def test_the_columns_that_may_stand_are_listed() -> None:
    rows = [[*SHEET[0], "u_Fx [N]"], *[[*row, 1.0] for row in SHEET[1:]]]
    with pytest.raises(SessionError) as caught:
        table(workbook(rows), optional=["u_FY"])
    assert caught.value.expected == "S, FY, run, direction, u_FY, rotation, comment"
    assert "did you mean 'u_FY'?" in str(caught.value.next_step)


def test_runs_and_directions_of_check_loads_are_passed_over() -> None:
    found = table(workbook(changed(2, 2, "check")), runs=False)
    assert (found.run, found.up, found.names) == (None, None, ("S", "FY"))


def bomb() -> bytes:
    stream = io.BytesIO()
    with (
        zipfile.ZipFile(io.BytesIO(workbook(SHEET))) as whole,
        zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as packed,
    ):
        for name in whole.namelist():
            packed.writestr(name, whole.read(name))
        packed.writestr("xl/media/more.bin", bytes(40 * 2**20))
    return stream.getvalue()


@pytest.mark.parametrize(
    ("data", "rule"),
    [
        (workbook(SHEET, lambda sheet: sheet.cell(1_000_000, 9_000, 1.0)), "far-cell"),
        (bomb(), "inflation"),
        (workbook(SHEET)[:700], "zip-truncated"),
        (b"%PDF-1.7 ...", "not-a-workbook"),
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(600), "not-a-workbook"),
        (b"LabVIEW Measurement\t\n", "not-a-workbook"),
        (b"<html><table>", "not-a-workbook"),
        (b'S [mV/V];FY [kN];run;direction;comment\n1;2;1;up;"open\n', "unreadable"),
        ("S [mV/V],FY [kN],run,direction\n1,2,1,up\n".encode("utf-16")[:-1], "encoding"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_hostile_and_foreign_files_are_refused_whole(
    tmp_path: Path, make_session: Make, data: bytes, rule: str
) -> None:
    path = make_session()
    replace(path, "data", data)
    with pytest.raises(SessionError) as caught:
        calibrate(path, Registry(tmp_path / "cal"))
    assert caught.value.rule == rule
    assert all(caught.value.as_dict().values())
    assert "nothing was written" in str(caught.value.next_step)
    assert not (tmp_path / "cal").exists()


def test_a_file_without_end_is_never_read(tmp_path: Path, make_session: Make) -> None:
    path = make_session()
    with (path.parent / "loads.csv").open("r+b") as stream:
        stream.truncate(2**34)  # a hole: no byte of it is on the disk
    with pytest.raises(ToolkitError) as caught:
        calibrate(path, Registry(tmp_path / "cal"))
    assert caught.value.rule == "too-large"
