"""What identification needs of a file: indications, own FY and MZ, and what rounding may hide of each."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.recording.digits import roundings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.recording.model import Recording

LOADS = ("FY", "MZ")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Columns:
    """A file's columns in its own units.

    ``x`` (rows, n) indications as the header names them, ``half_x`` their half last printed place;
    ``y`` and ``half_y`` (rows,) of each acquired channel that the file has.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    x: NDArray[np.float64]
    half_x: NDArray[np.float64]
    y: dict[str, NDArray[np.float64]]
    half_y: dict[str, NDArray[np.float64]]
    y_units: dict[str, str]

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(self.x)

    def part(self, rows: slice | NDArray[np.int64]) -> Columns:
        """Return some of the rows; each keeps the last place that the whole file gave it."""
        return replace(
            self,
            x=self.x[rows],
            half_x=self.half_x[rows],
            y={load: values[rows] for load, values in self.y.items()},
            half_y={load: values[rows] for load, values in self.half_y.items()},
        )

    @property
    def loads(self) -> tuple[str, ...]:
        """The acquired channels that the file has."""
        return tuple(self.y)


def columns_of(recording: Recording) -> Columns:
    """Return a recording's columns for identification."""
    cells = [channel for channel in recording.series if channel.role == "indication"]
    loads = [
        channel for channel in recording.series if channel.role == "acquired" and channel.symbol in LOADS
    ]
    x = np.column_stack([cell.values for cell in cells]) if cells else np.empty((recording.rows, 0))
    half = roundings([*cells, *loads]) if cells or loads else np.empty((0, recording.rows))
    return Columns(
        names=tuple(cell.symbol for cell in cells),
        units=tuple(cell.unit for cell in cells),
        x=x,
        half_x=np.ascontiguousarray(half[: len(cells)].T),
        y={channel.symbol: channel.values for channel in loads},
        half_y={channel.symbol: values for channel, values in zip(loads, half[len(cells) :], strict=True)},
        y_units={channel.symbol: channel.unit for channel in loads},
    )
