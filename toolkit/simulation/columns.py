"""The further columns of a continuous recording and of a case: their units and digits."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from toolkit.simulation.cells import CELLS
from toolkit.units import from_si

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

# Unit and decimals of each; angles grow from row to row and do not wrap.
UNITS = {
    "t": ("s", 6),
    "SA_CMD": ("deg", 5),
    "FZ_CMD": ("N", 3),
    "V": ("km/h", 5),
    "TIRE_ANGLE": ("deg", 3),
    "DRUM_ANGLE": ("deg", 3),
    "T_TREAD": ("degC", 4),
    "T_AMBIENT": ("degC", 4),
    "P_INFL": ("kPa", 4),
    "SA": ("deg", 6),
    "FZ": ("N", 4),
    "FY": ("N", 5),
    "MZ": ("N*m", 6),
    **dict.fromkeys(CELLS, ("mV/V", 8)),
}
FURTHER = ("t", "SA_CMD", "FZ_CMD", "V", "TIRE_ANGLE", "DRUM_ANGLE", "T_TREAD", "T_AMBIENT", "P_INFL")


def unit_of(name: str) -> str:
    """Return the unit of a column."""
    return UNITS[name][0]


def shown(signals: Mapping[str, NDArray[np.float64]], name: str) -> NDArray[np.float64]:
    """Return a signal [SI] in its column's unit and digits."""
    text, decimals = UNITS[name]
    return np.asarray(np.round(from_si(signals[name], text), decimals) + 0.0, dtype=np.float64)


def further(signals: Mapping[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
    """Return the further columns of a continuous recording, under headers with their units."""
    return {f"{name} [{unit_of(name)}]": shown(signals, name) for name in FURTHER}
