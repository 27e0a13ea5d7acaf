"""MDF 4, by the ASAM MDF 4.1 standard: its tree of blocks is checked, then one channel group read by asammdf.

What is checked: every block lies within the file, no chain of links comes back to itself, packed data
unpacks to the length that it claims, every channel lies within its record, and a data group's data is as
long as its channel groups say. An algebraic conversion (a formula as text) is refused: a reader would
evaluate it. The group's time master is the time.
"""

from __future__ import annotations

import io
import logging
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from toolkit.errors import CellError, UnreadableError
from toolkit.inputs import RECORDING_FILE, limit_of
from toolkit.machine import Machine
from toolkit.recording.extras import needed
from toolkit.recording.formats.vectors import (
    Vector,
    Vectors,
    Written,
    damaged,
    one_table,
    quantum,
    read_by_library,
    too_large,
    truncated,
    version,
)

_FIRST = 64  # where the header block stands
_HEAD = 24
_FORMULA = 3
_VARIABLE = 1  # flag of a channel group whose records have no fixed length
_FLAGS = 32  # the specification has five of them
_OF_LENGTH = 4  # bytes
_FIXED = (0, 2)  # kinds of channels with a place in the record: values, and the master
_TEXT = b"TX MD"
# What the first links of a block lead to, in their order (empty: anything). Further links lead back up.
_LINKS: dict[bytes, tuple[bytes, ...]] = {
    b"HD": (b"DG", b"FH", b"CH", b"AT", b"EV", _TEXT),
    b"DG": (b"DG", b"CG", b"", _TEXT),
    b"CG": (b"CG", b"CN", _TEXT, b"SI", b"SR", _TEXT),
    b"CN": (b"CN", b"CN CA DS CL CU CV", _TEXT, b"SI", b"CC", b"", _TEXT, _TEXT),
    b"CC": (_TEXT, _TEXT, b"CC", _TEXT),
    b"SI": (_TEXT, _TEXT, _TEXT),
    b"FH": (b"FH", _TEXT),
    b"HL": (b"DL",),
}
_ALL = (b"CC", b"DL", b"LD")  # all of their links lead down
_MASTERS = (2, 3)  # kinds of channels, measured and virtual
_TIME = 1
_ALL_INVALID = 1


@dataclass(frozen=True, slots=True)
class _Block:
    id: bytes
    links: tuple[int, ...]
    body: int  # where the data section begins
    end: int

    def down(self) -> tuple[tuple[int, bytes], ...]:
        """Return (place, what should stand there) of the blocks that this one leads to."""
        expected = _LINKS.get(self.id, ())
        if self.id in _ALL:
            expected += (b"",) * (len(self.links) - len(expected))
        return tuple((link, kind) for link, kind in zip(self.links, expected, strict=False) if link)


def walk_mdf(data: bytes, where: object) -> None:
    """Check the blocks of an MDF 4 file.

    Raises
    ------
    UnreadableError
        rule ``truncated damaged inflation formula format-version``
    """
    number = struct.unpack_from("<H", data, 28)[0] if len(data) >= _FIRST else 0
    if len(data) < _FIRST:
        truncated(where, "the MDF file ends within its header", f"{len(data)} bytes", f"{_FIRST} at least")
    if data.startswith(b"UnFinMF"):
        truncated(where, "the MDF file was never finished", "an unfinished file", "a finalized file")
    if not 400 <= number < 500:
        version(where, "the MDF file is of a version that is not read", f"{number / 100:.2f}",
                "version 4", "convert it to MDF 4, with the program that wrote it")  # fmt: skip
    blocks = _blocks(data, where)
    inflated: dict[int, int] = {}
    for place, block in blocks.items():
        if block.id == b"DZ":
            inflated[place] = _inflated(data, block, limit_of(RECORDING_FILE) - sum(inflated.values()), where)
        elif block.id == b"CC" and data[block.body : block.body + 1] == bytes((_FORMULA,)):
            raise UnreadableError(
                "a channel of the MDF file has a formula for a conversion",
                where=where,
                got="an algebraic conversion",
                expected="numbers, or a linear conversion",
                next_step="export the channels as physical values; a formula from a file is never evaluated",
                rule="formula",
            )
    place = blocks[_FIRST].links[0] if blocks[_FIRST].links else 0
    while place:
        group = blocks[place]
        _check_group(data, group, blocks, inflated, where)
        place = group.links[0]


