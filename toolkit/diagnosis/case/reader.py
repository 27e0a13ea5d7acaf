"""Read a case file: every key checked, every file that it names read whole, or an error that says what."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolkit.declared import Fault, Source, build, refuse
from toolkit.diagnosis.case.case import Case, CaseChannel, Run, Simulation
from toolkit.diagnosis.case.case_file import CaseFile, ModelCaseFile, Recording
from toolkit.diagnosis.case.model_file import corrections_of
from toolkit.diagnosis.case.recordings import read_run
from toolkit.diagnosis.case.simulation import FORMAT
from toolkit.files import parse_toml, real_path
from toolkit.inputs import NAMED_FILE, SETTINGS_FILE, is_regular, read_input
from toolkit.publication import settle

if TYPE_CHECKING:
    from collections.abc import Mapping


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
    named = path.parent / simulation.calibration
    return named if simulation.calibration and is_regular(named) else None


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
    """Refuse a copy of a recording under another name: no noise repeats itself to the last digit."""
    outputs = [channel.name for channel in recording.channels if channel.role == "output"]
    first: dict[str, str] = {}
    for number, run in enumerate(runs):
        # An output that stands still may well repeat itself.
        if run.sha256 in first and any(len(set(run.columns.get(output, ()))) > 1 for output in outputs):
            same = f"{run.name}, the same bytes as {first[run.sha256]}"
            _refuse_twice(number, same, "another recording", source)
        first.setdefault(run.sha256, run.name)


def _refuse_twice(number: int, file: str, other: str, source: Source) -> None:
    fault = Fault(
        key=("recording", "run", number, "file"), got=file, what="a recording stands twice",
        expected=f"{other}: a run that is held out must not have been seen", form=FORMAT,
    )  # fmt: skip
    refuse([fault], source)
