"""Sessions that are being typed: each is a session's folder in the home, as `toolkit calibrate` reads it.

``HOME/drafts/<id>/`` holds SESSION.toml and the tables that it names. What is typed is written there whole,
right or wrong, so that nothing is lost; of a session that was entered it is ``HOME/sessions/<record>/``, and
``HOME/drafts/<id>.toml`` says so to whoever still has its page open.
"""

from __future__ import annotations

import contextlib
import datetime as dt
import os
import re
import shutil
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolkit.calibration.registry.clock import begun
from toolkit.calibration.session.session_file import INSTRUMENT, INSTRUMENT_FORM, SessionFile
from toolkit.days import parse_day
from toolkit.declared import attempt, toml_text
from toolkit.errors import ConfigError, OutputError, SessionError, ToolkitError
from toolkit.files import toml_entries, write_atomic
from toolkit.inputs import DATA_FILE, SETTINGS_FILE, check_size, is_regular, read_input, read_regular
from toolkit.lab.desk.uploads import FILE_NAME, claimed_folder
from toolkit.lab.desk.versions import version_of
from toolkit.publication import publication, settle

if TYPE_CHECKING:
    from toolkit.calibration.registry.registry import Registry

DRAFTS, SESSIONS = "drafts", "sessions"
SESSION = "SESSION.toml"
GRIDS = {"data": "loads.csv", "check": "check.csv"}
"""The tables that are typed: their key in the session, and their name where it states none."""

