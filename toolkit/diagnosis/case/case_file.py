"""CASE.toml, declared once: a simulation, the channels, and the recordings with their conditions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

from toolkit.channels import Axes
from toolkit.declared import Entry, Fault, Format, Keyed, Size, Text, nearest
from toolkit.diagnosis.case.case import CaseChannel
from toolkit.diagnosis.case.simulation import (
    FORMAT,
    ColumnsSimulation,
    FmuSimulation,
    MachineSimulation,
    ModelSimulation,
    OdeSimulation,
    PythonSimulation,
)
from toolkit.units import unit

CONDITIONS = {
    "rotation": ("forward", "reverse"),
    "mounting": ("normal", "turned"),
    "phase": ("tare", "test"),
}
"""What is known of a run's conditions, and their words."""
# A recording has whatever conditions its laboratory knows.
_Runs = tuple[Mapping[str, Any], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """The channels that are used, and the recordings that have them."""

    time: Annotated[str | None, Entry("channel of the time; default: that of role time", example="t")] = None
    axes: Annotated[Axes, Entry("of SA, FY and MZ; FZ is the load, positive, in all of them")] = "machine"
    simulated: Annotated[
        bool, Entry("the recordings are simulated as well: every answer says so", example=True)
    ] = False
    channels: Annotated[
        tuple[CaseChannel, ...], Keyed(by="name"),
        Entry("every column that is used", example={
            "t": {"unit": "s", "role": "time"},
            "SA": {"unit": "deg", "role": "input"},
            "FY": {"unit": "N", "role": "output"},
        }),
    ]  # fmt: skip
    run: Annotated[
        _Runs, Size(1),
        Entry(
            "the blocks of cross-validation", example=[{"file": "run01.csv", "rotation": "forward"}],
            expected="[[recording.run]], one or more",
        ),
    ]  # fmt: skip
    predict: Annotated[
        _Runs, Entry("inputs without outputs, to be predicted", example=[{"file": "more.csv"}])
    ] = ()

    @property
    def time_channel(self) -> CaseChannel | None:
        """The channel of the time, None where rows are all that is known."""
        return next(
            (
                channel
                for channel in self.channels
                if channel.role == "time" and self.time in (None, channel.name)
            ),
            None,
        )

    def faults(self) -> Iterator[Fault]:
        """Yield a time that cannot be, nothing to be judged on, and runs without file or condition."""
        timed = [channel for channel in self.channels if channel.role == "time"]
        if self.time is not None and self.time not in [channel.name for channel in timed]:
            yield Fault(
                key=("time",), got=self.time, expected='a channel of that name with role = "time"',
                what="the time channel is not declared",
            )  # fmt: skip
        elif self.time is None and len(timed) > 1:
            names = ", ".join(channel.name for channel in timed)
            yield Fault(
                key=("channels",), got=names, expected="one channel, or its name as recording.time",
                what="more than one channel is the time",
            )  # fmt: skip
        elif self.time_channel is not None and unit(self.time_channel.unit).dimension != "time":
            yield Fault(
                key=("channels", self.time_channel.name), got=self.time_channel.unit, expected="s",
                what="the time is in no unit of time",
            )  # fmt: skip
        if not any(channel.role == "output" for channel in self.channels):
            yield Fault(
                key=("channels",), got="no output", expected='a channel with role = "output"',
                what="a case has nothing to be judged on",
            )  # fmt: skip
        for key, runs in (("run", self.run), ("predict", self.predict)):
            for number, run in enumerate(runs):
                yield from _faults_of_run(run, (key, number))
        if all(run.get("phase") == "tare" for run in self.run):
            yield Fault(
                key=("run",), got='phase = "tare"', expected='a run of phase = "test"',
                what="every recording is a tare",
            )  # fmt: skip


def _faults_of_run(run: Mapping[str, Any], key: tuple[str, int]) -> Iterator[Fault]:
    file = run.get("file")
    if not isinstance(file, str) or not file or "\0" in file:
        yield Fault(key=(*key, "file"), got=file, expected='file = "run01.csv"', what="a run has no file")
    for name, words in CONDITIONS.items():
        if name in run and run[name] not in words:
            near = nearest(str(run[name]), words)
            what = "unknown condition" + (f", did you mean {near!r}?" if near else "")
            yield Fault(key=(*key, name), got=run[name], expected=", ".join(words), what=what)


@dataclass(frozen=True, slots=True, kw_only=True)
class _CaseEntries:
    title: Annotated[
        str | None, Text(empty=True, numbers="any"), Entry("default: the file's name", example="a case")
    ] = None
    recording: Annotated[Recording, Entry("what was measured")]


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseFile(_CaseEntries):
    """A simulation and some recordings; nothing names an effect. Paths are relative to the file."""

    FORMAT: ClassVar[Format] = FORMAT

    simulation: Annotated[
        MachineSimulation | PythonSimulation | OdeSimulation | FmuSimulation | ColumnsSimulation,
        Entry("what is to be judged"),
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelCaseFile(_CaseEntries):
    """A case whose simulation is a model file: an earlier answer, taken up as it was left."""

    FORMAT: ClassVar[Format] = replace(FORMAT, title="case on a model file")

    simulation: Annotated[ModelSimulation, Entry("what is to be judged")]
