"""The machine's own file as a run of a case: columns under the channels' symbols and in the case's units."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from toolkit.errors import UnitError
from toolkit.units import unit

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


def is_of_machine(header: Collection[str], machine: str) -> bool:
    """Tell whether a header row is that of a machine's acquisition program."""
    from toolkit.machine import load_machine

    return any(one.header in header for one in load_machine(machine).columns)


def read_workbook(
    path: Path, data: bytes, machine: str, units: Mapping[str, str]
) -> dict[str, NDArray[np.float64]]:
    """Return a file's columns by symbol, each in the unit that the case states for it.

    Raises
    ------
    UnreadableError
        it is no recording of the machine; UnitError: a stated unit is of another dimension
    """
    from toolkit.machine import load_machine
    from toolkit.recording.read import read_recording

    made = {}
    for one in read_recording(path, load_machine(machine), data=data).series:
        if one.symbol not in units:
            continue
        stated = unit(units[one.symbol])
        if stated.dimension != unit(one.unit).dimension:
            raise UnitError(
                "a channel's unit does not fit the recording's",
                where=f"{path}: {one.symbol}",
                got=stated.text,
                expected=one.unit,
                next_step="correct the unit in the case",
                rule="case",
            )
        made[one.symbol] = (one.si - stated.offset) / stated.factor
    return made
