"""TDMS, LVM, MDF 4 and MAT-files: the same columns as the same rows in CSV, or a refusal with every part."""

from __future__ import annotations

import io
import struct
import sys
import zlib

import asammdf
import nptdms
import numpy as np
import pytest
import scipy.io
import scipy.sparse
from format_factory import HEADER, UNITS, csv, every, lvm, mat, mdf, signals, tdms

from toolkit.errors import CellError, ColumnError, ConfigError, RecordingError, ToolkitError, UnreadableError
from toolkit.machine import load_machine
from toolkit.recording import read_recording
from toolkit.recording.archive import MAX_TOTAL_BYTES
from toolkit.recording.digits import rounding
from toolkit.recording.formats.vectors import quantum

M15 = load_machine("m15")
ROWS = 12


@pytest.fixture(scope="module")
def table():
    rng = np.random.default_rng(7)
    scale = {"FZ": 1000.0, "SA": 1.0, "MZ": 30.0}
    return {name: np.round(rng.normal(0, scale.get(name, 300.0), ROWS), 4) for name in HEADER}


@pytest.fixture
def read(tmp_path):
    def made(data: bytes, name="a recording"):
        path = tmp_path / name
        path.write_bytes(data)
        return read_recording(path, M15)

    return made


def refused(read, data, rule, kind: type[ToolkitError] = UnreadableError):
    with pytest.raises(kind) as caught:
        read(data)
    error = caught.value
    assert error.rule == rule, str(error)
    assert "a recording" in error.where
    assert error.got
    assert error.expected
    assert error.next_step
    return error


def same(one, table):
    for symbol, values in table.items():
        np.testing.assert_array_equal(one[symbol].values, values)
        assert one[symbol].values.dtype == np.float64
        assert not one[symbol].values.flags.writeable


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


@pytest.mark.parametrize("x", ["No", "One", "Multi"])
@pytest.mark.parametrize(("separator", "decimal"), [("\t", "."), ("\t", ","), (",", "."), (";", ",")])
@pytest.mark.parametrize(("multi", "segments"), [("Yes", 1), ("Yes", 3), ("No", 1)])
def test_every_variant_of_the_lvm_header(read, table, x, separator, decimal, multi, segments):
    same(read(lvm(table, x=x, separator=separator, decimal=decimal, multi=multi, segments=segments)), table)


def test_lvm_rows_appended_under_one_header(read, table):
    same(read(lvm(table, multi="No", segments=3)), table)


def test_lvm_text_in_another_code_page_changes_no_number(read, table):
    same(read(lvm(table).replace(b"Operator\tM", b"Operator\tM\xfcller")), table)


def test_lvm_cut_within_its_rows_or_headers(read, table):
    data = lvm(table)
    lines = data.splitlines(keepends=True)
    for keep in (5, 14, 20, len(lines) - 3):
        refused(read, b"".join(lines[:keep]), "truncated")
    refused(read, lvm(table, samples=ROWS - 1), "damaged")
    refused(read, data.replace(b"Channels\t7", b"Channels\t8"), "damaged")


def test_lvm_names_the_line_of_a_bad_value(read, table):
    lines = lvm(table).splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith(b"X_Value")) + 4
    lines[at] = lines[at].replace(lines[at].split(b"\t")[3], b"oops")
    error = refused(read, b"\r\n".join(lines), "text-cell", CellError)
    assert f"row {at + 1}," in error.where
    assert "oops" in error.got


def test_lvm_segments_of_other_channels_are_not_one_recording(read, table):
    lines = lvm(table, segments=2).splitlines()
    second = [i for i, line in enumerate(lines) if line.startswith(b"X_Value")][1]
    lines[second] = lines[second].replace(b"Fy", b"Fx [lbf]")
    refused(read, b"\n".join(lines), "several-sheets", RecordingError)


def test_lvm_channels_of_different_times_are_not_one_recording(read, table):
    lines = lvm(table, x="Multi").splitlines()
    fields = lines[-3].split(b"\t")
    fields[2] = b"99.5"
    lines[-3] = b"\t".join(fields)
    refused(read, b"\n".join(lines), "doubled-column", ColumnError)


def test_lvm_with_a_separator_of_its_own(read, table):
    refused(read, lvm(table).replace(b"Separator\tTab", b"Separator|Pipe", 1), "unreadable")


def test_lvm_without_rows(read, table):
    empty = {name: values[:0] for name, values in table.items()}
    refused(read, lvm(empty), "no-data")


def test_tdms_in_several_segments(read, table):
    halves = [{name: values[part] for name, values in table.items()} for part in (slice(5), slice(5, None))]
    same(read(b"".join(tdms(half) for half in halves)), table)


