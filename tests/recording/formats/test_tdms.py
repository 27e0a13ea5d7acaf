"""TDMS: segments, groups and lengths as the format has them, and every cut and lie refused."""

from __future__ import annotations

import io
import struct

import nptdms
import numpy as np
import pytest

from tests.recording.format_checks import ROWS, refused, same
from tests.recording.format_factory import HEADER, tdms
from toolkit.errors import RecordingError, ToolkitError
from toolkit.recording.digits import rounding


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


def test_single_precision_is_known_as_such(read, table):
    found = read(tdms(table, kind=np.float32))["FZ"]
    step = np.spacing(np.abs(table["FZ"]).astype(np.float32)).astype(float)
    np.testing.assert_allclose(rounding(found), step / 2, rtol=1e-12)
    assert (np.abs(found.values - table["FZ"]) <= rounding(found)).all()
