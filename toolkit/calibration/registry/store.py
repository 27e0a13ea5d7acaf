"""Writing to the registry: one transaction at a time, whole or not at all.

Order of a write, under an exclusive lock on the instrument's folder:

1. the journal ``.pending.json`` is written beside and renamed into place: from here on the write counts;
2. the data files and the record, each whole;
3. the ledger, as old content plus the new line;
4. ``head.json``;
5. the journal is removed.

A crash before the end of step 1 leaves at most a ``.part`` file: the write never happened, and the next
access removes it. A crash after it leaves the journal: the next access, reading or writing, repeats steps
2 to 5 from it, which gives the same result however often it is done. What no journal explains (a record
that is not in the ledger, half a line) is not mended but told by `verify`.

The lock is taken on the folder itself and is released by the system when a process dies.
"""

from __future__ import annotations

import base64
import contextlib
import errno
import fcntl
import json
import os
import shutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from toolkit.calibration.records.record import canonical
from toolkit.calibration.registry.clock import check_after
from toolkit.calibration.registry.ledger import (
    HEAD,
    LEDGER,
    START,
    Ledger,
    head_bytes,
    next_line,
    read_ledger,
)
from toolkit.errors import OutputError, RegistryError
from toolkit.files import sha256_bytes, sync_folder, write_atomic

JOURNAL = ".pending.json"


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """One transaction: new files by name, and the ledger event that they belong to."""

    files: Mapping[str, bytes]
    event: Mapping[str, Any]


def commit(folder: Path, build: Callable[[Ledger], Change | None]) -> bool:
    """Make one change to an instrument's folder; ``build`` sees the ledger under the lock.

    Returns whether anything was written (``build`` may answer None).

    Raises
    ------
    RegistryError
        the ledger is damaged, or its last entry is later than this one (``time``); nothing is written
    OutputError
        the folder cannot be written to
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(
            "the registry folder cannot be made", where=folder, got=error.strerror,
            expected="a folder with write permission", next_step="choose another folder with --calibrations",
            rule="not-writable",
        ) from error  # fmt: skip
    with _lock(folder, fcntl.LOCK_EX):
        _recover(folder)
        ledger = read_ledger(folder)
        if ledger.damage is not None:
            raise damaged(folder, ledger.damage)
        change = build(ledger)
        if change is None:
            return False
        last = ledger.entries[-1].time if ledger.entries else None
        check_after(last, change.event["time"], folder / LEDGER)
        line, digest = next_line(len(ledger.entries) + 1, ledger.head, change.event)
        before = (folder / LEDGER).read_bytes() if ledger.entries else b""
        journal = {
            "files": {name: base64.b64encode(data).decode() for name, data in change.files.items()},
            "before": sha256_bytes(before),
            "bytes": len(before),
            "line": line.decode(),
            "count": len(ledger.entries) + 1,
            "sha256": digest,
        }
        write_atomic(folder / JOURNAL, canonical(journal))
        _roll_forward(folder)
        return True


def read(folder: Path) -> Ledger:
    """Return an instrument's ledger as it stands between two writes; finishes one that was interrupted."""
    if not folder.is_dir():
        return Ledger(entries=(), damage=None)
    if interrupted(folder):
        if not os.access(folder, os.W_OK):
            return Ledger(entries=(), damage="a write was interrupted, and this folder cannot be written to")
        try:
            with _lock(folder, fcntl.LOCK_EX):
                _recover(folder)
        except RegistryError as error:
            return Ledger(entries=(), damage=f"{error.what}: {error.got}")
    with _lock(folder, fcntl.LOCK_SH):
        return read_ledger(folder)


def copy_files(folder: Path, target: Path) -> None:
    """Copy the files of an instrument's folder as they stand between two writes, or after a cut-off one."""
    if not folder.is_dir():
        return
    target.mkdir()
    with _lock(folder, fcntl.LOCK_SH):
        for path in folder.iterdir():
            if path.is_file():
                shutil.copyfile(path, target / path.name)


def interrupted(folder: Path) -> bool:
    """Tell whether a write was cut off, or is going on."""
    return any(path.name == JOURNAL or _is_part(path.name) for path in folder.iterdir())


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


def _is_part(name: str) -> bool:
    return name.startswith(".") and name.endswith(".part")


def _recover(folder: Path) -> None:
    for path in list(folder.iterdir()):
        if _is_part(path.name):
            path.unlink(missing_ok=True)
    if (folder / JOURNAL).exists():
        _roll_forward(folder)


def _roll_forward(folder: Path) -> None:
    path = folder / JOURNAL
    problem: object = "the ledger is not the one that the write began with"
    ledger = (folder / LEDGER).read_bytes() if (folder / LEDGER).exists() else b""
    try:
        journal = json.loads(path.read_bytes())
        files = {name: base64.b64decode(text) for name, text in journal["files"].items()}
        size, line, count = int(journal["bytes"]), str(journal["line"]).encode(), int(journal["count"])
        intact = sha256_bytes(ledger[:size]) == journal["before"] and ledger[size:] in (b"", line)
        head = head_bytes(count, str(journal["sha256"]))
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        problem, intact = error, False
    if not intact:
        raise RegistryError(
            f"an interrupted write to {folder.name} cannot be finished",
            where=path,
            got=problem,
            expected="the journal of one write and the ledger it began with",
            next_step="restore the folder from a backup",
            rule="ledger",
        )
    for name, data in files.items():
        write_atomic(folder / name, data)
    write_atomic(folder / LEDGER, ledger[:size] + line)
    write_atomic(folder / HEAD, head)
    path.unlink()
    sync_folder(folder)


@contextlib.contextmanager
def _lock(folder: Path, mode: int) -> Iterator[None]:
    handle = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, mode)
        except OSError as error:
            # A file system without locks (some network mounts) still serves readers.
            if mode == fcntl.LOCK_EX or error.errno not in (errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS):
                raise
        yield
    finally:
        os.close(handle)


__all__ = ["JOURNAL", "START", "Change", "commit", "damaged", "interrupted", "read"]