_ID = re.compile(r"draft-[1-9][0-9]{0,8}\Z")
_TEXT = (".csv", ".tsv", ".txt")
_STANDING = (
    "schema", "instrument", "indications", "loads", "model", "degree", "method", "drop", "between_runs",
    "reference", "cells", "check",
)  # fmt: skip
"""What the next session of an instrument takes over: no reading, and nothing that is of one day."""
_CELL_READINGS = ("shunt_measured", "replacement")
_CELL = re.compile(
    r"(?P<file>[^/\\]+), row \d+ \((?:line |cell [A-Z]+)(?P<line>\d+)\)(?:, column (?P<column>.+))?\Z"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Draft:
    """A session that is being typed.

    ``session`` is the text of SESSION.toml; ``grids`` the tables by their key, cells between tabs, None where
    the file is no text; ``names`` those of the tables; ``files`` the names of what else lies there;
    ``version`` is that of all of it.
    """

    id: str
    session: str
    grids: Mapping[str, str | None]
    names: Mapping[str, str]
    files: tuple[str, ...]
    version: str = ""

    @property
    def texts(self) -> dict[str, str]:
        """The texts that are typed, each under the name of its file."""
        tables = {self.names[key]: text for key, text in self.grids.items() if text}
        return {SESSION: self.session, **tables}

    @property
    def title(self) -> str:
        """Instrument and date, as far as they are typed."""
        table = _parsed(self.session)
        return " ".join(str(table[key]) for key in ("instrument", "date") if key in table)


def drafts(home: Path) -> tuple[Draft, ...]:
    """Return every draft of a home, oldest first; one that cannot be read is empty."""
    rows = []
    for name in draft_ids(home):
        try:
            rows.append(open_draft(home, name))
        except ToolkitError:
            rows.append(Draft(id=name, session="", grids={}, names={}, files=()))
    return tuple(rows)


def draft_ids(home: Path) -> tuple[str, ...]:
    """Return the ids of the drafts, oldest first."""
    folder = home / DRAFTS
    names = [path.name for path in folder.iterdir()] if folder.is_dir() else []
    return tuple(sorted((name for name in names if _ID.match(name)), key=lambda name: int(name[6:])))


def session_file(home: Path, draft_id: str) -> Path:
    """Return where the session of a draft lies."""
    return home / DRAFTS / draft_id / SESSION


def open_draft(home: Path, draft_id: str) -> Draft:
    """Read a draft; what cannot be parsed is shown as it stands.

    Raises
    ------
    ConfigError
        its session cannot be read; ``no-file``: it was entered or removed meanwhile
    """
    folder = home / DRAFTS / draft_id
    settle(folder)
    # A draft whose beginning was cut off has no session yet.
    data = read_input(folder / SESSION, SETTINGS_FILE) if os.path.lexists(folder / SESSION) else b""
    session = data.decode("utf-8-sig", errors="replace")
    names = _names(session)
    try:
        files = sorted(
            path.name for path in folder.iterdir() if is_regular(path) and not path.name.startswith(".")
        )
    except FileNotFoundError:
        raise ConfigError(
            "the draft is no longer there", where=f"{DRAFTS}/{draft_id}", got="no such folder",
            expected="a draft that is being typed",
            next_step="look at the records: it was entered, or removed", rule="no-file",
        ) from None  # fmt: skip
    return Draft(
        id=draft_id,
        session=session,
        grids={key: _grid(folder / name) for key, name in names.items()},
        names=names,
        files=tuple(name for name in files if name != SESSION),
        version=version_of(folder),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Ended:
    """What became of a draft: the record that it was entered as, None where it was removed; and when."""

    record: str | None
    time: str


def ended_draft(home: Path, draft_id: str) -> Ended | None:
    """Return what became of a draft that is no longer there; None where nobody wrote it down."""
    if not _ID.match(draft_id):
        return None
    try:
        table = toml_entries(read_regular(_note(home, draft_id), SETTINGS_FILE).decode())
    except (OSError, ValueError):
        return None
    record = table.get("record")
    return Ended(record=record if isinstance(record, str) else None, time=str(table.get("time", "")))


def _note(home: Path, draft_id: str) -> Path:
    return home / DRAFTS / f"{draft_id}.toml"


def _write_down(home: Path, draft_id: str, record: str | None) -> None:
    time = dt.datetime.now(tz=UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    stated = {} if record is None else {"record": record}
    write_atomic(_note(home, draft_id), toml_text({"schema": 1, **stated, "time": time}))


def as_of_draft(error: ToolkitError, copy: Path, home: Path, draft_id: str) -> None:
    """Let an error of a copy of a draft name the places of the draft itself."""
    for each in (error, *(error.further if isinstance(error, SessionError) else ())):
        each.where = each.where and each.where.replace(str(copy.parent), str(home / DRAFTS / draft_id))


def statement_faults(session: str, today: dt.date) -> dict[str, str]:
    """Return what stands in an entry and cannot be used, by the entry's name: what the session's reader says.

    Empty where the text is no TOML: then no entry is to blame.
    """
    table = _parsed(session)
    if not table:
        return {}
    stated = {key: entry for key, entry in table.items() if key != "schema"}
    _, faults = attempt(SessionFile, stated)
    told = {".".join(map(str, fault.key)): fault.expected for fault in faults if fault.kind == "wrong"}
    instrument, day = table.get("instrument"), table.get("date")
    if isinstance(instrument, str) and not INSTRUMENT.match(instrument):
        told.setdefault("instrument", INSTRUMENT_FORM)
    with contextlib.suppress(ValueError):
        if day is not None and not begun(parse_day(str(day))):
            told.setdefault("date", f"a day up to {today.isoformat()}")
    return told


def check_statements(session: str, today: dt.date) -> None:
    """Refuse what a new session was to begin with, where its reader would refuse it later.

    Raises
    ------
    ConfigError
        ``session``; the first entry that cannot be used is named
    """
    for name, expected in statement_faults(session, today).items():
        raise ConfigError(
            f"{name} cannot be used", where=name, got=_parsed(session).get(name), expected=expected,
            next_step="correct it; nothing was written", rule="session",
        )  # fmt: skip


def begin_draft(home: Path, session: str, tables: Mapping[str, bytes]) -> str:
    """Make a draft; return its id.

    Raises
    ------
    ToolkitError
        a file is too large, or has a name that no table has; nothing is written
    """
    files = {SESSION: session.encode(), **tables}
    _check(files)
    draft_id = claimed_folder(home / DRAFTS, "draft")
    try:
        _write(home / DRAFTS / draft_id, files)
    except ToolkitError:
        _remove(home, draft_id)
        raise
    return draft_id


def dropped_files(files: Sequence[tuple[str, bytes]]) -> tuple[str | None, dict[str, bytes]]:
    """Return the session's text among files, None without one, and the tables by name.

    Raises
    ------
    ConfigError
        ``usage``: two sessions, two files of a name, or a name that cannot be a table's
    """
    sessions = [data for name, data in files if name.lower().endswith(".toml")]
    tables = {name: data for name, data in files if not name.lower().endswith(".toml")}
    if len(sessions) > 1 or len(sessions) + len(tables) < len(files):
        raise ConfigError(
            "the files are not those of one session", where="files", got=", ".join(name for name, _ in files),
            expected=f"one {SESSION} and the tables that it names",
            next_step="choose them again; nothing was written", rule="usage",
        )  # fmt: skip
    for data in sessions:
        check_size(data, SETTINGS_FILE, SESSION)
    return (sessions[0].decode("utf-8-sig", errors="replace") if sessions else None), tables


def save_draft(home: Path, draft_id: str, session: str, grids: Mapping[str, str]) -> None:
    """Write what was typed; a table whose cells are as they were keeps its bytes, one without rows goes.

    Raises
    ------
    ToolkitError
        it is too large, or cannot be written; the draft is as it was
    """
    before = open_draft(home, draft_id)
    changed: dict[str, bytes] = {}
    folder = home / DRAFTS / draft_id
    names = _names(session)
    tables = {key: _rows(text) for key, text in grids.items()}
    if tables.get("check", "").count("\n") < 2 and "check" in tables:
        tables["check"] = ""  # a header alone: nobody measured check loads
    for key, typed in tables.items():
        if typed == _rows(before.grids.get(key) or ""):
            continue
        if typed:
            changed[names[key]] = typed.encode()
        elif key != "data":
            with contextlib.suppress(FileNotFoundError):
                (folder / names[key]).unlink()
    session = session.replace("\r\n", "\n")
    statement = f'check = "{names["check"]}"\n'
    if tables.get("check"):
        # The form may hold the statements from before somebody typed check loads.
        stated = _parsed(session)
        session = statement + session if stated and "check" not in stated else session
    elif "check" in tables:
        session = session.removeprefix(statement)
    if session != before.session:
        changed[SESSION] = session.encode()
    if changed:
        _write(folder, changed)


def add_files(home: Path, draft_id: str, files: Sequence[tuple[str, bytes]]) -> None:
    """Put files beside a draft's session, or in its place.

    Raises
    ------
    ToolkitError
        as `dropped_files` and `begin_draft`
    """
    session, tables = dropped_files(files)
    _write(home / DRAFTS / draft_id, tables | ({} if session is None else {SESSION: session.encode()}))


def drop_draft(home: Path, draft_id: str) -> None:
    """Remove a draft, and write down that it was.

    Raises
    ------
    OutputError
        it cannot be removed whole
    """
    _remove(home, draft_id)
    with contextlib.suppress(OSError, OutputError):
        _write_down(home, draft_id, None)


def _remove(home: Path, draft_id: str) -> None:
    try:
        shutil.rmtree(home / DRAFTS / draft_id)
    except OSError as error:
        raise OutputError(
            "a draft cannot be removed", where=home / DRAFTS / draft_id, got=error.strerror,
            expected="a folder with write permission", next_step="give that permission", rule="not-writable",
        ) from error  # fmt: skip


def keep_session(home: Path, draft_id: str, record_id: str) -> None:
    """Move a draft that was entered to the sessions of the home; where that record has one, it stays."""
    target = home / SESSIONS / record_id
    with contextlib.suppress(
        OSError, OutputError
    ):  # the registry has the session's files: this copy is for people
        target.parent.mkdir(exist_ok=True)
        if not target.exists():
            (home / DRAFTS / draft_id).rename(target)
            _write_down(home, draft_id, record_id)


def new_session(
    *, instrument: str, indications: str, loads: str, day: dt.date, operator: str
) -> tuple[str, str]:
    """Return SESSION.toml of an instrument's first session, and the header of its loads.

    >>> new_session(instrument="hub", indications="D51 [mV/V]", loads="FY [N]", day=dt.date(2026, 3, 2),
    ...             operator="A")[1]
    'D51 [mV/V]\\tFY [N]\\trun\\tdirection\\n'
    """
    columns = {
        key: [part.strip() for part in re.split(r"[,;\t]", text) if part.strip()]
        for key, text in (("indications", indications), ("loads", loads))
    }
    names = {key: [re.split(r"\s*[\[(]", part)[0] for part in parts] for key, parts in columns.items()}
    table = {
        "schema": 1, "instrument": instrument, "date": day, "operator": operator, **names,
        "data": GRIDS["data"], "zero": "included",
    }  # fmt: skip
    return toml_text(table), "\t".join(
        [*columns["indications"], *columns["loads"], "run", "direction"]
    ) + "\n"


def next_session(registry: Registry, instrument: str, *, day: dt.date, operator: str) -> tuple[str, str]:
    """Return SESSION.toml as the instrument's last session stated it, without its readings, and its header.

    Raises
    ------
    RecordError, RegistryError
        the record of that session fails a gate
    ConfigError
        ``missing``: no session of this instrument was ever entered
    """
    from toolkit.calibration.registry.stored import stored_session

    for record_id in reversed(registry.ids(instrument)):
        record = registry.load(record_id)
        if record.kind == "fit":
            break
    else:
        raise ConfigError(
            "the instrument has no session to go on from", where=instrument, got="legacy records, or none",
            expected="an instrument with a session", next_step="state its columns instead", rule="missing",
        )  # fmt: skip
    session = stored_session(registry.folder, record)
    raw = _parsed(session.session_bytes.decode("utf-8-sig"))
    table: dict[str, Any] = {key: raw[key] for key in _STANDING if key in raw}
    table |= {"date": day, "operator": operator, "data": GRIDS["data"], "zero": session.zero}
    # Without a name it means the table of that name, where somebody types one.
    check = table.get("check")
    stated_check = check.items() if isinstance(check, dict) else ()
    table["check"] = {key: entry for key, entry in stated_check if key not in ("file", "data")}
    table["cells"] = {
        name: {key: entry for key, entry in cell.items() if key not in _CELL_READINGS}
        for name, cell in table.get("cells", {}).items()
    }
    table = {key: entry for key, entry in table.items() if entry not in ({}, [])}
    header = _rows(_text(session.data_bytes) or "").partition("\n")[0]
    return toml_text(table), f"{header}\n"


def faults_of(error: ToolkitError, draft: Draft) -> list[dict[str, Any]]:
    """Return the cells that an error is about: ``table`` by its key, ``line`` of the file, ``column`` from 0.

    ``column`` is None where the error is about a row. Empty where it is about no cell of a typed table.
    """
    errors = (error, *(error.further if isinstance(error, SessionError) else ()))
    return [fault for each in errors if (fault := _fault(each, draft)) is not None]


def _fault(error: ToolkitError, draft: Draft) -> dict[str, Any] | None:
    match = _CELL.search(error.where or "")
    if match is None:
        return None
    key = next((key for key, name in draft.names.items() if name == match["file"]), None)
    header = (draft.grids.get(key or "") or "").partition("\n")[0].split("\t")
    names = [re.split(r"\s*[\[(]", part)[0] for part in header]
    column = names.index(match["column"]) if match["column"] in names else None
    return None if key is None else {"table": key, "line": int(match["line"]), "column": column}


def _write(folder: Path, files: Mapping[str, bytes]) -> None:
    _check(files)
    with publication(folder) as stage:
        for name, data in files.items():
            (stage / name).write_bytes(data)


def _check(files: Mapping[str, bytes]) -> None:
    for name, data in files.items():
        if not FILE_NAME.match(name):
            raise ConfigError(
                "no name of a session's table", where="files", got=name,
                expected="letters, digits, blanks, points and lines, with a letter or digit first",
                next_step="name the file anew, in the session too; nothing was written", rule="usage",
            )  # fmt: skip
        check_size(data, SETTINGS_FILE if name == SESSION else DATA_FILE, name)


def _parsed(session: str) -> dict[str, Any]:
    try:
        return toml_entries(session)
    except (tomllib.TOMLDecodeError, RecursionError):
        return {}


def _names(session: str) -> dict[str, str]:
    """Return the names of the tables of a session: those that it states, where they can be typed."""
    table = _parsed(session)
    check = table.get("check")
    stated = {
        "data": table.get("data"),
        "check": check.get("file", check.get("data")) if isinstance(check, dict) else check,
    }
    return {
        key: name if isinstance(name := stated[key], str) and FILE_NAME.match(name) else default
        for key, default in GRIDS.items()
    }


def _grid(path: Path) -> str | None:
    try:
        return _text(read_regular(path, DATA_FILE)) if path.suffix.lower() in _TEXT else None
    except FileNotFoundError:
        return ""
    except OSError:
        return None


def _text(data: bytes) -> str | None:
    """Return the cells of a text file between tabs; None where it is no table of text."""
    from toolkit.recording.csvfile import decode, first_line, split_rows

    where = Path("table")
    try:
        text = decode(data, where=where)
        head = first_line(text)
        rows = split_rows(text, max("\t;,", key=head.count), where=where)
    except ToolkitError:
        return None
    if any(mark in cell for row in rows for cell in row for mark in '\t\n\r"'):
        return None
    return "".join("\t".join(row) + "\n" for row in rows)


def _rows(text: str) -> str:
    """Return a table without blank rows at its end, each row ended by a line feed."""
    lines = [line.rstrip("\r") for line in text.replace("\r\n", "\n").split("\n")]
    while lines and not lines[-1].strip():
        lines.pop()
    return "".join(f"{line}\n" for line in lines)
