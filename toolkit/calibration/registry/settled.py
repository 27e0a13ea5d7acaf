"""Reading an instrument's folder as it stands between two writes, or before one that was cut off.

Nothing is written here: readers work on a full disk, in a read-only folder and beside a writer. While a
journal is there, the state is the one before its write (`store`): the ledger up to its old length, the old
head, and none of the files that the journal names.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

from toolkit.calibration.registry.ledger import BRINGING, HEAD, LEDGER, Ledger, head_bytes, parse_ledger
from toolkit.calibration.registry.lock import LOCK_FILE, content, reading
from toolkit.errors import RegistryError
from toolkit.files import sha256_bytes
from toolkit.inputs import read_regular

JOURNAL = ".pending.json"
_REMEMBERED = 16 << 20  # bytes of a ledger whose entries are kept for the next question
_PATIENCE_S = 1.0
_PAUSE_S = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """Ledger, and the content of its two files: None where there is none.

    ``steady``: no write began or ended while they were read.
    """

    ledger: Ledger
    lines: bytes | None = None
    head: bytes | None = None
    steady: bool = True


def read(folder: Path) -> Ledger:
    """Return an instrument's ledger; damage is told in the result, not raised."""
    return _settled(folder).ledger


def settled_files(folder: Path) -> Iterator[tuple[str, bytes]]:
    """Yield name and content of every file of an instrument, sorted by name."""
    if not folder.is_dir():
        return
    state = _settled(folder)
    decided = {LEDGER: state.lines, HEAD: state.head}
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if is_passing(name) or name in state.ledger.hidden or not path.is_file():
            continue
        data = decided[name] if name in decided else read_regular(path)
        if data is not None:
            yield name, data


def copy_files(folder: Path, target: Path) -> None:
    """Copy the files of an instrument's folder, but for those in folders below it."""
    if not folder.is_dir():
        return
    target.mkdir()
    for name, data in settled_files(folder):
        if "/" not in name:
            (target / name).write_bytes(data)


def is_empty(folder: Path) -> bool:
    """Tell whether an instrument's folder has nothing, or nothing but what a first write left behind."""
    names = {path.name for path in folder.iterdir() if not is_passing(path.name)}
    if not names or not (folder / JOURNAL).exists():
        return not names
    state = _settled(folder)
    return (
        state.ledger.damage is None
        and not state.ledger.entries
        and names <= {LEDGER, HEAD, *state.ledger.hidden}
    )


def is_passing(name: str) -> bool:
    """Tell whether a file of an instrument's folder belongs to a write: its journal, its lock, a part."""
    return name in (JOURNAL, LOCK_FILE) or is_part(name)


def is_part(name: str) -> bool:
    """Tell whether a file is one that never came to its name."""
    return name.startswith(".") and name.endswith(".part")


def state_of(folder: Path) -> State:
    """Return what journal, ledger and head say at this moment; a writer asks under its lock."""
    try:
        journal = content(folder / JOURNAL)
        lines, head = content(folder / LEDGER), content(folder / HEAD)
        steady = journal == content(folder / JOURNAL)
    except OSError as error:
        return State(ledger=Ledger(entries=(), damage=f"the ledger cannot be read: {error.strerror}"))
    hidden: frozenset[str] = frozenset()
    if journal is not None:
        try:
            lines, head, hidden = before(journal, lines, head)
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            damage = f"a write was cut off, and its journal {JOURNAL} cannot be followed: {error}"
            return State(ledger=Ledger(entries=(), damage=damage), steady=steady)
    if lines is None:
        missing = None if head is None else "ledger.jsonl is missing while head.json exists"
        ledger = Ledger(entries=(), damage=missing, hidden=hidden)
    else:
        parse = _parsed if len(lines) <= _REMEMBERED else parse_ledger
        ledger = parse(lines, head)
        ledger = replace(ledger, hidden=hidden) if hidden else ledger
    return State(ledger=ledger, lines=lines, head=head, steady=steady)


@lru_cache(maxsize=16)
def _parsed(lines: bytes, head: bytes | None) -> Ledger:
    """Return the ledger of these very bytes: one command, or one page, asks for it many times."""
    return parse_ledger(lines, head)


def before(
    journal: bytes, lines: bytes | None, head: bytes | None
) -> tuple[bytes | None, bytes | None, frozenset[str]]:
    """Return ledger and head as they were before a journal's write, and the names of the files it brings.

    Raises
    ------
    ValueError, KeyError, TypeError, AttributeError
        the journal is not that of one write to this ledger
    """
    body = json.loads(journal)
    size, line, files = int(body["bytes"]), str(body["line"]).encode(), frozenset(map(str, body["files"]))
    present = lines or b""
    if size < 0 or sha256_bytes(present[:size]) != body["before"] or not line.startswith(present[size:]):
        raise ValueError("the ledger is not the one that the write began with")
    entry = json.loads(line)
    old = head_bytes(entry["seq"] - 1, entry["prev"]) if size else None
    if head not in (old, head_bytes(entry["seq"], entry["sha256"])):
        raise ValueError("head.json is neither the one that the write began with nor its own")
    # A journal hides files, and undoing removes them: never those of a record that was entered before.
    if files and (
        entry["event"] not in BRINGING or entry["id"] in parse_ledger(present[:size], old).entered()
    ):
        raise ValueError("it brings files, but no new record")
    if any("/" in name or not name.startswith(f"{entry['id']}.") for name in files):
        raise ValueError("it brings files that are not those of its record")
    return (present[:size] if size else None), old, files


def damaged(folder: Path, damage: str) -> RegistryError:
    """Return the error of a damaged ledger."""
    return RegistryError(
        f"the ledger of {folder.name} is damaged",
        where=folder / LEDGER,
        got=damage,
        expected="an unbroken chain that ends as head.json says",
        next_step="restore ledger.jsonl and head.json from a backup; see 'toolkit calibration verify'",
        rule="ledger",
    )


def _settled(folder: Path) -> State:
    if not folder.is_dir():
        return State(ledger=Ledger(entries=(), damage=None))
    with reading(folder) as alone:
        state, until = state_of(folder), time.monotonic() + _PATIENCE_S
        # Beside a writer, ledger and head may be of two moments: they are read again.
        while not alone and (state.ledger.damage or not state.steady) and time.monotonic() < until:
            time.sleep(_PAUSE_S)
            state = state_of(folder)
        return state