def _blocks(data: bytes, where: object) -> dict[int, _Block]:
    # Depth first, with a colour for what is on the way down: a link back to it would never end.
    blocks: dict[int, _Block] = {}
    open_: set[int] = set()
    stack: list[tuple[int, bytes, bool]] = [(_FIRST, b"HD", True)]
    while stack:
        place, kind, entering = stack.pop()
        if not entering:
            open_.discard(place)
            continue
        if place in open_:
            damaged(where, "a chain of blocks in the MDF file leads back to itself", f"byte {place}",
                    "chains that end")  # fmt: skip
        new = place not in blocks
        block = blocks[place] = _block(data, place, where) if new else blocks[place]
        if kind and block.id not in kind.split():
            damaged(where, "a link in the MDF file leads to another kind of block", repr(block.id),
                    kind.decode())  # fmt: skip
        if new:
            open_.add(place)
            stack.append((place, b"", False))
            stack += [(*link, True) for link in block.down()]
    return blocks


def _block(data: bytes, place: int, where: object) -> _Block:
    if place + _HEAD > len(data):
        truncated(where, "the MDF file ends before a block that it links to", f"byte {place}",
                  f"within {len(data)} bytes")  # fmt: skip
    if data[place : place + 2] != b"##":
        damaged(where, "a link in the MDF file leads to no block", f"byte {place}", "##")
    length, count = struct.unpack_from("<QQ", data, place + 8)
    body = place + _HEAD + 8 * count
    if place + length > len(data):
        truncated(where, "a block of the MDF file ends beyond the file", f"{place + length} bytes",
                  f"{len(data)}")  # fmt: skip
    if body > place + length:
        damaged(where, "a block of the MDF file has more links than room", count, f"{length} bytes")
    links = struct.unpack_from(f"<{count}Q", data, place + _HEAD)
    return _Block(data[place + 2 : place + 4], links, body, place + length)


def _inflated(data: bytes, block: _Block, budget: int, where: object) -> int:
    if block.body + 24 > block.end:
        damaged(where, "a packed block of the MDF file is too short", block.end - block.body, "24 bytes")
    kind, claimed, size = struct.unpack_from("<2xBx4xQQ", data, block.body)
    begin = block.body + 24
    if kind > 1:
        version(where, "the MDF file is packed in a way that is not read", f"method {kind}", "deflate",
                "save it without compression, or with deflate")  # fmt: skip
    if begin + size > block.end:
        truncated(where, "a packed block of the MDF file ends early", f"{block.end - begin} bytes", size)
    if claimed > budget:
        too_large(where, f"{claimed} bytes", limit_of(RECORDING_FILE))
    engine = zlib.decompressobj()
    try:
        content = engine.decompress(data[begin : begin + size], claimed + 1)
    except zlib.error as error:
        damaged(where, "a packed block of the MDF file is damaged", error, "intact packed data")
    if len(content) != claimed or not engine.eof:
        damaged(where, "a packed block of the MDF file is not as long as it says", len(content), claimed)
    return len(content)


def _check_group(
    data: bytes, group: _Block, blocks: dict[int, _Block], inflated: dict[int, int], where: object
) -> None:
    if len(group.links) < 3 or group.body >= group.end:
        damaged(where, "a data group of the MDF file is too short", len(group.links), "4 links")
    prefix = data[group.body]
    claimed, place = 0, group.links[1]
    while place:
        block = blocks[place]
        if len(block.links) < 2 or block.body + 32 > block.end:
            damaged(where, "a channel group of the MDF file is too short", len(block.links), "6 links")
        cycles, flags, size, invalid = struct.unpack_from("<8xQH6xLL", data, block.body)
        if flags >= _FLAGS or (flags & _VARIABLE and block.links[1]):
            damaged(where, "a channel group of the MDF file has flags that cannot be", f"{flags:#x}",
                    "a group of records, or of values of any length without channels")  # fmt: skip
        if flags & _VARIABLE:
            # Each value follows its length; all values' bytes stand where others have those of one record.
            claimed += cycles * (prefix + _OF_LENGTH) + size + (invalid << 32)
        else:
            claimed += cycles * (prefix + size + invalid)
            _check_channels(data, block.links[1], blocks, size, where)
        place = block.links[0]
    present = _length(group.links[2], blocks, inflated, where)
    if present < claimed:
        truncated(where, "the MDF file has less data than it claims", f"{present} bytes", claimed)
    if present > claimed:
        damaged(where, "the MDF file has more data than it claims", f"{present} bytes", claimed)


