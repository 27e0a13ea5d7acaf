"""A format with every type and mark, for the tests of the declarations."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from toolkit.declared import (
    Above,
    AtLeast,
    AtMost,
    Below,
    Day,
    Distinct,
    Entry,
    Fault,
    Format,
    Keyed,
    Names,
    Size,
    Text,
    Unit,
    UnitName,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """One load cell."""

    name: str
    gain: Annotated[float, Above(0), Entry("output for a unit of load")]
    u: Annotated[float, Unit("N", "N*m", beside="unit"), AtLeast(0), Entry("standard uncertainty")] = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Channel:
    """A column."""

    symbol: Annotated[str, Text(pattern="[A-Z]+[0-9]*"), Entry(example="A")]
    unit: Annotated[str, UnitName(("force", "angle"))] = "N"
    role: Literal["load", "angle"] = "load"


@dataclass(frozen=True, slots=True, kw_only=True)
class Constant:
    """A rate that stays."""

    kind: Literal["constant"]
    rate: Annotated[float, Unit("Hz")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """A rate that changes."""

    kind: Literal["sweep", "chirp"]
    limits: tuple[Annotated[float, Unit("Hz")], Annotated[float, Unit("Hz")]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """A check table."""

    file: Path
    tolerance: Annotated[
        tuple[tuple[str, float], ...], Keyed(), Names(of="loads"), Unit("N", "N*m"), Above(0)
    ] = ()


def _renamed(table: dict[str, Any]) -> dict[str, Any]:
    return {("title" if key == "heading" else key): entry for key, entry in table.items()}


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """A file with everything in it."""

    FORMAT: ClassVar[Format] = Format(
        title="sample", schema=2, older={1: _renamed}, next_step="correct {key}; nothing was written"
    )
    title: Annotated[str, Entry("what it is for", example="a sample")]
    loads: Annotated[tuple[str, ...], Size(1), Distinct(), Entry("names of the loads", example=["FY", "MZ"])]
    day: Annotated[dt.date, Entry("when it was made")]
    speed_m_s: Annotated[
        float, Unit("km/h"), Above(0), Entry("surface speed", key="speed", old=("velocity",))
    ]
    channels: Annotated[tuple[Channel, ...], Size(1), Distinct("symbol"), Entry(key="channel", example=None)]
    angles_rad: Annotated[
        tuple[float, ...], Unit("deg"), Above(-90), Below(90), Size(1), Distinct(), Entry(key="angles")
    ] = (0.0,)
    number: Annotated[str, Text(numbers="int", strip=True)] = "1"
    switched: bool = False
    share: Annotated[float, AtLeast(0), AtMost(1)] = 0.5
    count: Annotated[int, AtLeast(1)] = 1
    since: Annotated[str | None, Day()] = None
    pitch_m: Annotated[float | None, Unit("mm", plain=True), Entry(key="pitch")] = None
    folder: Path | None = None
    bounds: Annotated[tuple[float, float] | None, Entry(example=[0, 1])] = None
    signs: Annotated[Mapping[str, Literal[1, -1]], Names(of="loads")] | None = None
    cells: Annotated[tuple[Cell, ...], Keyed("name"), Names(of="channel.symbol", role="load")] = ()
    rate: Constant | Sweep | None = None
    check: Annotated[Path | Check | None, Entry("a file, or a table", example="check.csv")] = None
    extra: Any = None
    note: Annotated[str, Text(empty=True)] = ""
    country: Annotated[
        str, Text(pattern="[A-Z]{2}"), Entry(example="US", expected='an ISO 3166-1 code, such as "US"')
    ] = "US"

    def faults(self) -> Iterator[Fault]:
        """Yield what does not fit together."""
        if self.bounds is not None and self.bounds[0] >= self.bounds[1]:
            yield Fault(key=("bounds",), got=self.bounds, expected="the lower bound first", rule="bounds")


MINIMAL = """\
schema = 2
title = "short"
loads = ["FY", "MZ"]
day = 2026-03-31
speed = { value = 72, unit = "km/h" }
[[channel]]
symbol = "D51"
"""
WHOLE = """\
schema = 2
title = "whole"
loads = ["FY", "MZ"]
day = "2026-03-31"
speed = { value = 72, unit = "km/h" }
angles = { value = [0, 1.5, -2], unit = "deg" }
number = 17
switched = true
share = 1
count = 3
since = 2026-01-01
pitch = 200
folder = "data/raw"
bounds = [-1, 2.5]
signs = { FY = 1, MZ = -1 }
extra = { any = ["thing"] }
country = "DE"

[[channel]]
symbol = "D51"
unit = "lb"
role = "load"
[[channel]]
symbol = "SA"
unit = "deg"
role = "angle"

[cells.D51]
gain = 2.5
u = 15
unit = "lbf"

[rate]
kind = "chirp"
limits = [{ value = 1, unit = "Hz" }, { value = 20, unit = "Hz" }]

[check]
file = "check.csv"
tolerance = { FY = { value = 2, unit = "lbf" }, MZ = { value = 0.1, unit = "N*m" } }
"""
