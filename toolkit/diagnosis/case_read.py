"""Read a case file: every key checked, every file that it names read whole, or an error that says what."""

from __future__ import annotations

import difflib
import hashlib
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from toolkit.channels import AXES, Axes
from toolkit.diagnosis.case import KINDS, ROLES, Case, CaseChannel, CaseParameter, Role, Run, Simulation
from toolkit.diagnosis.recordings import read_run
from toolkit.errors import ConfigError, UnitError
from toolkit.files import check_keys, parse_toml, read_bytes, read_regular
from toolkit.units import unit

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

_TOP = ("schema", "title", "simulation", "recording")
_KEYS = {
    "machine": ("kind", "machine", "calibration", "tire", "parameters"),
    "python": ("kind", "path", "function", "parameters"),
    "ode": ("kind", "path", "states", "force_terms", "parameters"),
    "columns": ("kind", "simulated", "parameters"),
}
_PARAMETER = ("value", "unit", "sd", "bounds")
_RECORDING = ("time", "axes", "channels", "run", "predict")
_CHANNEL = ("unit", "role", "sd")
_CONDITIONS = {
    "rotation": ("forward", "reverse"),
    "mounting": ("normal", "turned"),
    "phase": ("tare", "test"),
}


def read_case(path: Path) -> Case:
    """Read a case and all the recordings that it names.

    Raises
    ------
    ConfigError
        an unknown key, a missing column or unit, a parameter without unit, a file that cannot be read
    """
    data = read_bytes(path)
    table = parse_toml(data, where=path)
    check_keys(table, _TOP, where=path)
    if table.get("schema") != 1:
        raise _wrong(
            "a case says which schema it follows", f"{path}: schema", table.get("schema"), "schema = 1"
        )
    simulation, parameters = _simulation(table.get("simulation"), path)
    recording = _table(table.get("recording"), f"{path}: recording")
    check_keys(recording, _RECORDING, where=f"{path}: recording")
    axes = recording.get("axes", "machine")
    if axes not in AXES:
        raise _one_of("unknown axis system", f"{path}: recording.axes", axes, AXES)
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
    if not runs:
        raise _wrong(
            "a case has no recording", f"{path}: recording", "no [[recording.run]]", "one run or more"
        )
    if all(one.conditions.get("phase") == "tare" for one in runs):
        raise _wrong(
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
    for one in (simulation.path, simulation.tire, _record_beside(simulation, path)):
        if one is not None:
            digest.update(_content(one))
    if not any(one.role == "output" for one in channels):
        raise _wrong(
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
    )


def _simulation(entry: object, path: Path) -> tuple[Simulation, tuple[CaseParameter, ...]]:
    where = f"{path}: simulation"
    table = _table(entry, where)
    kind = table.get("kind")
    if kind not in KINDS:
        raise _one_of("unknown kind of simulation", f"{where}.kind", kind, KINDS)
    check_keys(table, _KEYS[kind], where=where)
    parameters = tuple(
        _parameter(name, one, f"{where}.parameters.{name}")
        for name, one in _table(table.get("parameters", {}), f"{where}.parameters").items()
    )
    return Simulation(
        kind=kind,
        machine=_text(table.get("machine", "m15"), f"{where}.machine"),
        calibration=_text(table.get("calibration", ""), f"{where}.calibration"),
        tire=_file(table, "tire", path, where) if kind == "machine" and "tire" in table else None,
        path=_file(table, "path", path, where) if kind in ("python", "ode") else None,
        function=_text(table.get("function", "simulate"), f"{where}.function"),
        states=_names(table.get("states", []), f"{where}.states"),
        force_terms=_units(table.get("force_terms", {}), f"{where}.force_terms"),
        simulated=_pairs(table, where) if kind == "columns" else (),
    ), parameters


def _parameter(name: str, entry: object, where: str) -> CaseParameter:
    table = _table(entry, where)
    check_keys(table, _PARAMETER, where=where)
    text = table.get("unit")
    if not isinstance(text, str):
        raise _wrong("a parameter has no unit", f"{where}.unit", text, 'unit = "kg" (or "1" for a number)')
    _known_unit(text, f"{where}.unit")
    value = _number(table.get("value"), f"{where}.value")
    sd = None if "sd" not in table else _number(table["sd"], f"{where}.sd")
    if sd is not None and sd <= 0:
        raise _wrong(
            "a prior has no width", f"{where}.sd", sd, "a number above zero, or no sd where known exactly"
        )
    bounds = None
    if "bounds" in table:
        given = table["bounds"]
        if not isinstance(given, list) or len(given) != 2:
            raise _wrong("bounds are two numbers", f"{where}.bounds", given, "bounds = [low, high]")
        bounds = (_number(given[0], f"{where}.bounds"), _number(given[1], f"{where}.bounds"))
        if not bounds[0] <= value <= bounds[1] or bounds[0] >= bounds[1]:
            raise _wrong(
                "the value lies outside its bounds", f"{where}.bounds", given, f"bounds around {value:g}"
            )
    return CaseParameter(name=name, value=value, unit=text, sd=sd, bounds=bounds)


def _channels(entry: object, where: str) -> tuple[CaseChannel, ...]:
    made = []
    for name, one in _table(entry, where).items():
        table = _table(one, f"{where}.{name}")
        check_keys(table, _CHANNEL, where=f"{where}.{name}")
        text = table.get("unit")
        if not isinstance(text, str):
            raise _wrong("a channel has no unit", f"{where}.{name}.unit", text, 'unit = "N"')
        _known_unit(text, f"{where}.{name}.unit")
        role = table.get("role")
        if role not in ROLES:
            raise _one_of("a channel has no known role", f"{where}.{name}.role", role, ROLES)
        sd = None if "sd" not in table else _number(table["sd"], f"{where}.{name}.sd")
        if sd is not None and sd <= 0:
            raise _wrong("a channel's noise is not positive", f"{where}.{name}.sd", sd, "a number above zero")
        made.append(CaseChannel(name=name, unit=text, role=cast("Role", role), sd=sd))
    return tuple(made)


def _time(recording: dict[str, Any], channels: tuple[CaseChannel, ...], path: Path) -> CaseChannel | None:
    named = recording.get("time")
    timed = [one for one in channels if one.role == "time"]
    if named is not None:
        timed = [one for one in channels if one.name == named]
        if not timed or timed[0].role != "time":
            raise _wrong(
                "the time channel is not declared",
                f"{path}: recording.time",
                named,
                'a channel of that name with role = "time"',
            )
    if len(timed) > 1:
        raise _wrong(
            "more than one channel is the time",
            f"{path}: recording.channels",
            ", ".join(one.name for one in timed),
            "one",
        )
    if timed and unit(timed[0].unit).dimension != "time":
        raise _wrong(
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
    table = _table(entry, where)
    file = table.get("file")
    if not isinstance(file, str) or not file:
        raise _wrong("a run has no file", f"{where}.file", file, 'file = "run01.csv"')
    for key, value in table.items():
        if key in _CONDITIONS and value not in _CONDITIONS[key]:
            raise _one_of("unknown condition", f"{where}.{key}", value, _CONDITIONS[key])
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


def _pairs(table: Mapping[str, Any], where: str) -> tuple[tuple[str, str], ...]:
    made = _table(table.get("simulated"), f"{where}.simulated")
    if not made:
        raise _wrong("no simulated columns", f"{where}.simulated", made, 'simulated = { FY = "FY_sim" }')
    return tuple((name, _text(column, f"{where}.simulated.{name}")) for name, column in made.items())


def _units(entry: object, where: str) -> tuple[tuple[str, str], ...]:
    made = tuple((name, _text(one, f"{where}.{name}")) for name, one in _table(entry, where).items())
    for name, text in made:
        _known_unit(text, f"{where}.{name}")
    return made


def _names(entry: object, where: str) -> tuple[str, ...]:
    if not isinstance(entry, list) or not all(isinstance(one, str) and one for one in entry):
        raise _wrong("names are a list of texts", where, entry, '["x", "v"]')
    if len(set(entry)) != len(entry):
        raise _wrong("a name stands twice", where, entry, "different names")
    return tuple(entry)


def _file(table: Mapping[str, Any], key: str, path: Path, where: str) -> Path:
    name = table.get(key)
    if not isinstance(name, str) or not name:
        raise _wrong(f"the simulation has no {key}", f"{where}.{key}", name, f'{key} = "FILE"')
    return path.parent / name


def _list(table: Mapping[str, Any], key: str, path: Path) -> list[Any]:
    entry = table.get(key, [])
    if not isinstance(entry, list):
        raise _wrong(f"{key} is no list of tables", f"{path}: recording.{key}", entry, f"[[recording.{key}]]")
    return entry


def _table(entry: object, where: str) -> dict[str, Any]:
    if not isinstance(entry, dict):
        raise _wrong("a table is missing", where, entry, "a TOML table")
    return entry


def _text(entry: object, where: str) -> str:
    if not isinstance(entry, str):
        raise _wrong("an entry is no text", where, entry, "text in quotes")
    return entry


def _number(entry: object, where: str) -> float:
    if isinstance(entry, bool) or not isinstance(entry, int | float) or not math.isfinite(entry):
        raise _wrong("an entry is no number", where, entry, "a finite number")
    return float(np.float64(entry))


def _known_unit(text: str, where: str) -> None:
    """Refuse a unit that nobody knows, and name its place in the case."""
    try:
        unit(text)
    except UnitError as error:
        raise _wrong("a unit is unknown", where, text, str(error.expected)) from error


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
        real = (path.parent / file).resolve()
        if real in seen:
            raise _wrong(
                "a recording stands twice",
                f"{path}: recording.run[{i}].file",
                file,
                "another file: a run that is held out must not have been seen",
            )
        seen.add(real)


def _one_of(what: str, where: str, got: object, known: Sequence[str]) -> ConfigError:
    """Return the error of a word that is none of those known, with the nearest one."""
    lowered = {one.lower(): one for one in known}
    near = difflib.get_close_matches(str(got).lower(), list(lowered), n=1, cutoff=0.5)
    made = _wrong(what, where, got, ", ".join(known))
    if near:
        made.next_step = f"did you mean {lowered[near[0]]!r}?"
    return made


def _wrong(what: str, where: str, got: object, expected: str) -> ConfigError:
    return ConfigError(
        what,
        where=where,
        got="nothing" if got is None else got,
        expected=expected,
        next_step="correct the case file; diagnosis.md and `toolkit diagnose --help` show one",
        rule="case",
    )