def _check_channels(data: bytes, place: int, blocks: dict[int, _Block], size: int, where: object) -> None:
    while place:
        block = blocks[place]
        if len(block.links) < 2 or block.body + 16 > block.end:
            damaged(where, "a channel of the MDF file is too short", len(block.links), "8 links")
        kind, first, offset, bits = struct.unpack_from("<BxxBLL", data, block.body)
        if kind in _FIXED and offset + -(-(first + bits) // 8) > size:
            damaged(where, "a channel of the MDF file lies beyond its record", f"{offset} + {bits} bits",
                    f"within {size} bytes")  # fmt: skip
        place = block.links[0]


def _length(place: int, blocks: dict[int, _Block], inflated: dict[int, int], where: object) -> int:
    total, todo = 0, [place]
    while todo:
        place = todo.pop()
        if not place:
            continue
        block = blocks[place]
        if block.id in (b"DT", b"DV"):
            total += block.end - block.body
        elif block.id == b"DZ":
            total += inflated[place]
        elif block.id in (b"DL", b"HL"):
            todo += [link for link, _ in block.down()]
        else:
            version(where, "the MDF file keeps its data in a way that is not read", repr(block.id),
                    "data blocks or lists of them", "save it as MDF 4.1")  # fmt: skip
    return total


def read_mdf(data: bytes, where: object, machine: Machine) -> Vectors:
    """Return the channels of the one channel group that is the recording, as physical values.

    Raises
    ------
    ConfigError
        rule ``missing-extra``
    CellError
        rule ``empty-cell``: a value that the file itself marks as invalid
    UnreadableError
        rule ``unreadable no-data``
    RecordingError
        rule ``several-sheets``
    """
    asammdf: Any = needed("asammdf", extra="mdf", to="read an MDF file", where=where)
    logging.getLogger("asammdf").setLevel(logging.CRITICAL)  # what matters of it is said by an error
    refused = read_by_library(
        "the MDF file cannot be read", where=where, expected="an MDF 4 file",
        next_step="copy it again from the machine",
    )  # fmt: skip
    with refused, asammdf.MDF(io.BytesIO(data)) as file:
        tables = [
            Vectors(
                where=f"{where}, channel group {index + 1}",
                vectors=[
                    _vector(file, index, place, channel, where)
                    for place, channel in enumerate(group.channels)
                ],
            )
            for index, group in enumerate(file.groups)
            if group.channel_group.cycles_nr
        ]
    return one_table(tables, machine, where=where)


def _vector(file: Any, group: int, place: int, channel: Any, where: object) -> Vector:
    values, invalid = file.get(group=group, index=place, samples_only=True, ignore_invalidation_bits=True)
    stored, _ = file.get(group=group, index=place, samples_only=True, raw=True, ignore_invalidation_bits=True)
    if channel.flags & _ALL_INVALID or (invalid is not None and np.any(invalid)):
        row = 1 if channel.flags & _ALL_INVALID else int(np.argmax(np.asarray(invalid))) + 1
        raise CellError(
            f"data row {row}, channel {channel.name!r}: no number",
            where=f"{where}, channel group {group + 1}, data row {row}, channel {channel.name!r}",
            got="a value that the file marks as invalid",
            expected="a finite number",
            next_step="look at that value in the file; repeat the recording or mend a copy of the file",
            rule="empty-cell",
        )
    values, stored = np.asarray(values), np.asarray(stored)
    plain = values.ndim == 1 and values.dtype.kind in "fiu" and len(values) == len(stored) > 0
    unit = channel.unit or (channel.conversion.unit if channel.conversion is not None else "")
    name = str(channel.name)
    if channel.channel_type in _MASTERS and channel.sync_type == _TIME:
        name, unit = "t", unit or "s"  # the standard has time masters in seconds
    return Vector(
        name=name, unit=unit or None, values=values, half=quantum(stored, values) if plain else None
    )


def mdf_bytes(columns: Sequence[Written], title: str) -> bytes:
    """Return an MDF 4.1 file of one channel group, whose master is the time."""
    asammdf: Any = needed("asammdf", extra="mdf", to="write an MDF file", where=title)
    time = next((column for column in columns if column.symbol == "t"), None)
    stamps = np.arange(len(columns[0].values), dtype=np.float64) if time is None else time.values
    stream = io.BytesIO()
    with asammdf.MDF(version="4.10") as file:
        signals = [
            asammdf.Signal(column.values, stamps, name=column.name, unit=column.unit)
            for column in columns
            if column is not time
        ]
        file.append(signals, comment=title)
        file.save(stream)
    return stream.getvalue()
