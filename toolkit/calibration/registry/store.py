"""Writing to the registry: one transaction at a time, whole or not at all.

Order of a write, by one writer at a time (`lock`):

1. the journal ``.pending.json`` says what is to come: while it is there, every reader sees the state before;
2. the data files and the record, the ledger with its new line, ``head.json``: each whole, each on the disk;
3. the journal is renamed away and the folder flushed. That decides, it needs no space, and it can be reversed
   until it is on the disk.

What fails before the end of step 3 is undone, and the command says that nothing was changed. Where the
undoing fails too, or the process is killed, the journal stays: readers go on seeing the state before
(`settled`), and the next writer undoes the remainder. What no journal explains (a record that is not in the
ledger, half a line) is not mended but told by `verify`.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from toolkit.calibration.records.record import canonical
from toolkit.calibration.registry.clock import ahead, check_after
from toolkit.calibration.registry.ledger import ENDING, HEAD, LEDGER, Entry, Ledger, head_bytes, next_line
from toolkit.calibration.registry.lock import content, writing
from toolkit.calibration.registry.settled import JOURNAL, before, damaged, is_part, state_of
from toolkit.calibration.registry.signatures import signed_event, timed_event
from toolkit.errors import OutputError, RegistryError, ToolkitError
from toolkit.files import sha256_bytes, write_atomic
from toolkit.printable import check_entries
from toolkit.system import sync_folder
from toolkit.trust.people import Action
from toolkit.trust.signing import Signing

_DECIDED = ".pending.json.part"
_NAMES = ("by", "approved_by", "recall")
_WAYS_ON = {
    "entered": "discard the candidate that it is about, and enter its data again with --again",
    "approved": "withdraw the record that it is about",
}
# A folder that another writer removes while this one waits for its lock is made again.
_ATTEMPTS = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """One transaction: new files by name, and the ledger event that they belong to.

    ``action``: what a signed entry says it is, where that is not what every event of its kind is.
    """

    files: Mapping[str, bytes]
    event: Mapping[str, Any]
    action: Action | None = None


def commit(
    folder: Path,
    build: Callable[[Ledger], Change | None],
    *,
    lock_file: bool = False,
    signing: Signing | None = None,
    judged: Callable[[Ledger], Ledger] = lambda ledger: ledger,
) -> bool:
    """Make one change to an instrument's folder; ``build`` sees the ledger under the lock.

    Returns whether anything was written (``build`` may answer None). ``lock_file``: a file keeps other
    writers out, for a file system without locks. ``signing``: who signs the line;
    ``judged`` holds the lines before it against the people who signed them.

    Raises
    ------
    RegistryError
        the ledger is damaged, or its last entry is later than this one (``time``); the name of another
        instrument differs by case alone (``instrument-case``); ``no-locks``; ``locked``. Nothing is written
    OutputError
        the folder cannot be written to: the message says that nothing was changed, or what state it is in
    ConfigError
        ``unprintable``: a text of the event has a character that no document can print; nothing is written
    TrustError
        ``not-signed``, ``not-allowed``: the decision takes other keys; ``request``; nothing is written
    Requested
        the decision was written to a file to be signed elsewhere; the folder is as it was
    """
    with _locked(folder, lock_file=lock_file):
        with _writable(folder):
            _undo(folder)
        state = state_of(folder)
        ledger = judged(state.ledger)
        if ledger.damage is not None:
            raise damaged(folder, ledger.damage)
        change = build(ledger)
        if change is None:
            return False
        # A line stands for ever, and every document of its record prints what it says.
        check_entries(change.event, where=change.event["id"], names=_NAMES)
        event = timed_event(change.event, ledger, signing)
        last = _bound(ledger)
        if last is not None and event["event"] not in ENDING:
            way_on = _WAYS_ON.get(last.event)
            if way_on is not None:
                way_on = f"; where {last.event} {last.id} is of a fast clock, {way_on}"
            check_after(last.time, event["time"], folder / LEDGER, way_on or "")
        if signing is not None:
            event = signed_event(event, ledger, signing, action=change.action, file=_text_of(change))
        line, digest = next_line(len(ledger.entries) + 1, ledger.head, event)
        lines = state.lines or b""
        journal = {
            "files": sorted(change.files),
            "before": sha256_bytes(lines),
            "bytes": len(lines),
            "line": line.decode(),
        }
        contents = {
            JOURNAL: canonical(journal).encode(),
            **change.files,
            LEDGER: lines + line,
            HEAD: head_bytes(len(ledger.entries) + 1, digest),
        }
        with _undone(folder):
            for name, data in contents.items():
                write_atomic(folder / name, data)
            (folder / JOURNAL).replace(folder / _DECIDED)
        try:
            sync_folder(folder)
        except OSError as error:
            raise _reversed(folder, error) from error
        with contextlib.suppress(OSError):  # the next writer removes it
            (folder / _DECIDED).unlink()
        return True


def _bound(ledger: Ledger) -> Entry | None:
    """Return the line before whose time no line is entered: the last one.

    A document that was issued by a fast clock keeps nothing out: it decided nothing.
    """
    lines = (entry for entry in reversed(ledger.entries) if entry.event != "issued" or not ahead(entry.time))
    return next(lines, None)


def _text_of(change: Change) -> str | None:
    """Return the text of the file whose hash an entry names: of its record, or of the people."""
    stated = change.event.get("file")
    return next((data.decode() for data in change.files.values() if sha256_bytes(data) == stated), None)


@contextlib.contextmanager
def _locked(folder: Path, *, lock_file: bool) -> Iterator[None]:
    """Make an instrument's folder and lock it; folders that were made for nothing are removed."""
    for _ in range(_ATTEMPTS):
        with contextlib.ExitStack() as stack:
            try:
                with _writable(folder, but=FileNotFoundError):
                    _check_case(folder)
                    created = _make(folder)
                    if lock_file:  # which lies in the folder, and is in the way of its removal
                        stack.callback(_remove_empty, created)
                    stack.enter_context(writing(folder, lock_file=lock_file))
                    if not lock_file:
                        stack.callback(_remove_empty, created)
                    for path in created:
                        sync_folder(path.parent)
            except FileNotFoundError:
                continue
            yield
            return
    raise _not_written(folder, "it is removed time and again")


