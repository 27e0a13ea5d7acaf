"""A case that is put together in the home: recordings, a kind of simulation, its statements as fields.

It is a case's folder from its first moment: ``cases/case-N/`` with case.toml and the files that it names.
What headers and units tell is guessed (`toolkit.lab.starters`); the rest is stated, field by field.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from toolkit.declared import toml_text
from toolkit.declared.declaration import fields_of
from toolkit.declared.describe import summary
from toolkit.declared.kinds import FileKind
from toolkit.declared.tables import FormsKind, TableKind
from toolkit.diagnosis.case.case import Case
from toolkit.diagnosis.case.reader import CONDITIONS, CaseFile
from toolkit.errors import ConfigError, ToolkitError
from toolkit.files import parse_toml, toml_entries, write_atomic
from toolkit.inputs import NAMED_FILE, RECORDING_FILE, SETTINGS_FILE, check_size, read_input
from toolkit.lab.desk.holdings import CASE
from toolkit.lab.desk.statements import Group, statement_groups, with_entry, with_statement, without_entry
from toolkit.lab.desk.uploads import (
    CASES,
    check_inside,
    enter_case,
    leading_out,
    named_files,
    namesakes,
    not_those,
)
from toolkit.lab.starters import guess_case, headers_of
from toolkit.publication import publication
from toolkit.recording.sniff import sniff

TRIAL_S = 10.0
"""Seconds that the simulation may take for one answer while somebody waits."""
CHANNELS, RUNS = "recording.channels", ("recording.run", "recording.predict")

_EXPECTED = f"one recording or more, and files of the simulation; {CASE} is written here"

Files = Sequence[tuple[str, bytes]]


@dataclass(frozen=True, slots=True, kw_only=True)
class BuiltCase:
    """A case as it stands: its text, its entries by table, its files, and what each open table may take.

    ``conditions`` are those of a run that the toolkit knows; a laboratory may state any other.
    """

    text: str
    title: str
    groups: tuple[Group, ...]
    files: tuple[str, ...]
    offers: dict[str, tuple[str, ...]]
    conditions: tuple[str, ...] = tuple(CONDITIONS)


def kinds() -> dict[str, str]:
    """Return the kinds of simulation that a case may have, each with what it is."""
    return {kind: summary(table.cls) for kind, table in _simulations().items()}


def is_open(home: Path, place: str) -> bool:
    """Tell whether a case came from the browser: such a case is changed there, others in their own files."""
    return (home / place).parent == home / CASES


def begin_case(home: Path, kind: str, recordings: Files, own: Files) -> str:
    """Put recordings, and the simulation's own files, into a new case; return its place in the home.

    Raises
    ------
    ConfigError
        ``usage``: no recording, no such kind, or names that are none. Nothing is kept
    RecordingError
        a header cannot be read
    """
    if kind not in kinds():
        raise ConfigError(
            "no such kind of simulation", where="kind", got=kind or "nothing", expected=", ".join(kinds()),
            next_step="choose one; nothing was written", rule="usage",
        )  # fmt: skip
    contents = _sized(named_files([*recordings, *own], _EXPECTED))
    names = [name for name, _ in recordings]
    if not names:
        raise not_those("recordings", contents, _EXPECTED)

    def write(stage: Path) -> None:
        table = guessed_case(stage, names, kind)
        table["simulation"] |= _own_file(kind, [name for name, _ in own])
        (stage / CASE).write_text(toml_text(table), encoding="utf-8")

    return enter_case(home, contents, write)


def add_files(folder: Path, files: Files) -> None:
    """Put more files beside a case; none takes the place of another.

    Raises
    ------
    ConfigError
        ``usage``: no file, or names that are none or taken; nothing is written
    """
    contents = _sized(named_files(files, _EXPECTED))
    occupied = list(namesakes(folder, contents).values())
    if occupied or not contents:
        raise not_those("new files", occupied, "files with names that the case has not yet")
    with publication(folder) as stage:
        for name, data in contents.items():
            (stage / name).write_bytes(data)


def open_case(folder: Path) -> BuiltCase:
    """Return a case as it stands in its folder.

    Raises
    ------
    TrustError
        case.toml cannot be read
    ConfigError
        it is no TOML
    """
    data = read_input(folder / CASE, SETTINGS_FILE)
    parse_toml(data, where=folder / CASE)
    text = data.decode("utf-8-sig").replace("\r\n", "\n")
    files = tuple(sorted(path.name for path in folder.iterdir() if path.is_file() and path.name != CASE))
    groups = tuple(_with_choices(group, files) for group in statement_groups(text, CaseFile))
    title = next((entry.text for group in groups[:1] for entry in group.statements), "")
    stated = {entry.text for group in groups for entry in group.statements}
    offers = dict.fromkeys(RUNS, tuple(name for name in files if name not in stated))
    channels = [group.name for group in groups if group.name.startswith(f"{CHANNELS}.")]
    offers[CHANNELS] = tuple(
        name for name in _columns(folder, groups, files) if f"{CHANNELS}.{name}" not in channels
    )
    return BuiltCase(text=text, title=title, groups=groups, files=files, offers=offers)


def state_entry(folder: Path, name: str, typed: str) -> bool:
    """Keep an entry as it was typed; an empty one is left out. Tell whether the case has other entries now.

    Raises
    ------
    ConfigError
        ``usage``: no such entry, or it leads to a file that is not of the case; nothing is changed
    """
    before = open_case(folder)
    _keep(folder, with_statement(before.text, CaseFile, name, typed))
    return _entries(before) != _entries(open_case(folder))


def add_entry(folder: Path, name: str, key: str) -> None:
    """Add an entry to a table that takes any name: a channel as its column says, a run by its file.

    Raises
    ------
    ConfigError
        ``usage``: no such table, no name or one that is there; nothing is changed
    """
    case = open_case(folder)
    value: Any = {} if name == "simulation.parameters" else ""
    if name == CHANNELS:
        unit = _columns(folder, case.groups, case.files).get(key)
        value = {"unit": unit} if unit else {}
    elif name in RUNS:
        value = {"file": key}
    _keep(folder, with_entry(case.text, CaseFile, name, key.strip(), value))


def drop_entry(folder: Path, name: str) -> None:
    """Leave out a channel, a run or a parameter.

    Raises
    ------
    ConfigError
        ``usage``: no such table; nothing is changed
    """
    _keep(folder, without_entry(open_case(folder).text, CaseFile, name))


def read_whole(folder: Path) -> Case:
    """Return the case, read whole, of whose files none lies elsewhere.

    Raises
    ------
    ConfigError
        what is missing or cannot be used, all at once
    """
    from toolkit.diagnosis.case.reader import read_case

    case = read_case(folder / CASE)
    check_inside(case, folder, frozenset(open_case(folder).files))
    return case


def trial_of(folder: Path, home: Path) -> dict[str, Any]:
    """Return what the simulation says as it is declared, beside the recordings; its code runs isolated.

    Raises
    ------
    ToolkitError
        the case cannot be read, or its simulation not run within `TRIAL_S`
    """
    from toolkit.diagnosis.by_hand import as_declared
    from toolkit.lab.desk.sized_model import shown_trial
    from toolkit.lab.studies.diagnosis import machine_registry, worker_limits

    case = read_whole(folder)
    registry = machine_registry(case.simulation.kind, None, home)
    return shown_trial(as_declared(case, registry, budget_s=TRIAL_S, limits=worker_limits(isolated=True)))


def _keep(folder: Path, text: str) -> None:
    """Keep a text in which nothing leads to a file that is not of the case."""
    files = open_case(folder).files
    if outside := leading_out(toml_entries(text), folder, files):
        raise not_those("of this case", outside, ", ".join(files))
    write_atomic(folder / CASE, text)


def _entries(case: BuiltCase) -> list[str]:
    return [entry.name for group in case.groups for entry in group.statements]


def _sized(contents: dict[str, bytes]) -> dict[str, bytes]:
    if CASE in contents:
        raise not_those("recordings", contents, _EXPECTED)
    for name, data in contents.items():
        check_size(data, NAMED_FILE, name)
    return contents


def _simulations() -> dict[str, TableKind]:
    """Return the declared simulations by kind."""
    (kind,) = (field.kind for field in fields_of(CaseFile) if isinstance(field.kind, FormsKind))
    return kind.tables


def _own_file(kind: str, names: Sequence[str]) -> dict[str, str]:
    """Return the one file of a simulation under the one entry that holds a file."""
    keys = [field.key for field in _simulations()[kind].fields if isinstance(field.kind, FileKind)]
    return {keys[0]: names[0]} if len(keys) == len(names) == 1 else {}


def _columns(case_folder: Path, groups: Sequence[Group], files: Sequence[str]) -> dict[str, str | None]:
    """Return the columns of the recordings that a case names; who reads it whole tells of a bad one."""
    columns: dict[str, str | None] = {}
    for group in groups:
        for entry in group.statements:
            if group.name.startswith(RUNS) and entry.key == "file" and entry.text in files:
                with contextlib.suppress(ToolkitError):
                    columns = columns_of(case_folder, [entry.text]) | columns
    return columns


def _with_choices(group: Group, files: tuple[str, ...]) -> Group:
    """Return a table in which what names a file, or a condition that is known, is a choice."""
    return replace(
        group,
        statements=tuple(
            replace(entry, choices=files)
            if entry.form == "file" or entry.key == "file"
            else replace(entry, choices=CONDITIONS.get(entry.key, entry.choices))
            for entry in group.statements
        ),
    )


_ROLES = {
    "time": "time", "load": "input", "slip_angle": "input", "indication": "output",
    "covariate": "covariate", "angle": "covariate",
}  # fmt: skip
"""What a column of a machine's recordings is to its simulation; what the rig computed is none of it."""
_MEASUREMENTS = ("tdms", "mdf", "mat", "hdf5", "lvm")
"""Kinds of files that name their channels otherwise than by a first row."""


