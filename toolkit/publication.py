"""The results of one command: in place together or not at all, each flushed to the disk before it is named.

A command writes into a hidden staging folder that `publication` yields. At the end of the block all of it
is flushed, and then enters the folder in the first of three ways that can be gone:

1. **There is no such folder yet**: the staging folder is renamed to it. A single file is renamed likewise.
2. **The folder holds nothing but results of these names**: it and the staging folder change places, which
   Linux does in one call. Whoever looks sees the old results or the new ones.
3. **It holds other files too**, is a mount or the working folder, or its file system cannot exchange: the
   staging folder is renamed to ``.toolkit-results`` in it. That is the point of no return. The old results
   of these names are removed, the folder is renamed to ``.toolkit-entering``, and its files are moved into
   place. What describes others (``.json``, ``.toml``) leaves first and comes last. Nobody ever sees old and
   new results beside each other; after a kill `settle` goes on where it ended, and asked again changes
   nothing. The renamed folder is its own journal: what stands in it is what has yet to be done, so that no
   list can disagree with the files, and no hash is needed to tell how far it came.

A failure before the point of no return leaves the old results untouched and no staging; a kill there leaves
a staging folder that the next publication sweeps. Publications into one folder wait for each other by a lock
on the folder itself.
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import os
import shutil
import stat
import unicodedata
from collections.abc import Container, Iterable, Iterator
from pathlib import Path
from typing import Literal

from toolkit.errors import OutputError
from toolkit.files import real_path, same_file
from toolkit.inputs import demand_regular
from toolkit.staging import (
    PASSING,
    STAGED,
    SUPERSEDED,
    claim,
    drop_marks,
    flush,
    is_folder,
    locked,
    result_files,
    supersede,
    sweep,
)
from toolkit.system import sync_folder, unlock_folder

_REGISTRY = "calibrations"
_LEDGER_FILES = ("ledger.jsonl", "head.json")
PENDING, ENTERING = f"{PASSING}results", f"{PASSING}entering"
_DESCRIBING = (".json", ".toml")
# What a disk says that is full, over its quota, read only or broken: the place is to blame.
_DISK = frozenset(
    (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EACCES, errno.EPERM, errno.EIO)
)
_EXCHANGE, _AT_FDCWD = 2, -100  # of Linux: RENAME_EXCHANGE, AT_FDCWD


@contextlib.contextmanager
def publication(folder: Path) -> Iterator[Path]:
    """Yield a staging folder whose files are results of ``folder`` once the block has succeeded.

    Sub-folders count with what they hold. A folder that was made for results that did not come is removed.
    A publication in a staging folder is part of the one that it belongs to.

    Raises
    ------
    OutputError
        ``not-writable``: no permission, no space, or another obstacle. Nothing was changed, unless the
        message says that the results are whole and enter with the next command
    """
    target = real_path(folder)
    check_unguarded(target)
    if any(part.startswith(STAGED) for part in target.parts):
        target.mkdir(parents=True, exist_ok=True)
        yield target
        return
    absent = [place for place in (target, *target.parents) if not place.exists()]
    try:
        stage, handle = _staging(target)
    except OSError as error:
        _remove_empty(absent)
        raise _unwritable(folder, error) from error
    try:
        try:
            yield stage
        except OSError as error:
            if error.errno in _DISK:
                raise _unwritable(folder, error) from error
            raise
        except OutputError as error:
            if error.where is not None and error.where.startswith(str(stage)):
                error.where = f"{folder}{error.where.removeprefix(str(stage))}"
            raise
        try:
            _publish(stage, target)
        except OSError as error:
            raise _unwritable(folder, error) from error
    finally:
        shutil.rmtree(stage, ignore_errors=True)
        unlock_folder(handle)
        _remove_empty(absent)


def write_result(path: Path, data: bytes | str) -> None:
    """Write the only result of a command: one file needs no more than one rename; errors as `result_file`."""
    with result_file(path) as staged:
        staged.write_bytes(data.encode() if isinstance(data, str) else data)


@contextlib.contextmanager
def result_file(path: Path) -> Iterator[Path]:
    """Yield where the only result of a command is to be written, piece by piece or at once.

    Raises
    ------
    OutputError
        ``not-writable``: see `publication`
    """
    try:
        with publication(path.parent) as stage:
            yield stage / path.name
    except OutputError as error:
        error.where = str(path)
        raise


def settle(folder: Path) -> None:
    """Put the results of a command that was killed on their last way into place: for whoever reads them.

    Raises
    ------
    OutputError
        ``not-writable``: they cannot be moved; they are whole in a hidden folder
    """
    if not any(os.path.lexists(folder / name) for name in (PENDING, ENTERING)):
        return
    try:
        with locked(folder):
            _enter(folder)
    except OSError as error:
        raise _not_in_place(folder, error) from error


def check_folder(folder: Path) -> None:
    """Refuse a folder that no results can enter, before they are worked out.

    Raises
    ------
    OutputError
        ``not-writable``; ``guarded``: it is part of a registry
    """
    check_unguarded(folder)
    check_place(folder)


def check_unguarded(folder: Path) -> None:
    """Refuse a folder in which nothing but records and ledgers may lie: a file of another kind damages it.

    Raises
    ------
    OutputError
        ``guarded``
    """
    target = real_path(folder)
    for place in (target, *target.parents):
        if _is_guarded(place):
            raise OutputError(
                "results cannot be written among records and ledgers", where=folder,
                got=f"a place in {place}", expected="a folder outside the registry and the log of people",
                next_step="choose another place; nothing was written", rule="guarded",
            )  # fmt: skip


def _is_guarded(folder: Path) -> bool:
    """Tell whether a folder is a registry, an instrument's folder of one, or the log of people.

    A registry has its name, or holds nothing but folders of instruments.
    """
    if _is_ledger(folder):
        return True
    try:
        with os.scandir(folder) as entries:
            folders = (Path(entry.path) for entry in entries if _is_open_folder(entry))
            if folder.name == _REGISTRY:
                return True
            first = next(folders, None)
            return first is not None and _is_ledger(first) and all(map(_is_ledger, folders))
    except (OSError, ValueError):  # there is none, or nobody may look into it
        return False


def _is_open_folder(entry: os.DirEntry[str]) -> bool:
    return not entry.name.startswith(".") and entry.is_dir(follow_symlinks=False)


def _is_ledger(folder: Path) -> bool:
    return all(os.path.lexists(folder / name) for name in _LEDGER_FILES)


def check_place(folder: Path) -> None:
    """Refuse a folder that cannot be written to.

    Raises
    ------
    OutputError
        ``not-writable``
    """
    try:
        with contextlib.suppress(FileNotFoundError):
            folder.lstat()
        target = real_path(folder)
        place = next(path for path in (target, *target.parents) if os.path.lexists(path))
        if not place.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, f"{place} is no folder")
        if not os.access(place, os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, f"{place} cannot be written to")
    except (OSError, ValueError) as error:
        raise _unwritable(folder, error) from error


def check_file(path: Path) -> None:
    """Refuse a file that cannot be a result, before it is worked out; errors as `check_folder`."""
    check_folder(path.parent)
    try:
        _check_replaced(path)
        if path.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    except (OSError, ValueError) as error:
        raise _unwritable(path, error) from error


def _check_replaced(path: Path) -> None:
    """Refuse to put a result in the place of a pipe, a device, or a loop of links."""
    with contextlib.suppress(FileNotFoundError):
        if not stat.S_ISDIR(path.stat().st_mode):
            demand_regular(path)


def _staging(target: Path) -> tuple[Path, int]:
    """Make a staging folder, and lock it: in the target, beside one that does not exist yet."""
    sweep(target.parent)
    if not target.exists():
        target.parent.mkdir(parents=True, exist_ok=True)
        return claim(target.parent)
    if not os.access(target, os.W_OK | os.X_OK) and target.is_dir():
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    with locked(target):
        _enter(target)
        sweep(target)
        return claim(target)


def _publish(stage: Path, target: Path) -> None:
    if not result_files(stage) and not (stage / SUPERSEDED).exists():
        return
    _check_names(stage, target)
    flush(stage)
    if not target.exists():
        drop_marks(stage)
        try:
            stage.rename(target)
        except OSError as error:  # another command made the folder meanwhile
            if error.errno not in (errno.EEXIST, errno.ENOTEMPTY):
                raise
        else:
            try:
                sync_folder(target.parent)
            except OSError:
                target.rename(stage)
                raise
            return
    with locked(target):
        _enter(target)
        _check_ways(stage, target)
        results = result_files(stage)
        for path in results:
            if (target / path).is_file():
                (stage / path).chmod(stat.S_IMODE((target / path).stat().st_mode))
        if len(results) == 1 and not (stage / SUPERSEDED).exists() and (target / results[0]).parent == target:
            _renamed(stage, target, results[0])
        elif not _exchanged(stage, target):
            _commit(stage, target)


def _renamed(stage: Path, target: Path, name: Path) -> None:
    (stage / name).rename(target / name)
    try:
        sync_folder(target)
    except OSError as error:
        raise _unsure(target, error) from error


def _commit(stage: Path, target: Path) -> None:
    pending = target / PENDING
    stage.rename(pending)
    try:
        sync_folder(target)
    except OSError:
        pending.rename(stage)
        raise
    try:
        _enter(target)
    except OSError as error:
        raise _not_in_place(target, error) from error


def _enter(folder: Path) -> None:
    """Do what is still to be done of a publication, under the lock: see 3. above."""
    pending, entering = folder / PENDING, folder / ENTERING
    if is_folder(pending):
        _check_ways(pending, folder)
        replaced = [*result_files(pending), *result_files(pending / SUPERSEDED)]
        for path in sorted(replaced, key=_described_first, reverse=True):
            if not is_folder(folder / path):
                (folder / path).unlink(missing_ok=True)
        sync_folder(folder)
        pending.rename(entering)
    if is_folder(entering):
        _check_ways(entering, folder)
        results = sorted(result_files(entering), key=_described_first)
        for path in results:
            place = folder / path
            place.parent.mkdir(parents=True, exist_ok=True)
            if is_folder(entering / path):
                place.mkdir(exist_ok=True)
            else:
                (entering / path).replace(place)
        for place in {(folder / path).parent for path in results}:
            sync_folder(place)
        for path in result_files(entering / SUPERSEDED):
            _remove_empty([folder / place for place in path.parents[:-1]])
        shutil.rmtree(entering)
        sync_folder(folder)


def _described_first(path: Path) -> tuple[bool, str]:
    return path.suffix.lower() in _DESCRIBING, str(path)


def _check_ways(stage: Path, target: Path) -> None:
    """Refuse where a result would replace a folder, or go through a link or a mount to another place.

    A folder from outside may hold anything, the folders of this module too: no file beyond it is touched.
    """
    device = target.stat().st_dev
    for path in result_files(stage):
        if is_folder(target / path) and not is_folder(stage / path):
            raise IsADirectoryError(errno.EISDIR, f"a folder has the name of the result {path}")
        if is_folder(stage / path) and os.path.lexists(target / path) and not (target / path).is_dir():
            raise NotADirectoryError(errno.ENOTDIR, f"a file has the name of the folder {path}")
        _check_replaced(target / path)
    for path in (*result_files(stage), *result_files(stage / SUPERSEDED)):
        for parent in path.parents[:-1]:
            place = target / parent
            if os.path.lexists(place) and not (is_folder(place) and place.stat().st_dev == device):
                raise NotADirectoryError(errno.ENOTDIR, f"{parent} is no plain folder of it")


def _check_names(stage: Path, target: Path) -> None:
    """Refuse names that are one where a file system tells no case: of two results, or of another's file."""
    names: dict[str, Path] = {}
    for result in result_files(stage):
        for path in (result, *result.parents[:-1]):
            namesake = names.setdefault(caseless(path), path)
            if namesake != path:
                raise FileExistsError(errno.EEXIST, f"{namesake} and {path} differ by case alone")
    for folder in {path.parent for path in names.values()}:
        for entry in (target / folder).iterdir() if (target / folder).is_dir() else ():
            path = folder / entry.name
            namesake = names.get(caseless(path), path)
            if namesake != path and same_file(target / namesake, entry):
                raise FileExistsError(errno.EEXIST, f"{path} is there, and {namesake} would replace it")


