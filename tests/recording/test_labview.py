"""Writing in the machine's own layout, and the packaged rows of Figure 4.4."""

from __future__ import annotations

import csv
import datetime as dt
import io
import zipfile
from pathlib import Path

import numpy as np
import openpyxl
import pytest

from tests.recording.fig4_4 import ROWS, SPREADSHEET_ROWS, SYMBOLS, write_fig4_4
from toolkit.errors import OutputError
from toolkit.examples import NAMES, packaged_fig4_4
from toolkit.machine import load_machine
from toolkit.recording import machine_of, read_recording
from toolkit.recording.labview import write_labview

VIRTUAL = load_machine("m15-virtual")
SHARED = Path(__file__).resolve().parents[3] / "shared" / "data" / "m15_fig4_4" / "fig4_4.csv"


def columns(rows: int = 20) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(7)
    return {column.symbol: rng.normal(0, 1, rows) for column in VIRTUAL.columns}


@pytest.mark.parametrize("simulated", [True, False])
def test_what_is_written_is_read(tmp_path, simulated):
    path, given = tmp_path / "no extension", columns()
    write_labview(path, VIRTUAL, given, simulated=simulated)
    recording = read_recording(path, VIRTUAL, reader="both")
    for symbol, values in given.items():
        np.testing.assert_array_equal(recording[symbol].values, values)  # every bit
    assert machine_of(path) == "m15-virtual"
    book = openpyxl.load_workbook(io.BytesIO(path.read_bytes()))
    assert book.sheetnames == (["simulated"] if simulated else ["Sheet1"])
    assert [cell.value for cell in book.active[1]] == [column.header for column in VIRTUAL.columns]


def test_the_same_content_is_the_same_bytes(tmp_path):
    for name in ("a", "b"):
        write_labview(tmp_path / name, VIRTUAL, columns(), simulated=True)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    write_labview(
        tmp_path / "c", VIRTUAL, columns(), simulated=True, created=dt.datetime(2020, 1, 2, tzinfo=dt.UTC)
    )
    with zipfile.ZipFile(tmp_path / "c") as archive:
        core = archive.read("docProps/core.xml")
    assert core.count(b"2020-01-02T00:00:00Z") == 2


def test_optional_and_extra_columns(tmp_path):
    given = columns()
    del given["FY"], given["MZ"]
    given["t [s]"] = np.arange(20) / 100
    write_labview(tmp_path / "a", VIRTUAL, given, simulated=True)
    recording = read_recording(tmp_path / "a", VIRTUAL)
    assert recording["t"].role == "time"
    assert not recording.has("FY")


def test_nothing_is_written_where_something_is_wrong(tmp_path):
    bad = columns()
    del bad["E5"]
    for given in (
        bad,
        {**columns(), "E6": np.zeros(20)},
        {**columns(), "E5": np.zeros(3)},
        {**columns(), "E5": np.full(20, np.nan)},
        {symbol: np.zeros(0) for symbol in columns()},
    ):
        with pytest.raises(OutputError):
            write_labview(tmp_path / "a", VIRTUAL, given, simulated=True)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("path", packaged_fig4_4(), ids=NAMES)
def test_the_packaged_recording(path):
    recording = read_recording(path, load_machine("m15"), reader="both")
    assert tuple(one.symbol for one in recording.series) == SYMBOLS
    assert [one.unit for one in recording.series] == ["lbf"] * 4 + ["deg", "lbf", "lbf*ft"]
    np.testing.assert_array_equal(np.column_stack([one.values for one in recording.series]), ROWS)
    assert not recording.simulated


def test_the_packaged_files_are_those_of_the_table(tmp_path):
    # Member by member: compressed bytes may change with the version of zlib.
    for made, packaged in zip(write_fig4_4(tmp_path), packaged_fig4_4(), strict=True):
        with zipfile.ZipFile(made) as one, zipfile.ZipFile(packaged) as other:
            assert one.namelist() == other.namelist()
            for name in one.namelist():
                if name != "docProps/app.xml":  # names the version of openpyxl
                    assert one.read(name) == other.read(name), name


def test_the_table_is_the_transcription():
    if not SHARED.is_file():
        pytest.skip("the transcription of Figure 4.4 is not on this machine")
    with SHARED.open(newline="") as stream:
        rows = list(csv.reader(stream))[1:]
    assert tuple(int(row[0]) for row in rows) == SPREADSHEET_ROWS
    assert tuple(tuple(map(float, row[1:])) for row in rows) == ROWS
