"""TDMS, LVM, MDF 4 and MAT-files: the same columns as the same rows in CSV, or a refusal with every part."""

from __future__ import annotations

import io
import sys

import nptdms
import numpy as np
import pytest

from tests.recording.format_checks import ROWS, refused, same
from tests.recording.format_factory import UNITS, csv, every, lvm, mat, mdf, signals, tdms
from toolkit.errors import CellError, ColumnError, ConfigError, ToolkitError
from toolkit.recording.formats.vectors import quantum


def test_every_format_gives_the_columns_and_units_of_the_same_rows_in_csv(read, table):
    wanted = read(csv(table))
    for name, data in every(table).items():
        found = read(data, name)
        same(found, table)
        assert {s.symbol: s.unit for s in found.series if s.symbol != "t"} == {
            s.symbol: s.unit for s in wanted.series
        }


def test_the_name_of_a_file_says_nothing(read, table):
    for data in every(table).values():
        same(read(data, "run.xlsx"), table)


def test_only_a_stored_time_is_a_channel(read, table):
    files = every(table)
    assert not read(files["run.tdms"]).has("t")  # a waveform's increment is implied
    assert not read(lvm(table, x="No")).has("t")
    for data in (files["run.mf4"], files["run.lvm"], lvm(table, x="Multi")):
        np.testing.assert_allclose(read(data)["t"].si, np.arange(ROWS) * 0.01, rtol=0, atol=1e-12)


def test_a_unit_in_the_name_and_another_beside_it(read, table):
    data = tdms(table | {"FZ": table["FZ"]}, units=UNITS | {"FZ": "N"})
    assert read(data)["FZ"].unit == "N"  # the file's own statement goes before the machine's unit
    stream = io.BytesIO()
    with nptdms.TdmsWriter(stream) as file:
        file.write_segment(
            [nptdms.ChannelObject("run", "FZ [lbf]", table["FZ"], properties={"unit_string": "N"})]
        )
    refused(read, stream.getvalue(), "doubled-unit", ColumnError)


def test_a_unit_of_another_kind_is_refused_in_every_format(read, table):
    wrong = UNITS | {"FZ": "V"}
    for data in (tdms(table, units=wrong), mat(table, units=wrong), mdf(signals(table, units=wrong)),
                 lvm(table, units=wrong)):  # fmt: skip
        refused(read, data, "unit-dimension", ColumnError)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_value_that_is_not_finite(read, table, bad):
    values = table["E5"].copy()
    values[3] = bad
    broken = table | {"E5": values}
    for data in (tdms(broken), mat(broken), mdf(signals(broken))):
        assert "row 4" in refused(read, data, "nan-cell", CellError).where


def test_a_channel_that_ends_early(read, table):
    short = table | {"E5": table["E5"][:-2]}
    for data in (tdms(short), mat(short)):
        assert f"row {ROWS - 1}" in refused(read, data, "empty-cell", CellError).where


def test_a_missing_column_is_named_in_every_format(read, table):
    less = {name: values for name, values in table.items() if name != "E5"}
    for data in every(less).values():
        assert "E5" in refused(read, data, "missing-column", ColumnError).what


@pytest.mark.parametrize(
    ("module", "extra", "name"), [("nptdms", "tdms", "run.tdms"), ("asammdf", "mdf", "run.mf4")]
)
def test_an_absent_library_is_named_with_its_extra(read, table, monkeypatch, module, extra, name):
    data = every(table)[name]

    for loaded in [one for one in sys.modules if one.partition(".")[0] == module]:
        monkeypatch.delitem(sys.modules, loaded)
    monkeypatch.setattr(sys, "meta_path", [_Absent(module), *sys.meta_path])
    error = refused(read, data, "missing-extra", ConfigError)
    assert error.next_step == f'pip install "tire-lab-toolkit[{extra}]"'


class _Absent:
    """An import finder that knows one library to be missing."""

    def __init__(self, module):
        self.module = module

    def find_spec(self, name, *_):
        if name.partition(".")[0] == self.module:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # a library's half-made object
@pytest.mark.parametrize("name", ["run.tdms", "run.mat", "table.mat", "run.mf4", "packed.mf4", "run.lvm"])
def test_a_damaged_file_is_read_or_refused_and_never_a_crash(read, table, name):
    rng = np.random.default_rng(11)
    whole = every(table)[name]
    refusals = []
    for _ in range(120):
        data = bytearray(whole)
        for _ in range(rng.integers(1, 5)):
            data[rng.integers(len(data))] = rng.integers(256)
        try:
            assert read(bytes(data[: rng.integers(len(data) // 2, len(data) + 1)])).rows <= ROWS
        except ToolkitError as error:
            refusals.append(error)
    assert len(refusals) > 20
    assert all(one.rule and one.where and one.got and one.expected and one.next_step for one in refusals)


def test_half_a_step_of_what_is_stored():
    exact = np.array([1.5, 2.5, 4.0])
    assert quantum(exact, exact) is None
    counts = np.array([1, 2, 7], dtype=np.int32)
    assert quantum(counts, counts) is None  # the digits of whole numbers show
    np.testing.assert_allclose(quantum(counts, counts * 0.5 - 1), 0.25)
    assert quantum(counts, counts**2.0) is None  # not linear: nothing is claimed
    single = np.array([1.0, 3.0], dtype=np.float32)
    np.testing.assert_array_equal(quantum(single, single), [2.0**-24, 2.0**-23])
