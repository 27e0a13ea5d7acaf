"""TDMS, by National Instruments' "TDMS File Format Internal Structure": checked, then read by npTDMS.

A reader fits a file's claims to the data that is there: with one value too many in a header, values slide
from one channel into the next without a word. So the claims are read here too, and must add up. A channel's
unit is its property ``unit_string``.
"""

from __future__ import annotations

import io
import logging
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from toolkit.machine import Machine
from toolkit.recording.extras import needed
from toolkit.recording.formats.vectors import (
    Vector,
    Vectors,
    Written,
    damaged,
    no_numbers,
    one_table,
    quantum,
    read_by_library,
    truncated,
    version,
)

_LEAD_IN = 28
_META_DATA, _NEW_LIST, _RAW_DATA, _BIG_ENDIAN, _DAQMX = 1 << 1, 1 << 2, 1 << 3, 1 << 6, 1 << 7
_UNFINISHED = 0xFFFF_FFFF_FFFF_FFFF
_VERSIONS = (4712, 4713)
_NO_DATA, _AS_BEFORE, _DAQMX_INDEXES = 0xFFFF_FFFF, 0, (0x1269, 0x126A)
_STRING, _STAMP = 0x20, 0x44
# Type of data -> bytes of a value; 0x19 and 0x1A are numbers with a unit, 0x21 is a truth value.
_SIZES = {1: 1, 2: 2, 3: 4, 4: 8, 5: 1, 6: 2, 7: 4, 8: 8, 9: 4, 10: 8, 0x19: 4, 0x1A: 8, 0x21: 1,
          _STAMP: 16, 0x08000C: 8, 0x10000D: 16}  # fmt: skip


@dataclass(slots=True)
class _Reader:
    """A place in the meta data of one segment; nothing beyond its end is read."""

    data: bytes
    place: int
    end: int
    order: str
    where: object

    def take(self, size: int) -> bytes:
        begin, self.place = self.place, self.place + size
        if self.place > self.end:
            damaged(self.where, "the meta data of a TDMS segment ends beyond its place",
                    f"{self.place - self.end} bytes too far", "lengths within the segment")  # fmt: skip
        return self.data[begin : self.place]

    def number(self, kind: str = "L") -> int:
        value: int = struct.unpack(f"{self.order}{kind}", self.take(struct.calcsize(f"={kind}")))[0]
        return value

    def text(self) -> bytes:
        return self.take(self.number())


def walk_tdms(data: bytes, where: object) -> dict[str, int]:
    """Follow the segments of a TDMS file; return object path -> number of values of those that have any.

    Raises
    ------
    UnreadableError
        rule ``truncated``: a segment was not finished or ends beyond the file; ``damaged``: there is no
        lead-in where one belongs, or claims and data differ; ``not-numbers``: a channel of texts;
        ``format-version``: another version, or raw data of a DAQmx device
    """
    place = 0
    counts: dict[str, int] = {}
    objects: dict[str, tuple[int, int]] = {}  # path -> (bytes of a value, values in a chunk), of all segments
    active: dict[str, tuple[int, int]] = {}  # of the present one
    while place < len(data):
        head = data[place : place + _LEAD_IN]
        if len(head) < _LEAD_IN:
            truncated(where, "the TDMS file ends within a segment", f"{len(data)} bytes", "whole segments")
        if head[:4] != b"TDSm":
            damaged(where, "a TDMS segment does not begin where the last one ends", f"byte {place}", "TDSm")
        mask = struct.unpack_from("<L", head, 4)[0]
        order = ">" if mask & _BIG_ENDIAN else "<"
        version_number, following, offset = struct.unpack_from(f"{order}LQQ", head, 8)
        if version_number not in _VERSIONS:
            version(where, "the TDMS file is of a version that is not read", version_number,
                    " or ".join(map(str, _VERSIONS)), "write it again as TDMS 2.0")  # fmt: skip
        if mask & _DAQMX:
            _daqmx(where)
        begin = place + _LEAD_IN
        end = begin + following
        if following == _UNFINISHED or end > len(data):
            truncated(where, "the TDMS file ends within a segment",
                      f"{len(data)} bytes", "a last segment that was closed by the acquisition program"
                      if following == _UNFINISHED else f"{end} bytes, as the file itself says")  # fmt: skip
        if offset > following:
            damaged(where, "a TDMS segment's data begins beyond its end", offset, f"at most {following}")
        if mask & _META_DATA:
            if mask & _NEW_LIST:
                active = {}
            _objects(_Reader(data, begin, begin + offset, order, where), objects, active)
        if mask & _RAW_DATA:
            _count(counts, active, following - offset, where)
        place = end
    return counts