def guessed_case(folder: Path, names: Sequence[str], kind: str) -> dict[str, Any]:
    """Return the entries of a case of some recordings, as far as their headers tell."""
    columns = columns_of(folder, names)
    guess = guess_case(names[0], [(name, name, unit) for name, unit in columns.items()]).values
    simulation: dict[str, Any] = {"kind": kind}
    if guess.get("simulation", {}).get("kind") == kind:
        simulation = guess["simulation"]
    channels = guess["recording"].get("channels", {})
    if kind == "machine":
        channels = _with_own_channels(channels, columns)
    recording = {"channels": channels, "run": [{"file": name} for name in names]}
    return {"schema": 1, "title": Path(names[0]).stem, "simulation": simulation, "recording": recording}


def _with_own_channels(
    channels: Mapping[str, dict[str, str]], columns: Mapping[str, str | None]
) -> dict[str, dict[str, str]]:
    """Return channels with those of the standard machine's own recordings, by symbol, in their places."""
    from toolkit.machine import load_machine
    from toolkit.machine.default import DEFAULT_MACHINE

    own = load_machine(DEFAULT_MACHINE).columns
    names = {name for column in own for name in (column.header, column.symbol)}
    return {name: entries for name, entries in channels.items() if name not in names} | {
        column.symbol: {
            "unit": columns.get(column.symbol) or columns.get(column.header) or column.unit,
            "role": _ROLES[column.role],
        }
        for column in own
        if column.role in _ROLES and (column.header in columns or column.symbol in columns)
    }


def columns_of(folder: Path, names: Iterable[str]) -> dict[str, str | None]:
    """Return the columns of recordings with their units; None where a header states none.

    Raises
    ------
    RecordingError
        a header cannot be read
    """
    columns: dict[str, str | None] = {}
    for name in names:
        with contextlib.suppress(OSError):
            state = (folder / name).stat()
            for column, unit in _header(folder / name, state.st_mtime_ns, state.st_size):
                columns[column] = columns.get(column) or unit
    return columns


@lru_cache(maxsize=256)
def _header(path: Path, _changed: int, _size: int) -> tuple[tuple[str, str | None], ...]:
    from toolkit.recording.columns import rig
    from toolkit.recording.read import read_recording

    data = read_input(path, RECORDING_FILE)
    if sniff(data).id in _MEASUREMENTS:
        series = read_recording(path, rig("the case", {}), data=data).series
        return tuple((column.symbol, column.unit) for column in series)
    return tuple((plain, unit) for _, plain, unit in headers_of(path))
