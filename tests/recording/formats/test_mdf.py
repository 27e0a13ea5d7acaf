"""MDF 4: groups, packed data and conversions as the format has them, and every cut and lie refused."""

from __future__ import annotations

import struct

import asammdf
import numpy as np
import pytest

from tests.recording.format_checks import ROWS, refused, same
from tests.recording.format_factory import HEADER, mdf, signals
from toolkit.errors import CellError, RecordingError
from toolkit.recording.digits import rounding


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
