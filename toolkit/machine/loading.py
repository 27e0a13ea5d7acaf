"""What a laboratory can hang on a machine's load cells to calibrate them: fixtures, weights, minutes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, ClassVar

from toolkit.declared import Above, AtLeast, Distinct, Entry, Fault, Format, Keyed, Size, Unit


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
