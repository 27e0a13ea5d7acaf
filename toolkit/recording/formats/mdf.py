"""MDF 4, by asammdf: the channels of one channel group, its time master as the time."""

from __future__ import annotations

import io
import logging
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.errors import CellError, UnreadableError
from toolkit.machine import Machine
from toolkit.recording.extras import needed
from toolkit.recording.formats.vectors import Vector, Vectors, one_table, quantum

if TYPE_CHECKING:
    from toolkit.recording.safe_open import Gated

_MASTERS = (2, 3)  # kinds of channels, measured and virtual
_TIME = 1
_ALL_INVALID = 1


def read_mdf(gated: Gated, machine: Machine) -> Vectors:
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
    asammdf: Any = needed("asammdf", extra="mdf", to="read an MDF file", where=gated.path)
    logging.getLogger("asammdf").setLevel(logging.CRITICAL)  # what matters of it is said by an error
    try:
        with asammdf.MDF(io.BytesIO(gated.data)) as file:
            tables = [
                Vectors(
                    where=f"{gated.path}, channel group {index + 1}",
                    vectors=[
                        _vector(file, index, place, channel, gated)
                        for place, channel in enumerate(group.channels)
                    ],
                )
                for index, group in enumerate(file.groups)
                if group.channel_group.cycles_nr
            ]
    except (UnreadableError, CellError):
        raise
    except Exception as error:
        raise UnreadableError(
            "the MDF file cannot be read",
            where=gated.path,
            got=f"{type(error).__name__}: {error}"[:300],
            expected="an MDF 4 file",
            next_step="copy it again from the machine",
            rule="unreadable",
        ) from error
    return one_table(tables, machine, where=gated.path)


def _vector(file: Any, group: int, place: int, channel: Any, gated: Gated) -> Vector:
    values, invalid = file.get(group=group, index=place, samples_only=True, ignore_invalidation_bits=True)
    stored, _ = file.get(group=group, index=place, samples_only=True, raw=True, ignore_invalidation_bits=True)
    if channel.flags & _ALL_INVALID or (invalid is not None and np.any(invalid)):
        row = 1 if channel.flags & _ALL_INVALID else int(np.argmax(np.asarray(invalid))) + 1
        raise CellError(
            f"data row {row}, channel {channel.name!r}: no number",
            where=f"{gated.path}, channel group {group + 1}, data row {row}, channel {channel.name!r}",
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
