"""Read a case file: every key checked, every file that it names read whole, or an error that says what."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from toolkit.channels import AXES, Axes
from toolkit.diagnosis.case.case import ROLES, Case, CaseChannel, Role, Run, Simulation
from toolkit.diagnosis.case.entries import known_unit, none_of, number_of, table_of, wrong
from toolkit.diagnosis.case.model_file import corrections_of
from toolkit.diagnosis.case.recordings import read_run
from toolkit.diagnosis.case.simulation import read_simulation
from toolkit.errors import ConfigError
from toolkit.files import check_keys, parse_toml, read_bytes, read_regular
from toolkit.units import unit

if TYPE_CHECKING:
    from collections.abc import Mapping

_TOP = ("schema", "title", "simulation", "recording")
_RECORDING = ("time", "axes", "channels", "run", "predict")
_CHANNEL = ("unit", "role", "sd")
_CONDITIONS = {
    "rotation": ("forward", "reverse"),
    "mounting": ("normal", "turned"),
    "phase": ("tare", "test"),
}


def read_case(path: Path, *, model: Path | None = None) -> Case:
    """Read a case and all the recordings that it names; ``model`` replaces its simulation.

    Raises
    ------
    ConfigError
        an unknown key, a missing column or unit, a parameter without unit, a file that cannot be read
    """
    data = read_bytes(path)
    table = parse_toml(data, where=path)
    check_keys(table, _TOP, where=path)
    if table.get("schema") != 1:
        raise wrong(
            "a case says which schema it follows", f"{path}: schema", table.get("schema"), "schema = 1"
        )
    declared = table.get("simulation") if model is None else {"model": str(model.absolute())}
    simulation, parameters, taken = read_simulation(declared, path)
    recording = table_of(table.get("recording"), f"{path}: recording")
    check_keys(recording, _RECORDING, where=f"{path}: recording")
    axes = recording.get("axes", "machine")
    if axes not in AXES:
        raise none_of("unknown axis system", f"{path}: recording.axes", axes, AXES)
    channels = _channels(recording.get("channels"), f"{path}: recording.channels")
    time = _time(recording, channels, path)
    digest = hashlib.sha256(data)
    _different_files(_list(recording, "run", path), path)
    runs = [
        _run(
            entry,
            f"{path}: recording.run[{i}]",
            path.parent,
            channels,
            time,
            simulation,
            digest,
            predict=False,
        )
        for i, entry in enumerate(_list(recording, "run", path), start=1)
    ]
    _different_content(runs, [channel.name for channel in channels if channel.role == "output"], path)
    if not runs:
        raise wrong(
            "a case has no recording", f"{path}: recording", "no [[recording.run]]", "one run or more"
        )
    if all(run.conditions.get("phase") == "tare" for run in runs):
        raise wrong(
            "every recording is a tare", f"{path}: recording.run", 'phase = "tare"', 'a run of phase = "test"'
        )
    predict = [
        _run(
            entry,
            f"{path}: recording.predict[{i}]",
            path.parent,
            channels,
            time,
            simulation,
            digest,
            predict=True,
        )
        for i, entry in enumerate(_list(recording, "predict", path), start=1)
    ]
    definition = Path(simulation.machine) if simulation.machine.endswith(".toml") else None
    source = None if taken is None else taken.path
    for one in (simulation.path, simulation.tire, _record_beside(simulation, path), definition, source):
        if one is not None:
            digest.update(_content(one))
    if not any(channel.role == "output" for channel in channels):
        raise wrong(
            "a case has nothing to be judged on",
            f"{path}: recording.channels",
            "no output",
            'a channel with role = "output"',
        )
    return Case(
        path=path,
        title=str(table.get("title", path.stem)),
        simulation=simulation,
        parameters=parameters,
        axes=cast("Axes", axes),
        has_time=time is not None,
        channels=channels,
        runs=tuple(runs),
        predict=tuple(predict),
        sha256=digest.hexdigest(),
        effects=(*(() if taken is None else taken.effects), *corrections_of(simulation)),
        nominal_load_N=None if taken is None else taken.nominal_load_N,
        model=source,
    )


def _channels(entry: object, where: str) -> tuple[CaseChannel, ...]:
    made = []
    for name, one in table_of(entry, where).items():
        table = table_of(one, f"{where}.{name}")
        check_keys(table, _CHANNEL, where=f"{where}.{name}")
        text = table.get("unit")
        if not isinstance(text, str):
            raise wrong("a channel has no unit", f"{where}.{name}.unit", text, 'unit = "N"')
        known_unit(text, f"{where}.{name}.unit")
        role = table.get("role")
        if role not in ROLES:
            raise none_of("a channel has no known role", f"{where}.{name}.role", role, ROLES)
        sd = None if "sd" not in table else number_of(table["sd"], f"{where}.{name}.sd")
        if sd is not None and sd <= 0:
            raise wrong("a channel's noise is not positive", f"{where}.{name}.sd", sd, "a number above zero")
        made.append(CaseChannel(name=name, unit=text, role=cast("Role", role), sd=sd))
    return tuple(made)


def _time(recording: dict[str, Any], channels: tuple[CaseChannel, ...], path: Path) -> CaseChannel | None:
    named = recording.get("time")
    timed = [channel for channel in channels if channel.role == "time"]
    if named is not None:
        timed = [channel for channel in channels if channel.name == named]
        if not timed or timed[0].role != "time":
            raise wrong(
                "the time channel is not declared",
                f"{path}: recording.time",
                named,
                'a channel of that name with role = "time"',
            )
    if len(timed) > 1:
        raise wrong(
            "more than one channel is the time",
            f"{path}: recording.channels",
            ", ".join(one.name for one in timed),
            "one",
        )
    if timed and unit(timed[0].unit).dimension != "time":
        raise wrong(
            "the time is in no unit of time",
            f"{path}: recording.channels.{timed[0].name}",
            timed[0].unit,
            "s",
        )
    return timed[0] if timed else None


def _run(
    entry: object,
    where: str,
    folder: Path,
    channels: tuple[CaseChannel, ...],
    time: CaseChannel | None,
    simulation: Simulation,
    digest: Any,
    *,
    predict: bool,
) -> Run:
    table = table_of(entry, where)
    file = table.get("file")
    if not isinstance(file, str) or not file:
        raise wrong("a run has no file", f"{where}.file", file, 'file = "run01.csv"')
    for key, value in table.items():
        if key in _CONDITIONS and value not in _CONDITIONS[key]:
            raise none_of("unknown condition", f"{where}.{key}", value, _CONDITIONS[key])
    path = folder / file
    data = _content(path)
    digest.update(data)
    return read_run(
        path,
        data,
        name=file,
        channels=channels,
        time=time,
        declared=table,
        simulated=dict(simulation.simulated),
        machine=simulation.machine if simulation.kind == "machine" else "",
        predict=predict,
    )


def _list(table: Mapping[str, Any], key: str, path: Path) -> list[Any]:
    entry = table.get(key, [])
    if not isinstance(entry, list):
        raise wrong(f"{key} is no list of tables", f"{path}: recording.{key}", entry, f"[[recording.{key}]]")
    return entry


def _content(path: Path) -> bytes:
    """Return a file that the case names, whole."""
    try:
        return read_regular(path)
    except (OSError, ValueError) as error:
        raise ConfigError(
            "a file that the case names cannot be read",
            where=path,
            got=getattr(error, "strerror", None) or error,
            expected="a readable regular file; paths are relative to the case file",
            next_step="correct the path in the case",
            rule="no-file",
        ) from error


def _record_beside(simulation: Simulation, path: Path) -> Path | None:
    """Return the calibration's file where the case names one, None for a registry's id."""
    named = path.parent / simulation.calibration
    return named if simulation.calibration and named.is_file() else None


def _different_files(entries: list[Any], path: Path) -> None:
    """Refuse a recording that stands twice: held out as one run, it would be seen as the other."""
    seen: set[Path] = set()
    for i, entry in enumerate(entries, start=1):
        file = entry.get("file") if isinstance(entry, dict) else None
        if not isinstance(file, str):
            continue
        # Links that lead nowhere but in a circle are told where the file is read.
        real = Path(os.path.realpath(path.parent / file))
        if real in seen:
            raise wrong(
                "a recording stands twice",
                f"{path}: recording.run[{i}].file",
                file,
                "another file: a run that is held out must not have been seen",
            )
        seen.add(real)


def _different_content(runs: list[Run], outputs: list[str], path: Path) -> None:
    """Refuse a copy of a recording under another name: no noise repeats itself to the last digit."""
    first: dict[str, str] = {}
    for i, run in enumerate(runs, start=1):
        # An output that stands still may well repeat itself.
        if run.sha256 in first and any(len(set(run.columns.get(output, ()))) > 1 for output in outputs):
            raise wrong(
                "a recording stands twice",
                f"{path}: recording.run[{i}].file",
                f"{run.name}, the same bytes as {first[run.sha256]}",
                "another recording: a run that is held out must not have been seen",
            )
        first.setdefault(run.sha256, run.name)