def _make(folder: Path) -> list[Path]:
    """Make a folder with those above it; return the ones that were not there."""
    created: list[Path] = []
    try:
        for path in (*reversed(folder.parents), folder):
            if not path.is_dir():
                path.mkdir(exist_ok=True)
                created.append(path)
    except OSError:
        _remove_empty(created)
        raise
    return created


def _remove_empty(folders: list[Path]) -> None:
    with contextlib.suppress(OSError):
        for folder in reversed(folders):
            folder.rmdir()


def _check_case(folder: Path) -> None:
    names = [path.name for path in folder.parent.iterdir()] if folder.parent.is_dir() else []
    alike = [name for name in names if name.casefold() == folder.name.casefold()]
    if alike and folder.name not in alike:
        raise RegistryError(
            f"the registry has an instrument whose name differs from {folder.name} by case alone",
            where=folder.parent,
            got=folder.name,
            expected=f"{alike[0]}, or a name that differs by more: some file systems take both for one",
            next_step=f"write the instrument's name as {alike[0]}, or choose another; nothing was changed",
            rule="instrument-case",
        )


@contextlib.contextmanager
def _writable(folder: Path, *, but: type[OSError] | tuple[()] = ()) -> Iterator[None]:
    """Turn a failure before the write into an error that says so, ``but`` one."""
    try:
        yield
    except but:
        raise
    except OSError as error:
        raise _not_written(folder, error.strerror or error) from error
    except OutputError as error:
        raise _not_written(folder, error.got) from error


@contextlib.contextmanager
def _undone(folder: Path) -> Iterator[None]:
    """Undo a write that fails or is interrupted, and say so."""
    try:
        yield
    except (OSError, OutputError) as error:
        reason = error.got if isinstance(error, OutputError) else error.strerror or error
        raise _not_written(folder, reason, complete=_tried_to_undo(folder)) from error
    except BaseException:
        _tried_to_undo(folder)
        raise


def _tried_to_undo(folder: Path) -> bool:
    try:
        _undo(folder)
    except (OSError, ToolkitError):
        return False
    return True


def _undo(folder: Path) -> None:
    """Bring back the state before the write of a journal, and remove what a write left behind."""
    journal = content(folder / JOURNAL)
    if journal is not None:
        try:
            lines, head, files = before(journal, content(folder / LEDGER), content(folder / HEAD))
        except (ValueError, KeyError, TypeError, AttributeError):
            return  # `state_of` says what is wrong with it
        for name in files:
            (folder / name).unlink(missing_ok=True)
        if content(folder / HEAD) != head and head is not None:
            write_atomic(folder / HEAD, head)
        if lines is not None:
            with (folder / LEDGER).open("r+b") as stream:
                stream.truncate(len(lines))
                os.fsync(stream.fileno())
        for name in (LEDGER, HEAD) if lines is None else ():
            (folder / name).unlink(missing_ok=True)
        # The journal goes last: until then it says what the state is.
        sync_folder(folder)
        (folder / JOURNAL).unlink()
        sync_folder(folder)
    for path in list(folder.iterdir()):
        if is_part(path.name):
            path.unlink(missing_ok=True)


def _reversed(folder: Path, error: OSError) -> OutputError:
    """Take back a decision that the disk did not confirm; return the error that says what state it is in."""
    reason = error.strerror or error
    try:
        (folder / _DECIDED).replace(folder / JOURNAL)
    except OSError:
        return OutputError(
            "the disk does not confirm a change of the registry",
            where=folder,
            got=reason,
            expected="a disk that flushes its folders",
            next_step="the change stands and 'toolkit calibration list' shows it, but a power cut may undo "
            "it: mend the disk, and look again",
            rule="not-writable",
        )
    try:
        # Before anything else is touched: a journal that a power cut takes away would not be missed.
        sync_folder(folder)
    except OSError:
        return _not_written(folder, reason, complete=False)
    return _not_written(folder, reason, complete=_tried_to_undo(folder))


def _not_written(folder: Path, reason: object, *, complete: bool = True) -> OutputError:
    remainder = "" if complete else "; the next command that writes removes what is left of the attempt"
    return OutputError(
        "the registry cannot be written to",
        where=folder,
        got=reason,
        expected="a folder with write permission and free space",
        next_step=f"free space or mend the disk, then repeat the command; nothing was changed{remainder}",
        rule="not-writable",
    )
