"""TDMS: LabVIEW's binary channels, by npTDMS; a channel's unit is its property ``unit_string``."""

from __future__ import annotations

import io
import logging
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.errors import UnreadableError
from toolkit.machine import Machine
from toolkit.recording.extras import needed
from toolkit.recording.formats.vectors import Vector, Vectors, one_table, quantum
from toolkit.recording.integrity.refuse import damaged
from toolkit.recording.integrity.tdms import walk_tdms

if TYPE_CHECKING:
    from toolkit.recording.safe_open import Gated


def read_tdms(gated: Gated, machine: Machine) -> Vectors:
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
    nptdms: Any = needed("nptdms", extra="tdms", to="read a TDMS file", where=gated.path)
    # What it says on its own stream is no matter here: the walk has checked every length.
    needed("nptdms.log", extra="tdms", to="read a TDMS file", where=gated.path).log_manager.set_level(
        logging.CRITICAL
    )
    counts = walk_tdms(gated.data, gated.path)
    try:
        with nptdms.TdmsFile.open(io.BytesIO(gated.data), raw_timestamps=True) as file:
            channels = [(group.name, channel) for group in file.groups() for channel in group.channels()]
            _check_counts(channels, counts, gated)
            names = dict.fromkeys(name for name, _ in channels)
            tables = [
                Vectors(
                    where=f"{gated.path}, group {name!r}",
                    vectors=[_vector(channel) for group, channel in channels if group == name],
                )
                for name in names
            ]
    except UnreadableError:
        raise
    except Exception as error:
        raise UnreadableError(
            "the TDMS file cannot be read",
            where=gated.path,
            got=f"{type(error).__name__}: {error}"[:300],
            expected="a TDMS file as LabVIEW writes it",
            next_step="copy it again from the machine",
            rule="unreadable",
        ) from error
    return one_table(tables, machine, where=gated.path)


def _check_counts(channels: list[tuple[str, Any]], counts: dict[str, int], gated: Gated) -> None:
    for name, channel in channels:
        if len(channel) != counts.get(channel.path, 0):
            damaged(gated.path, f"channel {channel.name!r} of group {name!r} has another length than it says",
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
