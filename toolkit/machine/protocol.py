"""A test protocol as data: what is measured, in what order, how settled, and how near is near enough.

A machine definition holds its default; ``protocol = "file.toml"`` in ``test.toml`` or ``--protocol FILE``
gives another one. The entries are the same in both.

A machine definition also says what the machine can do while it records in time: its speeds, how fast it
steers, which channel is late.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from toolkit.channels import Rotation
from toolkit.declared import Above, AtLeast, AtMost, Below, Distinct, Entry, Fault, Format, Size, Unit, read

Acquisition = Literal["after_settling", "continuous"]
Shaft = Literal["tire", "drum"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Protocol:
    """The test plan that a test is checked against.

    ``rotations`` ``speed_m_s`` ``speed_tolerance_m_s`` are None where the machine's own apply;
    ``settle_revolutions`` and ``average_revolutions`` count turns of the shaft ``revolutions_of``.
    """

    FORMAT: ClassVar[Format] = Format(title="protocol", schema=1)

    source: Annotated[
        str,
        Entry(
            "where the protocol comes from, and how it departs from that",
            expected="a text: where the protocol comes from",
        ),
    ]
    slip_angles_rad: Annotated[
        tuple[float, ...], Unit("deg"), Above(-90), Below(90), Size(1),
        Entry(
            "as the machine shows them, in the order of the test; a step that stands twice is measured twice",
            key="slip_angles",
            example={"value": [0, 1, -1, 0], "unit": "deg"},
        ),
    ]  # fmt: skip
    loads_N: Annotated[
        tuple[float, ...], Unit("N"), Above(0), Size(1), Distinct(),
        Entry("loads on the tire", key="loads", example={"value": [250, 567], "unit": "lbf"}),
    ]  # fmt: skip
    rotations: Annotated[
        tuple[Rotation, ...] | None,
        Size(1),
        Distinct(),
        Entry("directions of the drum; default: the machine's"),
    ] = None
    repeats: Annotated[int, AtLeast(1), Entry("of every condition")] = 1
    speed_m_s: Annotated[
        float | None, Unit("km/h"), Above(0), Entry("surface speed; default: the drum's", key="speed")
    ] = None
    speed_tolerance_m_s: Annotated[
        float | None, Unit("km/h"), Above(0), Entry("default: the drum's", key="speed_tolerance")
    ] = None
    slip_angle_tolerance_rad: Annotated[
        float, Unit("deg"), Above(0), Entry("of a slip angle about its step", key="slip_angle_tolerance")
    ]
    load_tolerance: Annotated[float, Above(0), Entry("as a part of the load", example=0.05)]
    repeat_tolerance: Annotated[
        float, Above(0), Entry("drift between declared repeats, as a part of the largest value at the load")
    ] = 0.03
    settle_revolutions: Annotated[
        float, AtLeast(0), Entry("turns of the shaft before acquisition starts", example=2.5)
    ]
    average_revolutions: Annotated[float, Above(0), Entry("turns of the shaft over which is averaged")]
    revolutions_of: Annotated[Shaft, Entry("the shaft whose turns are counted")] = "tire"
    acquisition: Annotated[
        Acquisition, Entry("whether the file holds recorded turns alone, or every row from the start")
    ]

    def times(self, step_SA: float) -> int:
        """Return how often a slip angle step [rad] is measured at each load and direction."""
        return self.repeats * max(1, Counter(self.slip_angles_rad)[step_SA])


def read_protocol(path: Path) -> Protocol:
    """Read a protocol file.

    Raises
    ------
    ConfigError
        no file, not TOML; every entry that is unknown, missing or has a value that does not fit
    """
    return read(Protocol, path)


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
