"""The calls by which a process changes a disk, counted; the n-th kills the process or fails.

In this process and without a compiler: the functions of `os` are replaced, and a kill is one of a forked
child, so that neither ``finally`` nor ``atexit`` runs, as after SIGKILL. What is written through a stream of
Python is seen at its fsync and rename.
"""

from __future__ import annotations

import ctypes
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any
from unittest import mock

CALLS = ("fsync", "mkdir", "rename", "replace", "rmdir", "unlink", "chmod", "chown")
_CREATES = os.O_CREAT | os.O_TRUNC


class Count:
    """Counts calls; ``at`` the n-th of them, from 1, ``act`` is called in its place."""

    def __init__(self, at: int = 0, act: Callable[[], None] = lambda: None) -> None:
        self.at, self.act, self.calls = at, act, 0

    def __call__(self) -> None:
        self.calls += 1
        if self.calls == self.at:
            self.act()


@contextmanager
def counted(count: Count) -> Iterator[Count]:
    """Let every call that changes a disk pass through a count."""

    def through(real: Callable[..., Any]) -> Callable[..., Any]:
        def call(*args: Any, **kwargs: Any) -> Any:
            count()
            return real(*args, **kwargs)

        return call

    def opened(path: Any, flags: int, *args: Any, **kwargs: Any) -> int:
        if flags & _CREATES:
            count()
        return _open(path, flags, *args, **kwargs)

    class Library:
        def __init__(self, *args: Any, **kwargs: Any) -> None:
            with suppress(AttributeError):
                self.renameat2 = _exchange(_library(*args, **kwargs), count)

    _open, _library = os.open, ctypes.CDLL
    others = {name: through(getattr(os, name)) for name in CALLS}
    with mock.patch.multiple(os, open=opened, **others), mock.patch.object(ctypes, "CDLL", Library):
        yield count


def _exchange(library: Any, count: Count) -> Callable[..., int]:
    real = library.renameat2

    def call(*args: Any) -> int:
        try:
            count()
        except OSError as error:
            ctypes.set_errno(error.errno or 0)
            return -1
        return int(real(*args))

    return call


def killed(work: Callable[[], object], at: int) -> bool:
    """Run work in a child that is killed at its n-th call; tell whether it came so far."""
    child = os.fork()
    if child == 0:
        with suppress(BaseException), counted(Count(at, lambda: os.kill(os.getpid(), signal.SIGKILL))):
            work()
        os._exit(0)
    return os.WIFSIGNALED(os.waitpid(child, 0)[1])


def failing(at: int, number: int) -> Count:
    """Return a count whose n-th call fails with an error of the disk."""

    def fail() -> None:
        raise OSError(number, os.strerror(number))

    return Count(at, fail)


def contents(folder: Path) -> dict[str, bytes]:
    """Return every file below a folder with its bytes, hidden ones too."""
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}
