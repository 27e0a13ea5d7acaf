"""The columns of a case's recordings, and what they tell: channels, roles, another program's output."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from toolkit.inputs import RECORDING_FILE, read_input
from toolkit.lab.starters import guess_case, headers_of
from toolkit.recording.sniff import sniff

_ROLES = {
    "time": "time", "load": "input", "slip_angle": "input", "indication": "output",
    "covariate": "covariate", "angle": "covariate",
}  # fmt: skip
"""What a column of a machine's recordings is to its simulation; what the rig computed is none of it."""
_MEASUREMENTS = ("tdms", "mdf", "mat", "hdf5", "lvm")
"""Kinds of files that name their channels otherwise than by a first row."""


def guessed_case(folder: Path, names: Sequence[str], kind: str) -> dict[str, Any]:
    """Return the entries of a case of some recordings, as far as their headers tell."""
    columns = columns_of(folder, names)
    guess = guess_case(names[0], [(name, name, unit) for name, unit in columns.items()]).values
    simulation: dict[str, Any] = {"kind": kind}
    if guess.get("simulation", {}).get("kind") == kind:
        simulation = guess["simulation"]
    channels = guess["recording"].get("channels", {})
    if kind == "machine":
        channels = _with_own_channels(channels, columns)
    recording = {"channels": channels, "run": [{"file": name} for name in names]}
    return {"schema": 1, "title": Path(names[0]).stem, "simulation": simulation, "recording": recording}


def _with_own_channels(
    channels: Mapping[str, dict[str, str]], columns: Mapping[str, str | None]
) -> dict[str, dict[str, str]]:
    """Return channels with those of the standard machine's own recordings, by symbol, in their places."""
    from toolkit.machine import load_machine
    from toolkit.machine.default import DEFAULT_MACHINE

    own = load_machine(DEFAULT_MACHINE).columns
    names = {name for column in own for name in (column.header, column.symbol)}
    return {name: entries for name, entries in channels.items() if name not in names} | {
        column.symbol: {
            "unit": columns.get(column.symbol) or columns.get(column.header) or column.unit,
            "role": _ROLES[column.role],
        }
        for column in own
        if column.role in _ROLES and (column.header in columns or column.symbol in columns)
    }


def columns_of(folder: Path, names: Iterable[str]) -> dict[str, str | None]:
    """Return the columns of recordings with their units; None where a header states none.

    Raises
    ------
    RecordingError
        a header cannot be read
    """
    columns: dict[str, str | None] = {}
    for name in names:
        with contextlib.suppress(OSError):
            state = (folder / name).stat()
            for column, unit in _header(folder / name, state.st_mtime_ns, state.st_size):
                columns[column] = columns.get(column) or unit
    return columns


@lru_cache(maxsize=256)
def _header(path: Path, _changed: int, _size: int) -> tuple[tuple[str, str | None], ...]:
    from toolkit.recording.columns import rig
    from toolkit.recording.read import read_recording

    data = read_input(path, RECORDING_FILE)
    if sniff(data).id in _MEASUREMENTS:
        series = read_recording(path, rig("the case", {}), data=data).series
        return tuple((column.symbol, column.unit) for column in series)
    return tuple((plain, unit) for _, plain, unit in headers_of(path))
