"""What only some operating systems have, each with what stands in its place where it is missing.

Locks, folders that can be opened, processes that fork, groups of them, limits of memory. The rest of the
package asks this module and never the system; a branch that is not the one of this system is held to the
same contract by the tests.
"""

from __future__ import annotations

import contextlib
import errno
import os
import signal
from pathlib import Path
from subprocess import Popen
from types import ModuleType
from typing import Any


def _module(name: str) -> Any:
    from importlib import import_module

    try:
        return import_module(name)
    except ModuleNotFoundError:
        return None


fcntl: ModuleType | Any = _module("fcntl")
msvcrt: ModuleType | Any = None if fcntl else _module("msvcrt")

WITHOUT_WAITING: int = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0)
"""Flags of an opening that neither waits for a writer nor takes a terminal."""
NO_FILE = -1
"""Stands for the handle of a folder where folders cannot be opened."""

THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
"""Variables of the environment by which linear algebra is told how many threads to start."""

_NO_LOCKS = frozenset((errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS))


def one_thread() -> None:
    """Keep linear algebra, when it is loaded, on one thread, unless whoever called says otherwise.

    Its matrices have a few columns here. Threads would only wait for each other, and where another program
    has the second core they wait a hundred times as long as one of them computes.
    """
    for name in THREADS:
        os.environ.setdefault(name, "1")


def has_folder_locks() -> bool:
    """Tell whether a folder can be locked, its file system permitting."""
    return fcntl is not None


def can_fork() -> bool:
    """Tell whether a process can go on as two."""
    return hasattr(os, "fork")


def open_folder(folder: Path, *, links: bool = True) -> int:
    """Open a folder for its lock and its flush; `NO_FILE` on a system that opens none.

    Raises
    ------
    OSError
        there is none, it may not be read, or it is a link although ``links`` is false
    """
    if has_folder_locks():
        return os.open(folder, os.O_RDONLY | os.O_DIRECTORY | (0 if links else os.O_NOFOLLOW))
    if not folder.is_dir() or not (links or not folder.is_symlink()):
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(folder))
    return NO_FILE


def close_folder(handle: int) -> None:
    """Close what `open_folder` returned, and let its lock go."""
    if handle != NO_FILE:
        os.close(handle)


def is_open_at(handle: int, folder: Path) -> bool:
    """Tell whether an opened folder is still the one of this name."""
    try:
        return handle == NO_FILE or os.path.samestat(os.fstat(handle), folder.stat())
    except FileNotFoundError:
        return False


def lock_folder(handle: int, *, shared: bool = False, wait: bool = True) -> None:
    """Lock an opened folder.

    Raises
    ------
    BlockingIOError
        another process has it, and ``wait`` is false
    OSError
        there are no locks, or the system refuses for another reason
    """
    if handle == NO_FILE:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))
    fcntl.flock(handle, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | (0 if wait else fcntl.LOCK_NB))


def lock_if_any(handle: int, *, wait: bool = True) -> bool | None:
    """Lock an opened folder; return whether that was done, None where there are no locks."""
    try:
        lock_folder(handle, wait=wait)
    except BlockingIOError:
        return False
    except OSError as error:
        if error.errno in _NO_LOCKS:
            return None
        raise
    return True


def unlock_folder(handle: int) -> None:
    """Undo a lock and close its handle: a worker that was forked meanwhile holds the same lock."""
    if handle != NO_FILE:
        with contextlib.suppress(OSError):
            fcntl.flock(handle, fcntl.LOCK_UN)
        os.close(handle)


def sync_folder(folder: Path) -> None:
    """Flush a folder's entries to the disk; a system that opens no folder flushes them by itself."""
    if has_folder_locks():
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def sync_file(path: Path) -> None:
    """Flush a file that was just written to the disk; Windows flushes only what is opened for writing."""
    handle = os.open(path, os.O_RDONLY if has_folder_locks() else os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def lock_file(handle: int) -> None:
    """Lock an open file for this process until it is closed, without waiting.

    Where the system has no locks at all, one process at a time is the laboratory's own order.

    Raises
    ------
    OSError
        another process has it, or the file system has no locks
    """
    if fcntl is not None:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    elif msvcrt is not None:
        # A byte beyond the usual end, within 31 bits: what lies under such a lock is not read by others.
        place = os.lseek(handle, 0, os.SEEK_CUR)
        os.lseek(handle, 2**30, os.SEEK_SET)
        try:
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        finally:
            os.lseek(handle, place, os.SEEK_SET)


def end_group(process: Popen[Any]) -> None:
    """End a process of a session of its own, with all that it started; elsewhere, it alone."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        if hasattr(os, "killpg"):
            os.killpg(process.pid, signal.SIGKILL)
        else:
            process.kill()


def limit_memory(size: int) -> None:
    """Let this process have ``size`` bytes of addresses for good; nothing where no such limit exists."""
    resource = _module("resource")
    if resource is not None:
        hard = resource.getrlimit(resource.RLIMIT_AS)[1]
        least = size if hard == resource.RLIM_INFINITY else min(size, hard)
        resource.setrlimit(resource.RLIMIT_AS, (least, least))


def processors() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def is_administrator() -> bool:
    """Tell whether this process may install programs for everybody."""
    return hasattr(os, "geteuid") and os.geteuid() == 0
