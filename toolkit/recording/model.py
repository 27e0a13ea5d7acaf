"""Recording: what one file holds, in the units of the file, and what it says about itself."""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from toolkit.arrays import Array
from toolkit.channels import Reversal
from toolkit.errors import ColumnError
from toolkit.printable import escaped
from toolkit.units import to_si

if TYPE_CHECKING:
    from toolkit.machine import Machine
    from toolkit.machine.definition import Role


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Series:
    """One column of a recording.

    ``values`` (rows,) float64, read-only, in ``unit`` as the file has them; ``header`` as written there.
    ``half`` (rows,): half the step in which a binary file stores a value, in ``unit``; None where what its
    digits show is all that is known of its rounding. ``sign`` makes the load on the tire of a vertical force
    that the file has along z: in SI alone.
    """

    symbol: str
    header: str
    unit: str
    role: Role
    values: Array
    half: Array | None = None
    sign: Literal[1, -1] = 1

    @property
    def si(self) -> Array:
        """The values in SI (rows,)."""
        return self.si_of(slice(None))

    def si_of(self, rows: slice) -> Array:
        """Return the values of some rows in SI."""
        values = to_si(self.values[rows], self.unit)
        return values if self.sign == 1 else -values


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Recording:
    """One file of a test. Rows count from 1 at the first data row.

    ``saved`` is the day on which the file, by its own properties, was last written; None where it is silent.
    ``hidden`` are the worksheet's numbers of rows of data that the workbook hides;
    ``cut`` is the number within which a text file ends.
    """

    path: Path
    sha256: str
    machine: Machine
    series: tuple[Series, ...]
    simulated: bool
    format: str
    saved: dt.date | None = None
    hidden: tuple[int, ...] = ()
    cut: str | None = None

    @property
    def rows(self) -> int:
        """Number of data rows."""
        return len(self.series[0].values)

    @property
    def name(self) -> str:
        """The file's name, as text: a disk has names that no text and no document can hold."""
        return escaped(self.path.name, lines=False)

    def name_in(self, folder: Path) -> str:
        """Return the file's name below a folder, as text."""
        return escaped(self.path.relative_to(folder).as_posix(), lines=False)

    def has(self, symbol: str) -> bool:
        """Tell whether the recording has a channel."""
        return any(channel.symbol == symbol for channel in self.series)

    def __getitem__(self, symbol: str) -> Series:
        """Return a channel.

        Raises
        ------
        ColumnError
            the recording has no such channel
        """
        for channel in self.series:
            if channel.symbol == symbol:
                return channel
        raise ColumnError(
            f"the recording has no channel {symbol}",
            where=self.path,
            got=", ".join(channel.header for channel in self.series),
            expected=symbol,
            next_step="check the file's header row",
            rule="missing-column",
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class TestInfo:
    """What ``test.toml`` says; texts as written, None where it is silent. Pressure [Pa], speed [m/s].

    ``reversal`` says what was turned for the runs called reverse: the drum, or the tire on its hub.
    ``mounting`` and ``laboratory`` tell repeats apart; ``tire_belt`` says how a prototype's belt cords
    were laid: regular or reversed.
    """

    __test__ = False  # not a pytest class

    name: str
    machine: str
    date: str | None = None
    operator: str | None = None
    requestor: str | None = None
    surface: str | None = None
    special: str | None = None
    speed_m_s: float | None = None
    pressure_Pa: float | None = None
    rated_load_N: float | None = None
    tire_size: str | None = None
    tire_company: str | None = None
    tire_DOT: str | None = None
    tire_series: str | None = None
    tire_construction: str | None = None
    tire_rim: str | None = None
    simulated: bool = False
    reversal: Reversal = "drum"
    mounting: str | None = None
    laboratory: str | None = None
    tire_belt: str | None = None
