"""The load cells of the hub: what they measure beside FY and MZ; what can hang there to calibrate them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from toolkit.declared import Above, AtLeast, Distinct, Entry, Fault, Format, Keyed, Size, Unit

HubSymbol = Literal["FX", "FZ", "MX", "MY"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Hub:
    """Calibrated loads of the hub beside FY and MZ, right-handed in the machine's axes about the spindle.

    ``arm_m`` is the distance from the spindle's axis down to the contact patch, the loaded radius, by which
    MX and MY are carried from the spindle to the contact patch; None leaves them at the spindle.
    ``u_arm_m`` is its standard uncertainty.
    """

    loads: Annotated[
        tuple[HubSymbol, ...], Size(1), Distinct(),
        Entry("by the calibration record, beside FY and MZ; right-handed about the spindle, FZ the load on "
              "the tire", example=["FX", "FZ", "MX", "MY"]),
    ]  # fmt: skip
    arm_m: Annotated[
        float | None, Unit("mm"), Above(0),
        Entry("from the spindle's axis to the contact patch (loaded radius): MX and MY are carried there; "
              "without it they stay at the spindle", key="arm"),
    ] = None  # fmt: skip
    u_arm_m: Annotated[
        float, Unit("mm"), AtLeast(0), Entry("standard uncertainty of the arm", key="u_arm")
    ] = 0.0

    def faults(self) -> Iterator[Fault]:
        """Yield an arm that nothing is carried by, and one that MY cannot be carried by without FX."""
        if self.arm_m is None and self.u_arm_m:
            yield Fault(key=("u_arm",), got=self.u_arm_m, expected="u_arm beside arm", what="has no arm")
        if self.arm_m is not None and not {"MX", "MY"} & set(self.loads):
            yield Fault(
                key=("arm",), got=self.arm_m, expected="an arm beside MX or MY in loads",
                what="carries no moment",
            )  # fmt: skip
        if self.arm_m is not None and "MY" in self.loads and "FX" not in self.loads:
            yield Fault(
                key=("loads",), got=list(self.loads), expected="FX beside MY, or no arm",
                what="MY is carried to the contact patch by FX, which is not there",
            )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Fixture:
    """A way to hang weights: the loads that a newton makes, and the weights that can hang there."""

    name: Annotated[str, Entry("as the operator knows it", example="lateral pull")]
    per_newton: Annotated[
        tuple[tuple[str, float], ...], Keyed(), Size(1),
        Entry("load by newton of weight: 1 for a force, the lever arm in metres for a moment",
              example={"FY": 1.0}),
    ]  # fmt: skip
    weights_N: Annotated[
        tuple[float, ...], Unit("N"), Above(0), Size(1), Distinct(),
        Entry("what can hang there, all that hangs counted", key="weights",
              example={"value": [500, 1000], "unit": "N"}),
    ]  # fmt: skip
    both: Annotated[bool, Entry("whether it can be turned to pull the other way")] = True
    minutes: Annotated[float, AtLeast(0), Entry("from one reading to the next")] = 2.0
    setup_minutes: Annotated[float, AtLeast(0), Entry("to mount it, each time and each way")] = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Loading:
    """What can be loaded: fixtures, the largest loads, minutes before a run."""

    run_minutes: Annotated[float, AtLeast(0), Entry("before every run: preload, rest, zero")] = 10.0
    limits: Annotated[
        tuple[tuple[str, float], ...], Keyed(), Unit("N", "N*m"), Above(0),
        Entry("largest load that may be put on, by load", key="limit",
              example={"FY": {"value": 6000, "unit": "N"}}),
    ] = ()  # fmt: skip
    fixtures: Annotated[
        tuple[Fixture, ...], Size(1), Distinct("name"), Entry("one entry a fixture", key="fixture")
    ]

    def faults(self) -> Iterator[Fault]:
        """Yield a fixture that makes no load at all."""
        for number, fixture in enumerate(self.fixtures):
            if not any(arm for _, arm in fixture.per_newton):
                yield Fault(
                    key=("fixture", number, "per_newton"), got=dict(fixture.per_newton),
                    expected="a load that is not zero", what="the fixture makes no load",
                )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadingFixtures(Loading):
    """The fixtures of an instrument's calibration, in a file of their own."""

    FORMAT: ClassVar[Format] = Format(title="loading fixtures", schema=1)

    instrument: Annotated[str, Entry("what they calibrate", example="rig")]
