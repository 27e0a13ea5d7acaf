"""MAT-files of level 5 (MATLAB 5 to 7.2), by MathWorks' "MAT-File Format"; unpacked within bounds.

Arrays of numbers and text, cells and structures of them are let through; objects, function handles and
sparse or complex arrays are refused, so that a reader never meets any.
"""

from __future__ import annotations

import math
import struct
import zlib

from toolkit.inputs import RECORDING_FILE, limit_of
from toolkit.recording.integrity.refuse import damaged, no_numbers, too_large, truncated, version

_HEADER = 128
_COMPRESSED, _MATRIX = 15, 14
_SIZES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}
_CELL, _STRUCT, _CHAR = 1, 2, 4
_NUMBERS = range(6, 16)
_COMPLEX = 0x800
_DEEPEST = 3


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
