"""MAT-files: real vectors with units and nothing else, and every cut and lie refused."""

from __future__ import annotations

import struct
import zlib

import numpy as np
import pytest
import scipy.sparse

from tests.recording.format_checks import ROWS, refused, same
from tests.recording.format_factory import mat
from toolkit.errors import ColumnError
from toolkit.inputs import RECORDING_FILE


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
    bomb = zlib.compress(bytes(RECORDING_FILE.limit + 2**20), 9)
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