@pytest.mark.parametrize("part", [0.03, 0.3, 0.7, 0.999])
def test_a_truncated_tdms(read, table, part):
    data = tdms(table)
    refused(read, data[: int(len(data) * part)], "truncated")


def test_a_tdms_segment_that_was_never_finished(read, table):
    data = bytearray(tdms(table))
    data[12:20] = b"\xff" * 8
    assert "closed" in refused(read, bytes(data), "truncated").expected


def test_tdms_lengths_that_lie(read, table):
    data = tdms(table)
    count = struct.pack("<Q", ROWS)
    assert data.count(count) >= len(HEADER)
    for claim in (ROWS - 1, ROWS + 1, 2**40):
        error = refused(read, data.replace(count, struct.pack("<Q", claim)), "damaged")
        assert str(ROWS * 8 * len(HEADER)) in error.got
    # One channel takes a value from its neighbour: the sum is right, and only their equal length tells.
    at = data.index(count)
    lie = data[:at] + struct.pack("<Q", ROWS + 1) + data[at + 8 :]
    refused(read, lie, "damaged")


def test_tdms_with_two_recordings(read, table):
    refused(read, tdms(table) + tdms(table, group="other"), "several-sheets", RecordingError)


def test_tdms_beside_a_group_of_other_channels(read, table):
    stream = io.BytesIO()
    with nptdms.TdmsWriter(stream) as file:
        file.write_segment([nptdms.ChannelObject("log", "Room [degC]", np.array([20.5, 21.0]))])
    same(read(tdms(table) + stream.getvalue()), table)


def test_tdms_text_and_dates_are_no_numbers(read, table):
    for values, rule in ((["a", "b"], "not-numbers"), (np.array(["2020-01-01"], "datetime64[us]"), None)):
        stream = io.BytesIO()
        with nptdms.TdmsWriter(stream) as file:
            file.write_segment([nptdms.ChannelObject("run", "T [degC]", values)])
        with pytest.raises(ToolkitError) as caught:
            read(tdms(table) + stream.getvalue())
        assert rule is None or caught.value.rule == rule


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


def test_single_precision_is_known_as_such(read, table):
    found = read(tdms(table, kind=np.float32))["FZ"]
    step = np.spacing(np.abs(table["FZ"]).astype(np.float32)).astype(float)
    np.testing.assert_allclose(rounding(found), step / 2, rtol=1e-12)
    assert (np.abs(found.values - table["FZ"]) <= rounding(found)).all()


def test_mat_without_compression_and_as_big_endian_rows(read, table):
    same(read(mat(table, compressed=False)), table)
    same(read(mat({name: values[None, :] for name, values in table.items()})), table)


def test_mat_without_units_is_refused(read, table):
    refused(read, mat(table, units={"SA": "deg"}), "unknown-unit", ColumnError)


@pytest.mark.parametrize(
    "value",
    [
        np.array([1.0, "x", None], dtype=object)[:2],
        np.ones(ROWS) * 1j,
        scipy.sparse.csc_matrix(np.eye(3)),
        np.ones((3, 3)),
        {"a": {"b": {"c": {"d": {"e": 1.0}}}}},
    ],
)
def test_mat_holds_nothing_but_real_vectors(read, table, value):
    refused(read, mat(table, extra=value), "not-numbers")


def test_mat_7_3_is_named(read):
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116) + bytes(8) + b"\x00\x02IM"
    error = refused(read, head + bytes(384) + b"\x89HDF\r\n\x1a\n", "format-version")
    assert "-v7" in error.next_step


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("part", [0.05, 0.4, 0.9])
def test_a_truncated_mat(read, table, compressed, part):
    data = mat(table, compressed=compressed)
    refused(read, data[: int(len(data) * part)], "truncated")


def test_mat_lengths_that_lie(read, table):
    data = mat(table, compressed=False)
    shape = struct.pack("<ii", 1, ROWS)
    assert shape in data
    for claim in ((1, ROWS + 1), (2**31 - 1, 2**31 - 1), (-1, ROWS)):
        refused(read, data.replace(shape, struct.pack("<ii", *claim), 1), "damaged")


def test_a_mat_that_grows_out_of_all_proportion(read):
    bomb = zlib.compress(bytes(MAX_TOTAL_BYTES + 2**20), 9)
    head = b"MATLAB 5.0 MAT-file".ljust(116) + bytes(8) + b"\x00\x01IM"
    refused(read, head + struct.pack("<LL", 15, len(bomb)) + bomb, "inflation")


