"""Staging folders: where results are written before they enter their folder; claimed, locked and swept.

The maker of a staging folder holds a lock on it, which tells the dead from the living: what a killed command
left is swept by the next one. A file system without locks has one writer at a time by the laboratory's own
order, and no staging is swept on it.
"""

from __future__ import annotations

import contextlib
import os
import secrets
import shutil
from collections.abc import Iterator
from pathlib import Path

from toolkit.system import (
    close_folder,
    is_open_at,
    lock_if_any,
    open_folder,
    sync_file,
    sync_folder,
    unlock_folder,
)

PASSING = ".toolkit-"
"""What the folders of a publication are named by: nothing of them is a result yet."""
STAGED = f"{PASSING}staged-"
SUPERSEDED = ".superseded"
"""Of a staging folder: empty files, named as results that go with the old ones."""


def claim(place: Path) -> tuple[Path, int]:
    """Make a staging folder; return it with the handle that holds its lock."""
    while True:
        stage = place / f"{STAGED}{secrets.token_hex(8)}"
        stage.mkdir()
        with contextlib.suppress(FileNotFoundError):  # swept before it was locked
            handle = open_folder(stage)
            if lock_if_any(handle, wait=False) is not False and is_open_at(handle, stage):
                return stage, handle
            close_folder(handle)


def sweep(place: Path) -> None:
    """Remove staging folders whose makers are dead."""
    with contextlib.suppress(OSError):
        for stage in place.glob(f"{STAGED}*"):
            handle = open_folder(stage, links=False)
            try:
                if lock_if_any(handle, wait=False):
                    shutil.rmtree(stage, ignore_errors=True)
            finally:
                close_folder(handle)


def supersede(stage: Path, name: str | Path) -> None:
    """Let an earlier result go together with the ones that are replaced, although no new one has its name."""
    mark = stage / SUPERSEDED / name
    mark.parent.mkdir(parents=True, exist_ok=True)
    mark.touch()


def drop_marks(stage: Path) -> None:
    """Take the names that `supersede` wrote out of a staging folder."""
    if (stage / SUPERSEDED).exists():
        shutil.rmtree(stage / SUPERSEDED)


def result_files(folder: Path) -> list[Path]:
    """Return every file below a folder, and every empty sub-folder, relative to it; links as they are."""
    entries: list[Path] = []
    for base, folders, names in os.walk(folder):
        below = Path(base).relative_to(folder)
        if below == Path():
            folders[:] = [name for name in folders if name != SUPERSEDED]
        entries += [below / name for name in names]
        entries += [below / name for name in folders if (Path(base) / name).is_symlink()]
        if not folders and not names and below != Path():
            entries.append(below)
    return entries


def flush(stage: Path) -> None:
    """Flush a staging folder to the disk, with all that it holds."""
    for base, _, names in os.walk(stage):
        for name in names:
            sync_file(Path(base) / name)
        sync_folder(Path(base))


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the lock on a folder; one that was exchanged while it was waited for is another folder."""
    while True:
        handle = open_folder(folder)
        lock_if_any(handle)
        if is_open_at(handle, folder):
            break
        close_folder(handle)
    try:
        yield
    finally:
        unlock_folder(handle)


def is_folder(path: Path) -> bool:
    """Tell whether a path is a folder itself and no link to one."""
    return path.is_dir() and not path.is_symlink()
