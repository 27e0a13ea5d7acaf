"""What a machine can do while it records in time: its speeds, how fast it steers, which channel is late."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated

from toolkit.declared import Above, AtLeast, AtMost, Entry, Fault, Size, Unit


@dataclass(frozen=True, slots=True, kw_only=True)
class Delay:
    """By how much FY is later than the slip angle in the files [s], filters among it."""

    value_s: Annotated[
        float,
        Unit("ms"),
        Entry("of FY behind the slip angle", key="value", example={"value": 0, "unit": "ms"}),
    ]
    u_s: Annotated[
        float,
        Unit("ms"),
        AtLeast(0),
        Entry("standard uncertainty", key="u", example={"value": 2, "unit": "ms"}),
    ]
    source: Annotated[str, Entry("what it rests on")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweeping:
    """The sweeps of the slip angle that a machine can record in time.

    ``speeds_m_s`` and ``steer_rates_rad_s`` are the least and the largest, ``amplitudes_rad`` of a sweep to
    either side; ``sample_rate_Hz`` that of the rows where they have no time of their own.
    """

    speeds_m_s: Annotated[
        tuple[float, ...], Unit("km/h"), Above(0), Size(2, 2),
        Entry("least and largest surface speed", key="speeds", example={"value": [4, 12], "unit": "km/h"}),
    ]  # fmt: skip
    steer_rates_rad_s: Annotated[
        tuple[float, ...], Unit("deg/s"), Above(0), Size(2, 2),
        Entry("slowest and quickest steady move", key="steer_rates",
              example={"value": [0.5, 4], "unit": "deg/s"}),
    ]  # fmt: skip
    sample_rate_Hz: Annotated[
        float | None, Unit("Hz"), Above(0),
        Entry("of rows without a time of their own", key="sample_rate"),
    ] = None  # fmt: skip
    speed_u: Annotated[
        float, AtLeast(0), AtMost(0.5), Entry("relative standard uncertainty of the speed")
    ] = 0.005
    delay: Annotated[
        Delay | None,
        Entry("of FY behind the slip angle; without it a relaxation length takes two speeds"),
    ] = None  # fmt: skip
    source: Annotated[str, Entry("what the limits rest on")]

    def faults(self) -> Iterator[Fault]:
        """Yield limits that are no limits: the larger first."""
        for key, limits in (("speeds", self.speeds_m_s), ("steer_rates", self.steer_rates_rad_s)):
            low, high = limits
            if not (math.isfinite(high) and low <= high):
                yield Fault(key=(key,), got=list(limits), expected="the smaller first", what="is no range")