def test_mat_cells_nested_without_end(read):
    # Ten thousand levels would overflow a reader's stack.
    element = b""
    for _ in range(10_000):
        flags = struct.pack("<LLLL", 6, 8, 1, 0)
        body = flags + struct.pack("<LLll", 5, 8, 1, 1) + struct.pack("<LL", 1, 0) + element
        element = struct.pack("<LL", 14, len(body)) + body
    head = b"MATLAB 5.0 MAT-file".ljust(116) + bytes(8) + b"\x00\x01IM"
    refused(read, head + element, "not-numbers")


def test_mdf_beside_a_group_of_other_channels(read, table):
    other = [asammdf.Signal(np.array([20.5, 21.0]), np.array([0.0, 60.0]), name="Room", unit="degC")]
    same(read(mdf(other, signals(table))), table)
    refused(read, mdf(signals(table), signals(table)), "several-sheets", RecordingError)


@pytest.mark.parametrize("compression", [0, 2])
@pytest.mark.parametrize("part", [0.005, 0.1, 0.5, 0.98])
def test_a_truncated_mdf(read, table, compression, part):
    data = mdf(signals(table), compression=compression)
    refused(read, data[: int(len(data) * part)], "truncated")


def test_mdf_lengths_that_lie(read, table):
    data = mdf(signals(table))
    group = data.index(b"##CG")
    place = group + 24 + 8 * struct.unpack_from("<Q", data, group + 16)[0] + 8
    assert struct.unpack_from("<Q", data, place)[0] == ROWS
    for claim, rule in ((ROWS + 1, "truncated"), (2**40, "truncated"), (ROWS - 1, "damaged")):
        refused(read, data[:place] + struct.pack("<Q", claim) + data[place + 8 :], rule)


def test_mdf_channels_beyond_their_record(read, table):
    data = mdf(signals(table))
    channel = data.index(b"##CN")
    place = channel + 24 + 8 * struct.unpack_from("<Q", data, channel + 16)[0] + 4
    refused(read, data[:place] + struct.pack("<L", 4096) + data[place + 4 :], "damaged")


def test_mdf_links_that_lead_back(read, table):
    data = mdf(signals(table))
    channel = data.index(b"##CN")
    refused(read, data[: channel + 24] + struct.pack("<Q", channel) + data[channel + 32 :], "damaged")
    refused(read, data[: channel + 24] + struct.pack("<Q", 64) + data[channel + 32 :], "damaged")
    refused(read, data[: channel + 24] + struct.pack("<Q", 2**40) + data[channel + 32 :], "truncated")


def test_mdf_packed_data_that_unpacks_to_more_than_it_says(read, table):
    data = mdf(signals(table), compression=2)
    place = data.index(b"##DZ") + 24 + 8
    size = struct.unpack_from("<Q", data, place)[0]
    refused(read, data[:place] + struct.pack("<Q", size - 8) + data[place + 8 :], "damaged")
    refused(read, data[:place] + struct.pack("<Q", 2**33) + data[place + 8 :], "inflation")


def test_a_formula_of_an_mdf_is_never_evaluated(read, table):
    made = signals(table)
    made[0].conversion = asammdf.blocks.conversion_utils.from_dict({"formula": "__import__('os').getpid()"})
    refused(read, mdf(made), "formula")


def test_mdf_3_and_an_unfinished_mdf_are_named(read, table):
    data = mdf(signals(table))
    refused(read, data[:28] + struct.pack("<H", 330) + data[30:], "format-version")
    refused(read, b"UnFinMF " + data[8:], "truncated")


def test_counts_of_a_digitiser_are_known_as_such(read, table):
    made = signals(table)
    counts = np.arange(-6, 6, dtype=np.int16) * 101 + 1
    made[0] = asammdf.Signal(
        counts, made[0].timestamps, name=HEADER["FZ"], unit="lbf",
        conversion=asammdf.blocks.conversion_utils.from_dict({"a": 0.25, "b": 3.0}),
    )  # fmt: skip
    found = read(mdf(made))["FZ"]
    np.testing.assert_allclose(found.values, counts * 0.25 + 3.0, rtol=1e-12)
    np.testing.assert_allclose(rounding(found), 0.125, rtol=1e-12)


def test_a_value_that_an_mdf_marks_as_invalid_is_no_number(read, table):
    made = signals(table)
    made[1].invalidation_bits = np.arange(ROWS) == 4
    error = refused(read, mdf(made), "empty-cell", CellError)
    assert "row 5" in error.where


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
    assert error.next_step == f'pip install "toolkit[{extra}]"'


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