def caseless(path: Path | str) -> str:
    """Return a name as a file system that tells no case compares it."""
    return unicodedata.normalize("NFC", str(path)).casefold()


def _exchanged(stage: Path, target: Path) -> bool:
    """Exchange the folder with the staging where nobody loses anything by it; tell whether that was done."""
    superseded = result_files(stage / SUPERSEDED)
    names = {*result_files(stage), *superseded}
    beside = target.parent / stage.name
    if not _holds_only(target, names, stage) or not _alike(stage, target):
        return False
    try:
        exchange = ctypes.CDLL(None, use_errno=True).renameat2
        drop_marks(stage)
        stage.rename(beside)
    except (OSError, AttributeError):
        return _marked_again(stage, superseded)
    arguments = (_AT_FDCWD, os.fsencode(beside), _AT_FDCWD, os.fsencode(target), _EXCHANGE)
    if exchange(*arguments) != 0:
        beside.rename(stage)
        return _marked_again(stage, superseded)
    try:
        sync_folder(target.parent)
    except OSError:
        exchange(*arguments)
        raise
    for path in result_files(beside):
        if path not in names and not os.path.lexists(target / path):  # it came in that very moment
            (target / path).parent.mkdir(parents=True, exist_ok=True)
            (beside / path).replace(target / path)
    shutil.rmtree(beside, ignore_errors=True)
    return True


