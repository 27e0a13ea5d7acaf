"""New settings files: what `toolkit session|machine|test|case|plan new` write, ask, guess and leave open.

A guess rests on a recording's headers and units alone and is named as one, in the file and in the answer.
What no header can tell is left open; nothing is made up.
"""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

from toolkit.calibration.session.read import demand_inside
from toolkit.channels import CHANNELS, channel_of
from toolkit.declared import Source, refuse
from toolkit.declared.describe import asked_of, outline
from toolkit.declared.text import attempt, value_text
from toolkit.errors import ConfigError, OutputError, RecordingError, ToolkitError, UnitError
from toolkit.files import toml_entries
from toolkit.inputs import RECORDING_FILE, read_input
from toolkit.printable import check_entries
from toolkit.units import is_unit, split_header

FORMS = {
    "session": "toolkit.calibration.session.session_file:SessionFile",
    "machine": "toolkit.machine.definition:Machine",
    "test": "toolkit.recording.folder:StatedTest",
    "case": "toolkit.diagnosis.case.reader:CaseFile",
    "plan": "toolkit.simulation.plan_file:PlanFile",
}
"""Word of the command -> the class that declares its file."""

_BOOKKEEPING = ("run", "direction", "rotation", "comment")
_CASE_ROLES = {"t": "time", "T": "covariate"} | dict.fromkeys(("FX", "FY", "MX", "MY", "MZ"), "output")
"""What a channel is to a simulation; the others are inputs."""
_READ_FROM_CELLS = ("bridge_ratio", "voltage", "count")
_OF_SEVERAL_ROLES = ("force", "moment", "angle", "time", "ratio")


