"""A test protocol as data: what is measured, in what order, how settled, and how near is near enough.

A machine definition holds its default; ``protocol = "file.toml"`` in ``test.toml`` or ``--protocol FILE``
gives another one. The entries are the same in both.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from toolkit.channels import Rotation
from toolkit.declared import Above, AtLeast, Below, Distinct, Entry, Format, Size, Unit, read

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
