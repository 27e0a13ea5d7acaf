"""MAT-files of level 5 (MATLAB 5 to 7.2), by MathWorks' "MAT-File Format"; unpacked within bounds, read by
scipy.

Arrays of numbers and text, cells and structures of them are let through; objects, function handles and
sparse or complex arrays are refused, so that a reader never meets any.

Two layouts are read, both of which state every unit:

- ``data`` (rows, channels) and ``headers``, one text a column as in a header row; or
- a vector for each channel, named by its symbol (``FZ``, ``SA``, ``D51`` ...), and a structure ``units``
  with a text for each of them. Variables that hold text are remarks.
"""

from __future__ import annotations

import io
import math
import struct
import warnings
import zlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolkit.inputs import RECORDING_FILE, limit_of
from toolkit.machine import Machine
from toolkit.recording.formats.vectors import (
    Vector,
    Vectors,
    Written,
    damaged,
    no_numbers,
    one_table,
    quantum,
    read_by_library,
    too_large,
    truncated,
    version,
)

_HEADER = 128
_COMPRESSED, _MATRIX = 15, 14
_SIZES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}
_CELL, _STRUCT, _CHAR = 1, 2, 4
_NUMBERS = range(6, 16)
_COMPLEX = 0x800
_DEEPEST = 3
DATA, HEADERS, UNITS = "data", "headers", "units"


def unpack_mat(data: bytes, where: object) -> bytes:
    """Return a MAT-file with its elements unpacked and every length in them checked.

    Raises
    ------
    UnreadableError
        rule ``truncated damaged inflation not-numbers format-version``
    """
    if data.startswith(b"MATLAB 7.3"):
        version(where, "the MAT-file is of version 7.3, which is HDF5", "MATLAB 7.3", "version 5 to 7",
                "save it with save(name, '-v7')")  # fmt: skip
    if len(data) < _HEADER:
        truncated(where, "the MAT-file ends within its header", f"{len(data)} bytes", f"{_HEADER} at least")
    order = {b"IM": "<", b"MI": ">"}.get(data[126:128])
    if order is None or struct.unpack_from(f"{order}H", data, 124)[0] != 0x100:
        version(where, "the MAT-file is of a version that is not read", data[124:128].hex(), "version 5 to 7",
                "save it with save(name, '-v7')")  # fmt: skip
    parts = [data[:116] + bytes(8) + data[124:_HEADER]]  # no link to MATLAB's own objects
    place, budget = _HEADER, limit_of(RECORDING_FILE)
    while place < len(data):
        kind, begin, end, following = _tag(data, place, len(data), order, where)
        if kind == _COMPRESSED:
            element, following = _inflated(data[begin:end], budget, where), end
        else:
            element = data[place:following]
        kind, begin, end, after = _tag(element, 0, len(element), order, where)
        if kind != _MATRIX or after != len(element):
            damaged(where, "an element of the MAT-file is no array", f"type {kind}", f"type {_MATRIX}")
        _walk(element, begin, end, order, 0, where)
        budget -= len(element)
        parts.append(element)
        place = following
    return b"".join(parts)


def _inflated(packed: bytes, budget: int, where: object) -> bytes:
    engine = zlib.decompressobj()
    try:
        content = engine.decompress(packed, budget + 1)
    except zlib.error as error:
        damaged(where, "an array of the MAT-file is damaged", error, "intact packed data")
    if len(content) > budget:
        too_large(where, f"more than {budget} bytes from {len(packed)}", limit_of(RECORDING_FILE))
    if not engine.eof:
        truncated(
            where, "an array of the MAT-file ends early", f"{len(packed)} bytes", "all of its packed data"
        )
    return content