Column = tuple[str, str, str | None]
"""Header, name, unit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Guess:
    """What headers say: ``values`` as a file holds them, ``notes`` by entry, texts on what is ``silent``.

    ``lacking`` says by entry what the file itself must still be given.
    """

    values: dict[str, Any] = field(default_factory=dict)
    notes: dict[str, str] = field(default_factory=dict)
    silent: tuple[str, ...] = ()
    lacking: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Starter:
    """A new file: its text, what was guessed, and what each entry is that a person must still state."""

    text: str
    guess: Guess
    helps: dict[str, str]

    @property
    def open(self) -> tuple[str, ...]:
        """The entries that must still be stated."""
        return tuple(self.helps)


def form_of(word: str) -> type:
    """Return the class that declares a file."""
    module, _, name = FORMS[word].partition(":")
    declared: type = getattr(import_module(module), name)
    return declared


def entries_of(words: Sequence[str]) -> dict[str, Any]:
    """Return entries from ``KEY=VALUE``: a value of TOML, else a text; a key with dots is one of a table.

    >>> entries_of(["instrument=press-7", "date=2026-02-03", "reference.standard=dead weights"])
    {'instrument': 'press-7', 'date': datetime.date(2026, 2, 3), 'reference': {'standard': 'dead weights'}}

    Raises
    ------
    ConfigError
        ``usage``: no ``=``, or a key that is a value and a table
    """
    entries: dict[str, Any] = {}
    for word in words:
        key, sign, text = word.partition("=")
        *tables, name = key.strip().split(".")
        table = entries
        for part in tables:
            table = table.setdefault(part, {}) if isinstance(table, dict) else {}
        if not (sign and name) or not isinstance(table, dict):
            raise ConfigError(
                "an entry cannot be read", where="--set", got=word, expected="KEY=VALUE", rule="usage",
                next_step="write the entry's name, =, and its value; nothing was written",
            )  # fmt: skip
        table[name] = _value(text.strip())
    return entries


def _value(text: str) -> Any:
    try:
        return toml_entries(f"value = {text}")["value"]
    except (tomllib.TOMLDecodeError, KeyError):
        return text


def start(word: str, entries: Mapping[str, Any], recording: Path | None, *, file: Path) -> Starter:
    """Return what a new ``file`` of a format begins with.

    Raises
    ------
    ConfigError
        every entry that is unknown or cannot be used; ``usage``: nothing can be guessed for this format
    SessionError
        ``outside``: a session's data lie where `toolkit calibrate` does not read them
    RecordingError
        the recording cannot be read
    """
    check_entries(entries, where=file)
    guess = Guess() if recording is None else guess_from(word, recording, file.parent)
    guess = replace(guess, values={key: guess.values[key] for key in guess.values if key not in entries})
    values, cls = {**guess.values, **entries}, form_of(word)
    # What is given is judged as it was given: an unknown entry has no place in the file.
    text = outline(cls, {})
    stated = {key: entry for key, entry in toml_entries(text).items() if key == "schema"} | values
    # What a guess cannot tell is still to be stated, and is no error of anybody's.
    refuse(
        [
            fault
            for fault in attempt(cls, stated)[1]
            if fault.kind != "missing" and _top(fault.name) not in guess.values
        ],
        Source(where=file),
    )
    if word == "session":
        reference = values.get("reference")
        named = {**values, "reference.dcc": reference.get("dcc") if isinstance(reference, dict) else None}
        for key in ("data", "check", "reference.dcc"):
            if isinstance(name := named.get(key), str):
                demand_inside(file, name, key)
    text = outline(cls, values, {key: note for key, note in guess.notes.items() if key not in entries})
    _, faults = attempt(cls, toml_entries(text))
    helps = {fault.name: fault.expected for fault in faults} | asked_of(cls, values)
    return Starter(text=text, guess=guess, helps=helps)


def _top(name: str) -> str:
    return re.split(r"[.\[]", name, maxsplit=1)[0]


def starter_text(word: str, file: Path, starter: Starter) -> str:
    """Return what the command says to people."""
    guess = starter.guess
    lines = [f"{file}: a new {word} file"]
    lines += [f"  guessed      {key} = {value_text(value)}" for key, value in guess.values.items()]
    lines += [f"  not guessed  {text}" for text in guess.silent]
    lines += [f"  to fill in   {name}: {text}" for name, text in starter.helps.items()]
    lines += [f"  to add       {text}" for text in guess.lacking.values()]
    return "\n".join(lines if starter.open or guess.lacking else [*lines, "  nothing must be filled in"])


def refuse_existing(path: Path) -> None:
    """Refuse a name that is taken, or is no settings file's.

    Raises
    ------
    OutputError
        ``not-writable``
    """
    if path.exists() or path.suffix.lower() != ".toml":
        raise OutputError(
            "a new file never replaces another one" if path.exists() else "a settings file is a .toml file",
            where=path, got="a file that exists" if path.exists() else path.name,
            expected="a new name that ends with .toml", next_step="choose another name; nothing was written",
            rule="not-writable",
        )  # fmt: skip


def guess_from(word: str, recording: Path, folder: Path) -> Guess:
    """Return what a recording's columns and units say of a session, machine or case, to stand in a folder.

    Raises
    ------
    ConfigError
        ``usage``: a file of this format says nothing of columns
    """
    guesses = {"session": _session, "machine": _machine}
    if word not in guesses and word != "case":
        raise ConfigError(
            f"a recording says nothing of a {word}", where="--from", got=recording,
            expected="--from beside 'session new', 'machine new' or 'case new'",
            next_step="leave --from away", rule="usage",
        )  # fmt: skip
    name = os.path.relpath(recording.absolute(), folder.absolute())
    columns, texts = _columns(recording)
    if word == "case":
        return _case(Path(name).as_posix(), columns, texts)
    return guesses[word](Path(name).as_posix(), columns)


def headers_of(recording: Path) -> list[Column]:
    """Return the columns of a recording: header, name, unit; None for a unit that is not stated.

    Raises
    ------
    RecordingError
        the file cannot be read, or has no header
    """
    return _columns(recording)[0]


def _columns(recording: Path) -> tuple[list[Column], set[str]]:
    """Return the columns of a recording, and the names of those that hold texts."""
    from toolkit.calibration.session.cells import read_cells

    def is_name(text: str, whole: str = "") -> bool:
        return text != whole and bool(re.match(r"\s*[^\W\d]", text))

    cells = read_cells(read_input(recording, RECORDING_FILE), is_name, where=recording, grouped=True)
    if not any(map(is_name, cells.header)):
        raise RecordingError(
            "the file has no header", where=recording, got=f"a first row {', '.join(cells.header[:3])}, ...",
            expected="a header that names each column with its unit, such as 'C1 [mV/V]', above the rows",
            next_step="write the header, or leave --from away", rule="no-header",
        )  # fmt: skip
    columns, texts = list[Column](), set[str]()
    for header, column in zip(map(str.strip, cells.header), cells.columns, strict=True):
        if not header:
            continue
        # Any text may be a name here, and a unit is what is known as one.
        name, unit = split_header(header, partial(is_name, whole=header))
        known = unit is not None and is_unit(unit)
        columns.append((header, name if known else header, unit if known else None))
        if not _is_number(next((cell for cell in column if str(cell or "").strip()), 0.0)):
            texts.add(columns[-1][1])
    return columns, texts


def _is_number(cell: Any) -> bool:
    try:
        float(cell.strip().replace(",", ".") if isinstance(cell, str) else cell)
    except (TypeError, ValueError):
        return False
    return True


def _dimension(unit: str | None) -> str | None:
    from toolkit.units import unit as read_unit

    try:
        return None if unit is None else read_unit(unit).dimension
    except (UnitError, ToolkitError):
        return None


def _session(name: str, columns: Sequence[Column]) -> Guess:
    stated = [(plain, _dimension(unit)) for _, plain, unit in columns if plain.lower() not in _BOOKKEEPING]
    loads = [plain for plain, dimension in stated if dimension in ("force", "moment")]
    indications = [plain for plain, dimension in stated if dimension not in (None, "force", "moment", "time")]
    silent = [f"{plain}: no unit that is known; write 'NAME [unit]'" for plain, kind in stated if not kind]
    headers = {plain.lower() for _, plain, _ in columns}
    absent = [key for key in ("run", "direction") if key not in headers]
    needs = [f"{name} needs the column {' and the column '.join(absent)}"] if absent else []
    if unread := [
        plain for plain, _ in stated if loads and indications and plain not in (*loads, *indications)
    ]:
        needs.append(
            f"{name} may not have {', '.join(unread)}: a session's table has no columns of other use"
        )
    lacking = {"data": "; ".join(needs)} if needs else {}
    if loads and not indications:  # cells that are read in units of force: which is which, no unit tells
        silent.append("every column is a force or a moment: which are indications, the file does not tell")
        loads = []
    values: dict[str, Any] = {"data": name}
    values |= {key: names for key, names in (("indications", indications), ("loads", loads)) if names}
    basis = f"guessed from {name}: columns with a unit of "
    notes = {"loads": f"{basis}force or moment", "indications": f"{basis}another kind"}
    notes = {key: note for key, note in notes.items() if key in values}
    return Guess(values=values, notes=notes, silent=tuple(silent), lacking=lacking)


def _machine(name: str, columns: Sequence[Column]) -> Guess:
    entries, silent = [], []
    for header, plain, unit in columns:
        dimension = _dimension(unit)
        symbol = _symbol(plain)
        role = _role(symbol, dimension)
        if dimension is None:
            silent.append(f"{header}: no unit that is known")
            continue
        # As the reader of recordings will see it: what stands in square brackets is a unit to it.
        entry = {"symbol": symbol, "header": split_header(header)[0], "unit": unit}
        if role is None:
            silent.append(f"{header}: what it holds; state its role")
        entries.append(entry if role is None else entry | {"role": role})
    stated = {entry.get("role") for entry in entries}
    silent += [
        f'no column is known as {what}: name it {symbol}, or state role = "{role}" for it'
        for role, symbol, what in (("load", "FZ", "the load"), ("slip_angle", "SA", "the slip angle"))
        if entries and role not in stated
    ]
    if entries and "indication" not in stated:
        silent.append(
            "indications: no column is a signal of a cell, and no calibration record computes the forces; "
            "'toolkit fit FILE --machine' takes them as they are"
        )
    silent += [
        "axes, rotations, drum and protocol: no header tells them",
        "drum.circumference: without it the road counts as flat, a belt's or a trailer's",
    ]
    note = f"guessed from {name}: FZ is the load, other forces and moments are computed by the rig"
    values = {"column": entries} if entries else {}
    return Guess(values=values, notes={"column": note} if entries else {}, silent=tuple(silent))


def guess_case(name: str, columns: Sequence[Column]) -> Guess:
    """Return what the columns of a recording, as `headers_of` gives them, say of a case."""
    units = {plain: unit for _, plain, unit in columns}
    roles = {plain: _CASE_ROLES.get(found.symbol, "input") for plain in units if (found := channel_of(plain))}
    units |= {plain: "s" for plain, role in roles.items() if role == "time" and units[plain] is None}
    channels = {plain: _channel(units[plain], role) for plain, role in roles.items()}
    # Another program's output stands beside the recorded one, under a name that begins as its own.
    others = {
        plain: [other for other in units.keys() - roles.keys() if other.startswith(plain)]
        for plain, role in roles.items()
        if role == "output"
    }
    simulated = {plain: names[0] for plain, names in others.items() if len(names) == 1}
    recording = ({"channels": channels} if channels else {}) | {"run": [{"file": name}]}
    values: dict[str, Any] = {"recording": recording}
    if simulated:
        values["simulation"] = {"kind": "columns", "simulated": simulated}
    unknown = units.keys() - roles.keys() - set(simulated.values())
    return Guess(
        values=values,
        notes={"recording": f"guessed from {name} by names alone: FX, FY, MX, MY and MZ are outputs"},
        silent=tuple(f"{plain}: what it is to the simulation" for plain in units if plain in unknown),
    )


def _case(name: str, columns: Sequence[Column], texts: Collection[str]) -> Guess:
    """Return what a recording says of a case: every column of numbers is a channel.

    What no name tells of is proposed as an input: which of them the simulation gives, a person says.
    """
    guess = guess_case(name, columns)
    units = {plain: unit for _, plain, unit in columns}
    channels = guess.values["recording"].get("channels", {})
    simulated = guess.values.get("simulation", {}).get("simulated", {}).values()
    proposed = [plain for plain in units if plain not in {*channels, *simulated, *texts}]
    known = dict(channels)
    channels = {
        plain: known.get(plain) or _channel(units[plain], "input")
        for plain in units
        if plain in {*known, *proposed}
    }
    times = [plain for plain, channel in known.items() if channel["role"] == "time"]
    notes = [
        f"guessed from {name} by names alone, to be confirmed: FX, FY, MX, MY and MZ are outputs",
        *(f"{plain} is the time, in s where its header states no unit" for plain in times),
    ]
    if proposed:
        notes.append(
            f'{", ".join(proposed)} proposed as inputs: give role = "output" to what the simulation gives, '
            '"covariate" to what only goes along, and take out what is neither'
        )
    recording = ({"channels": channels} if channels else {}) | {"run": [{"file": name}]}
    return replace(
        guess,
        values={**guess.values, "recording": recording},
        notes={"recording": "; ".join(notes)},
        silent=(
            *(f"{plain}: an input, an output or a covariate of the simulation" for plain in proposed),
            *(f"{plain}: it holds texts, and is no channel" for plain in units if plain in texts),
        ),
        lacking=_outputs_lacking(channels),
    )


def _outputs_lacking(channels: Mapping[str, Mapping[str, str]]) -> dict[str, str]:
    """Return what to say where no channel is an output and the reader, short of units, cannot say it yet."""
    entries = channels.values()
    if any(entry["role"] == "output" for entry in entries) or all("unit" in entry for entry in entries):
        return {}
    return {"recording.channels": 'recording.channels: role = "output" for what the simulation gives'}


def _channel(unit: str | None, role: str) -> dict[str, str]:
    return {"unit": unit, "role": role} if unit else {"role": role}


def _symbol(name: str) -> str:
    channel = channel_of(name)
    return name if channel is None else channel.symbol


def _role(symbol: str, dimension: str | None) -> str | None:
    roles = {"FZ": "load", "SA": "slip_angle", "t": "time"}
    if symbol in roles:
        return roles[symbol]
    if symbol in CHANNELS:
        return "acquired" if dimension in ("force", "moment") else "covariate"
    # A bridge's output is read from a cell, and a temperature goes along; a force may be anything.
    if dimension in _READ_FROM_CELLS:
        return "indication"
    return None if dimension in _OF_SEVERAL_ROLES else "covariate"