def _objects(
    reader: _Reader, objects: dict[str, tuple[int, int]], active: dict[str, tuple[int, int]]
) -> None:
    for _ in range(reader.number()):
        path = reader.text().decode("utf-8", "replace")
        index = reader.number()
        if index in _DAQMX_INDEXES:
            _daqmx(reader.where)
        if index == _NO_DATA:
            active.pop(path, None)
        elif index == _AS_BEFORE:
            if path not in objects:
                damaged(
                    reader.where, "a TDMS channel repeats what was never said", path, "an index of its data"
                )
            active[path] = objects[path]
        else:
            active[path] = objects[path] = _raw_index(reader, path)
        for _ in range(reader.number()):
            reader.text()
            kind = reader.number()
            if kind != _STRING and kind not in _SIZES:
                damaged(
                    reader.where, "a TDMS property has a type that there is not", hex(kind), "a known type"
                )
            reader.take(reader.number() if kind == _STRING else _SIZES[kind])


def _raw_index(reader: _Reader, path: str) -> tuple[int, int]:
    kind, dimension, count = reader.number(), reader.number(), reader.number("Q")
    if kind == _STRING:
        no_numbers(reader.where, f"the TDMS channel {path} holds text", "a channel of texts")
    if kind not in _SIZES or dimension != 1:
        damaged(reader.where, f"the TDMS channel {path} has data of no known type", f"{hex(kind)}, "
                f"{dimension} dimensions", "a column of numbers")  # fmt: skip
    return _SIZES[kind], count


def _count(counts: dict[str, int], active: dict[str, tuple[int, int]], raw: int, where: object) -> None:
    chunk = sum(size * values for size, values in active.values())
    if raw == 0:
        return
    if chunk == 0 or raw % chunk:
        damaged(where, "a TDMS segment's channels and its data differ in length", f"{raw} bytes of data",
                f"a multiple of {chunk} bytes, as its channels say")  # fmt: skip
    for path, (_, values) in active.items():
        counts[path] = counts.get(path, 0) + raw // chunk * values


def _daqmx(where: object) -> None:
    version(where, "the TDMS file holds raw data of a DAQmx device", "unscaled values", "scaled values",
            "write the channels' scaled values to the file")  # fmt: skip


def read_tdms(data: bytes, where: object, machine: Machine) -> Vectors:
    """Return the channels of the one group that is the recording, scaled as the file says.

    A waveform's ``wf_increment`` is no time channel.

    Raises
    ------
    ConfigError
        rule ``missing-extra``
    UnreadableError
        rule ``unreadable damaged no-data``
    RecordingError
        rule ``several-sheets``
    """
    nptdms: Any = needed("nptdms", extra="tdms", to="read a TDMS file", where=where)
    # What it says on its own stream is no matter here: the walk has checked every length.
    needed("nptdms.log", extra="tdms", to="read a TDMS file", where=where).log_manager.set_level(
        logging.CRITICAL
    )
    counts = walk_tdms(data, where)
    refused = read_by_library(
        "the TDMS file cannot be read", where=where, expected="a TDMS file as LabVIEW writes it",
        next_step="copy it again from the machine",
    )  # fmt: skip
    with refused, nptdms.TdmsFile.open(io.BytesIO(data), raw_timestamps=True) as file:
        channels = [(group.name, channel) for group in file.groups() for channel in group.channels()]
        _check_counts(channels, counts, where)
        names = dict.fromkeys(name for name, _ in channels)
        tables = [
            Vectors(
                where=f"{where}, group {name!r}",
                vectors=[_vector(channel) for group, channel in channels if group == name],
            )
            for name in names
        ]
    return one_table(tables, machine, where=where)


def _check_counts(channels: list[tuple[str, Any]], counts: dict[str, int], where: object) -> None:
    for name, channel in channels:
        if len(channel) != counts.get(channel.path, 0):
            damaged(where, f"channel {channel.name!r} of group {name!r} has another length than it says",
                    len(channel), counts.get(channel.path, 0))  # fmt: skip


def _vector(channel: Any) -> Vector:
    values = np.asarray(channel.read_data(scaled=True))
    stored = np.asarray(channel.read_data(scaled=False))
    plain = stored.ndim == 1 and len(stored) == len(values) and len(values) and values.dtype.kind in "fiu"
    stated = channel.properties.get("unit_string")
    return Vector(
        name=str(channel.name),
        unit=None if stated is None else str(stated),
        values=values,
        half=quantum(stored, values) if plain else None,
    )


def tdms_bytes(columns: Sequence[Written], title: str) -> bytes:
    """Return a TDMS file of one group, its channels' units in ``unit_string``."""
    nptdms: Any = needed("nptdms", extra="tdms", to="write a TDMS file", where=title)
    stream = io.BytesIO()
    with nptdms.TdmsWriter(stream) as file:
        file.write_segment(
            [
                nptdms.RootObject(properties={"description": title}),
                *(
                    nptdms.ChannelObject(
                        "recording", column.name, column.values, properties={"unit_string": column.unit}
                    )
                    for column in columns
                ),
            ]
        )
    return stream.getvalue()