def _tag(data: bytes, place: int, limit: int, order: str, where: object) -> tuple[int, int, int, int]:
    # Type, first byte, end, and where the next element begins (padded to eight bytes).
    if place + 8 > limit:
        truncated(where, "the MAT-file ends within an element", f"byte {place}", "eight bytes of a tag")
    first, size = struct.unpack_from(f"{order}LL", data, place)
    if first >> 16:  # the short form: size and type in one word, up to four bytes in the next
        if first >> 16 > 4:
            damaged(where, "a short element of the MAT-file is too long", first >> 16, "at most 4 bytes")
        return first & 0xFFFF, place + 4, place + 4 + (first >> 16), place + 8
    end = place + 8 + size
    if end > limit:
        truncated(where, "an element of the MAT-file ends beyond its place", f"{end - limit} bytes too far",
                  "lengths within the file")  # fmt: skip
    return first, place + 8, end, min(place + 8 + -(-size // 8) * 8, limit) if first != _COMPRESSED else end


def _walk(data: bytes, place: int, end: int, order: str, depth: int, where: object) -> None:
    if place == end:
        return  # an empty array in a cell
    if depth > _DEEPEST:
        no_numbers(where, "arrays are nested too deep in the MAT-file", f"more than {_DEEPEST} levels")
    kind, begin, stop, place = _tag(data, place, end, order, where)
    if kind != 6 or stop - begin != 8:
        damaged(where, "an array of the MAT-file has no flags", f"type {kind}", "type 6 of 8 bytes")
    flags = struct.unpack_from(f"{order}L", data, begin)[0]
    kind, begin, stop, place = _tag(data, place, end, order, where)
    if kind != 5 or (stop - begin) % 4 or stop - begin < 8:
        damaged(where, "an array of the MAT-file has no size", f"type {kind}", "two or more whole numbers")
    shape = struct.unpack_from(f"{order}{(stop - begin) // 4}l", data, begin)
    if min(shape) < 0:
        damaged(where, "an array of the MAT-file has a negative size", shape, "sizes of 0 or more")
    count = math.prod(shape)
    _, begin, stop, place = _tag(data, place, end, order, where)
    name = data[begin:stop].decode("ascii", "replace")[:60] or "an array within another"
    group = flags & 0xFF
    if group in (_CELL, _STRUCT):
        if group == _STRUCT:
            _, begin, stop, place = _tag(data, place, end, order, where)
            width = struct.unpack_from(f"{order}l", data, begin)[0] if stop - begin == 4 else 0
            _, begin, stop, place = _tag(data, place, end, order, where)
            if width < 1 or (stop - begin) % width:
                damaged(
                    where, f"the structure {name} has no field names", width, "a length that divides them"
                )
            count *= (stop - begin) // width
        if count > (end - place) // 8:
            damaged(where, f"{name} claims more cells than it holds", count, f"at most {(end - place) // 8}")
        for _ in range(count):
            kind, begin, stop, place = _tag(data, place, end, order, where)
            if kind != _MATRIX:
                damaged(where, f"{name} holds what is no array", f"type {kind}", f"type {_MATRIX}")
            _walk(data, begin, stop, order, depth + 1, where)
        return
    if (group != _CHAR and group not in _NUMBERS) or flags & _COMPLEX:
        no_numbers(
            where,
            f"{name} holds no real numbers",
            "complex numbers" if flags & _COMPLEX else f"class {group}",
        )
    kind, begin, stop, place = _tag(data, place, end, order, where)
    if kind not in _SIZES:
        damaged(where, f"{name} has values of no known type", f"type {kind}", "numbers or text")
    present = (stop - begin) // _SIZES[kind]
    # UTF-8 has up to four bytes a character: only a claim of more than there are is a lie.
    if present != count if group != _CHAR else count > present:
        damaged(where, f"{name} claims more or fewer values than it holds", count, present)


def read_mat(data: bytes, where: object, machine: Machine) -> Vectors:
    """Return the channels of a MAT-file that the gate unpacked.

    Raises
    ------
    UnreadableError
        rule ``unreadable not-numbers no-data``
    """
    from scipy.io import loadmat

    stream: Any = io.BytesIO(data)
    refused = read_by_library(
        "the MAT-file cannot be read", where=where, expected="a MAT-file of version 5 to 7",
        next_step="save it again with save(name, '-v7')",
    )  # fmt: skip
    with refused, warnings.catch_warnings():
        warnings.simplefilter("error")  # such as two variables of one name
        contents = loadmat(stream, chars_as_strings=True)
    variables = {name: value for name, value in contents.items() if not name.startswith("__")}
    if DATA in variables and HEADERS in variables:
        vectors = _columns(variables, where)
    else:
        vectors = _variables(variables, where)
    return one_table([Vectors(where=str(where), vectors=vectors)], machine, where=where)


def _columns(variables: Mapping[str, Any], where: object) -> list[Vector]:
    table, headers = variables[DATA], _texts(variables[HEADERS], where)
    if table.dtype.kind not in "fiu" or table.ndim != 2 or table.shape[1] != len(headers):
        no_numbers(where, "the variable 'data' is no matrix with a column for each header",
                   f"{table.dtype} of shape {table.shape}, {len(headers)} headers")  # fmt: skip
    return [_vector(name, None, table[:, column]) for column, name in enumerate(headers)]


def _variables(variables: Mapping[str, Any], where: object) -> list[Vector]:
    units = _units(variables.get(UNITS), where)
    vectors = []
    for name, value in variables.items():
        if name == UNITS or value.dtype.kind == "U":
            continue
        if value.dtype.kind not in "fiu" or value.ndim != 2 or 1 not in value.shape:
            no_numbers(where, f"the variable {name!r} is no vector of numbers",
                       f"{value.dtype} of shape {value.shape}")  # fmt: skip
        vectors.append(_vector(name, units.get(name), value.reshape(-1)))
    return vectors


def _vector(name: str, unit: str | None, values: NDArray[Any]) -> Vector:
    return Vector(name=name, unit=unit, values=values, half=quantum(values, values) if len(values) else None)


def _texts(value: NDArray[Any], where: object) -> list[str]:
    # A cell of texts, or a matrix of characters that has one text a row.
    texts = []
    for item in value.reshape(-1):
        characters = np.asarray(item).reshape(-1)  # of a cell: an array of one text, empty for an empty one
        text = characters[0] if len(characters) == 1 else "" if len(characters) == 0 else None
        if not isinstance(text, str):
            no_numbers(where, "the variable 'headers' is no list of texts", f"{value.dtype}")
        texts.append(text.strip())
    return texts


def _units(value: NDArray[Any] | None, where: object) -> dict[str, str]:
    if value is None:
        return {}
    if value.dtype.names is None or value.size != 1:
        no_numbers(
            where, "the variable 'units' is no structure of texts", f"{value.dtype.kind}, {value.size}"
        )
    content = value.reshape(-1)[0]
    return {
        name: _texts(np.asarray(content[name]), where)[0] for name in value.dtype.names if content[name].size
    }


def mat_bytes(columns: Sequence[Written], title: str) -> bytes:
    """Return a MAT-file of version 5 with ``data``, ``headers`` and the remark ``title``."""
    from scipy.io import savemat

    stream: Any = io.BytesIO()
    table = {
        "data": np.column_stack([column.values for column in columns]),
        "headers": np.array([column.header for column in columns], dtype=object),
        "title": title,
    }
    savemat(stream, table)
    return bytes(stream.getvalue())
