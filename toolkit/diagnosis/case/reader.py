"""Read a case file: every key checked, every file that it names read whole, or an error that says what.

CASE.toml is declared here, once: a simulation, the channels, and the recordings with their conditions.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar

from toolkit.channels import Axes
from toolkit.declared import (
    Above,
    Entry,
    Fault,
    Format,
    Keyed,
    Size,
    Source,
    Text,
    Unit,
    build,
    nearest,
    refuse,
)
from toolkit.diagnosis.case.case import Case, CaseChannel, Run, Simulation
from toolkit.diagnosis.case.recordings import read_run
from toolkit.diagnosis.case.repeats import is_copy, repeated_runs
from toolkit.diagnosis.case.simulation import (
    FORMAT,
    ColumnsSimulation,
    FmuSimulation,
    MachineSimulation,
    ModelSimulation,
    OdeSimulation,
    PythonSimulation,
    corrections_of,
)
from toolkit.files import parse_toml, real_path
from toolkit.inputs import NAMED_FILE, SETTINGS_FILE, is_regular, read_input
from toolkit.publication import settle
from toolkit.units import unit


def read_case(path: Path, *, model: Path | None = None) -> Case:
    """Read a case and all the recordings that it names; ``model`` replaces its simulation.

    Raises
    ------
    ConfigError
        an unknown key, a missing column or unit, a parameter without unit, a file that cannot be read
    """
    settle(path.parent)
    data = read_input(path, SETTINGS_FILE)
    source = Source(where=path, text=data.decode("utf-8-sig", errors="replace"))
    table = parse_toml(data, where=path)
    if model is not None:
        table["simulation"] = {"model": str(model.absolute())}
    entries = table.get("simulation")
    taken_up = isinstance(entries, dict) and "model" in entries
    stated = build(ModelCaseFile, table, source) if taken_up else build(CaseFile, table, source)
    simulation, parameters, model_file = stated.simulation.resolve(path)
    if stated.simulation.kind not in (None, simulation.kind):
        key, what = ("simulation", "kind"), "the model is of another kind"
        got = stated.simulation.kind
        refuse([Fault(key=key, got=got, expected=simulation.kind, what=what, form=FORMAT)], source)
    recording, time = stated.recording, stated.recording.time_channel
    digest = hashlib.sha256(data)
    _different_files(recording, path, source)
    runs, predict = (
        tuple(
            _run(run, path.parent, recording.channels, time, simulation, digest, predict=outputs_absent)
            for run in entries
        )
        for entries, outputs_absent in ((recording.run, False), (recording.predict, True))
    )
    _different_content(runs, recording, source)
    definition = Path(simulation.machine) if simulation.machine.endswith(".toml") else None
    model_path = None if model_file is None else model_file.path
    for file in (simulation.path, simulation.tire, _record_beside(simulation, path), definition, model_path):
        if file is not None:
            digest.update(read_input(file, NAMED_FILE))
    return Case(
        path=path,
        title=path.stem if stated.title is None else stated.title,
        simulation=simulation,
        parameters=parameters,
        axes=recording.axes,
        has_time=time is not None,
        channels=recording.channels,
        runs=runs,
        predict=predict,
        sha256=digest.hexdigest(),
        effects=(*(() if model_file is None else model_file.effects), *corrections_of(simulation)),
        nominal_load_N=None if model_file is None else model_file.nominal_load_N,
        model=model_path,
        simulated=recording.simulated,
        sample_rate_Hz=recording.sample_rate_Hz,
        longest_run_s=recording.longest_run_s,
    )


def _run(
    declared: Mapping[str, Any],
    folder: Path,
    channels: tuple[CaseChannel, ...],
    time: CaseChannel | None,
    simulation: Simulation,
    digest: Any,
    *,
    predict: bool,
) -> Run:
    path = folder / declared["file"]
    data = read_input(path, NAMED_FILE)
    digest.update(data)
    return read_run(
        path,
        data,
        name=declared["file"],
        channels=channels,
        time=time,
        declared=declared,
        simulated=dict(simulation.simulated),
        machine=simulation.machine if simulation.kind == "machine" else "",
        predict=predict,
    )


def _record_beside(simulation: Simulation, path: Path) -> Path | None:
    """Return the calibration's file where the case names one, None for a registry's id."""
    record_file = path.parent / simulation.calibration
    return record_file if simulation.calibration and is_regular(record_file) else None


def _different_files(recording: Recording, path: Path, source: Source) -> None:
    """Refuse a recording that stands twice: held out as one run, it would be seen as the other."""
    files: set[Path] = set()
    for number, run in enumerate(recording.run):
        # Links that lead nowhere but in a circle are told where the file is read.
        file = real_path(path.parent / run["file"])
        if file in files:
            _refuse_twice(number, run["file"], "another file", source)
        files.add(file)


def _different_content(runs: tuple[Run, ...], recording: Recording, source: Source) -> None:
    """Refuse a copy of a recording under another name."""
    for number, earlier in repeated_runs(runs).items():
        if is_copy(runs[number], runs, recording.channels):
            statement = f"{runs[number].name}, the same bytes as {earlier}"
            _refuse_twice(number, statement, "another recording", source)


def _refuse_twice(number: int, file: str, earlier: str, source: Source) -> None:
    fault = Fault(
        key=("recording", "run", number, "file"), got=file, what="a recording stands twice",
        expected=f"{earlier}: a run that is held out must not have been seen", form=FORMAT,
    )  # fmt: skip
    refuse([fault], source)


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
    sample_rate_Hz: Annotated[
        float | None, Unit("Hz"), Above(0),
        Entry("highest that can be recorded: plans may ask for rows as dense", key="sample_rate",
              example={"value": 200, "unit": "Hz"}),
    ] = None  # fmt: skip
    longest_run_s: Annotated[
        float | None, Unit("s"), Above(0),
        Entry("longest that a run may take: plans may ask for one as long", key="longest_run",
              example={"value": 10, "unit": "min"}),
    ] = None  # fmt: skip
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