def _marked_again(stage: Path, superseded: Iterable[Path]) -> Literal[False]:
    for path in superseded:
        supersede(stage, path)
    flush(stage)
    return False


def _holds_only(target: Path, names: Container[Path], stage: Path) -> bool:
    """Tell whether a folder holds plain files of these names alone, and nobody works in it."""
    working_folder = real_path(Path.cwd())
    if stage.parent != target or target in (working_folder, *working_folder.parents):
        return False
    earlier = [path for path in result_files(target) if path.parts[0] != stage.name]
    return all(path in names and stat.S_ISREG((target / path).lstat().st_mode) for path in earlier)


def _alike(stage: Path, target: Path) -> bool:
    """Give the staging the owner and the mode of its target; tell whether all else is the same."""
    status, new = target.stat(), stage.stat()
    try:
        if (status.st_uid, status.st_gid) != (new.st_uid, new.st_gid):
            os.chown(stage, status.st_uid, status.st_gid)
        stage.chmod(stat.S_IMODE(status.st_mode))
    except OSError:
        return False
    return _attributes(stage) == _attributes(target)


def _attributes(folder: Path) -> dict[str, bytes]:
    try:
        return {name: os.getxattr(folder, name) for name in os.listxattr(folder)}
    except OSError:
        return {}


def _remove_empty(folders: list[Path]) -> None:
    for folder in folders:
        with contextlib.suppress(OSError):
            folder.rmdir()


def _unwritable(folder: Path, error: OSError | ValueError) -> OutputError:
    return _disk_error(
        "the results cannot be written", folder, error, "a folder with write permission and free space",
        "free space there, or choose another folder with --out; nothing was changed",
    )  # fmt: skip


def _unsure(folder: Path, error: OSError) -> OutputError:
    return _disk_error(
        "the results are whole and in their place, but a power cut may undo it", folder, error,
        "a disk that keeps what is written", "mend the disk, and run the command again",
    )  # fmt: skip


def _not_in_place(folder: Path, error: OSError) -> OutputError:
    return _disk_error(
        "the results are whole and on the disk, but not all in their place yet", folder, error,
        "a folder in which files can be moved",
        "mend that and run any command that reads or writes this folder: it puts them in place",
    )  # fmt: skip


def _disk_error(
    problem: str, folder: Path, error: OSError | ValueError, expected: str, next_step: str
) -> OutputError:
    return OutputError(
        problem, where=folder, got=getattr(error, "strerror", None) or str(error), expected=expected,
        next_step=next_step, rule="not-writable",
    )  # fmt: skip
