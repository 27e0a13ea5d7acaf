"""Who may write to an instrument's folder: one process at a time, by a lock or by a lock file.

The lock is taken on the folder itself and released by the system when its process ends. Some network
mounts have no locks: writers are refused there, unless they ask for a lock file. It names its process, and
another one removes it only where that process has certainly ended; a process of another computer, or of a
boot before this one, cannot be asked. A writer with the folder's lock minds a lock file too, so both kinds
keep each other out wherever the folder can be locked. Readers never wait for a lock that cannot be had.
"""

from __future__ import annotations

import contextlib
import json
import os
import socket
import time
from collections.abc import Iterator
from pathlib import Path

from toolkit.calibration.registry.clock import now
from toolkit.errors import RegistryError
from toolkit.files import sha256_bytes
from toolkit.inputs import read_regular
from toolkit.system import close_folder, has_folder_locks, is_open_at, lock_folder, open_folder

LOCK_FILE = ".lock"
PATIENCE_S = 10.0
"""How long a writer waits for a lock file to go."""
_PAUSE_S = 0.05


@contextlib.contextmanager
def reading(folder: Path) -> Iterator[bool]:
    """Keep writers out while a folder is read; yields False where that cannot be."""
    with contextlib.ExitStack() as stack:
        locked = True
        try:
            handle = open_folder(folder)
            stack.callback(close_folder, handle)
            lock_folder(handle, shared=True)
        except OSError:
            locked = False
        yield locked and not (folder / LOCK_FILE).exists()


@contextlib.contextmanager
def writing(folder: Path, *, lock_file: bool) -> Iterator[None]:
    """Keep every other writer out of a folder, and readers who can lock it.

    Raises
    ------
    RegistryError
        ``no-locks``: the file system has none, and no lock file was asked for; ``locked``: another has one
    FileNotFoundError
        the folder was removed by the writer who made it
    OSError
        the folder cannot be opened, or the lock file not be written
    """
    with contextlib.ExitStack() as stack:
        lock_file = lock_file or not has_folder_locks()
        if lock_file:
            stack.enter_context(_lock_file(folder))
        handle = open_folder(folder)
        stack.callback(close_folder, handle)
        try:
            lock_folder(handle)
        except OSError as error:
            if not lock_file:
                raise _without_locks(folder, error) from error
        if not is_open_at(handle, folder):
            raise FileNotFoundError(folder)
        if not lock_file:
            _wait(folder / LOCK_FILE)
        yield


@contextlib.contextmanager
def _lock_file(folder: Path) -> Iterator[None]:
    path, holder = folder / LOCK_FILE, _this_process()
    until = time.monotonic() + PATIENCE_S
    while True:
        try:
            handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
            break
        except FileExistsError:
            _wait(path, until)
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(holder)
            stream.flush()
            os.fsync(stream.fileno())
        yield
    finally:
        # One that cannot be removed is removed by the next writer: this process will have ended.
        with contextlib.suppress(OSError):
            if read_regular(path) in (holder, b""):
                path.unlink()


def _wait(path: Path, until: float | None = None) -> None:
    """Wait until a lock file is gone; one whose process has ended is removed."""
    until = time.monotonic() + PATIENCE_S if until is None else until
    while (holder := content(path)) is not None:
        if _ended(holder):
            _remove(path, holder)
        elif time.monotonic() > until:
            raise RegistryError(
                "another process writes to this registry",
                where=path,
                got=_holder_text(holder),
                expected="no lock file, or one whose process has ended",
                next_step="wait for it; where that process has certainly ended, remove the lock file; "
                "nothing was changed",
                rule="locked",
            )
        else:
            time.sleep(_PAUSE_S)


def _remove(path: Path, holder: bytes) -> None:
    # Two who both saw that a process has ended must not remove the lock file of the first of them. Both are
    # processes of this computer, where a name in the abstract namespace belongs to one until it ends.
    folder = path.parent.stat()
    name = sha256_bytes(f"{folder.st_dev} {folder.st_ino}".encode())
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as alone:
        try:
            alone.bind(f"\0toolkit-lock-{name}")
        except OSError:
            time.sleep(_PAUSE_S)
            return
        if content(path) == holder:
            path.unlink()


def _this_process() -> bytes:
    host = {"host": socket.gethostname(), "boot": _boot(), "processes": _processes()}
    body = {**host, "pid": os.getpid(), "started": _started(os.getpid()), "time": now()}
    return json.dumps(body).encode()


def _ended(holder: bytes) -> bool:
    """Tell whether the process of a lock file has certainly ended."""
    try:
        body = json.loads(holder)
        pid, started = int(body["pid"]), body["started"]
        names = (_boot(), _processes())
        if None in (started, *names) or (body["boot"], body["processes"]) != names:
            return False
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    except PermissionError:
        pass
    except (ValueError, KeyError, TypeError, OverflowError):
        return False  # still being written, or by another hand
    current = _started(pid)
    return current is not None and current != started


def _started(pid: int) -> str | None:
    """Return when a process started, in ticks since the boot; "ended" for one that nobody has waited for."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return None
    return "ended" if fields[0] in ("Z", "X") else fields[19]


def _boot() -> str | None:
    """Return the name of this boot; None where the system names none."""
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text().strip()
    except OSError:
        return None


def _processes() -> str | None:
    """Return the name of this process's table of processes: a container has one of its own."""
    try:
        return os.readlink("/proc/self/ns/pid")  # noqa: PTH115
    except OSError:
        return None


def _holder_text(holder: bytes) -> str:
    try:
        body = json.loads(holder)
        return f"a lock file of process {body['pid']} on {body['host']}, since {body['time']}"
    except (ValueError, KeyError, TypeError):
        return "a lock file that names no process"


def _without_locks(folder: Path, error: OSError) -> RegistryError:
    return RegistryError(
        "the registry's file system has no locks",
        where=folder,
        got=error.strerror or str(error),
        expected="a file system on which a folder can be locked (flock)",
        next_step="repeat the command with --lock-file, as everybody who writes to this registry must; "
        "nothing was changed",
        rule="no-locks",
    )


def content(path: Path) -> bytes | None:
    """Return a file's content, None where there is none."""
    try:
        return read_regular(path)
    except FileNotFoundError:
        return None
