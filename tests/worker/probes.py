"""What code of others may try: handlers of a worker, each told what became of it."""

from __future__ import annotations

import ctypes
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.worker.serve import Handlers, Numbers


def attempt(act: Callable[..., Any]) -> Callable[..., str]:
    """Return a handler that tells "done", or the error of an act."""

    def handler(*arguments: Any) -> str:
        try:
            act(*arguments)
        except OSError as error:
            return f"{type(error).__name__}: {error.strerror}"
        return "done"

    return handler


def write(path: str) -> None:
    Path(path).write_text("written")


def connect(family: int, kind: int, address: Any) -> None:
    with socket.socket(family, kind) as client:
        client.connect(tuple(address) if isinstance(address, list) else address)
        client.send(b"out")


def written_in_scratch() -> str:
    with tempfile.NamedTemporaryFile() as stream:
        stream.write(b"x" * 1000)
        return str(Path(stream.name).parent)


def by_a_child(text: str) -> str:
    """Return what a child process that runs a program says."""
    return subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=False).stdout


def mount_again() -> None:
    library = ctypes.CDLL(None, use_errno=True)
    if library.mount(b"none", b"/", None, 32 | 4096, None):
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))


def limit_of(process: int) -> None:
    import resource

    resource.prlimit(process, resource.RLIMIT_NOFILE, (16, 16))


def garbage(content: bytes) -> str:
    """Write past the worker's protocol, on every descriptor that could be it."""
    for descriptor in range(3, 64):
        try:
            os.write(descriptor, content)
        except OSError:
            continue
    return "sent"


def handlers() -> Handlers:
    return {
        "add": lambda a, b: a + b,
        "double": lambda values: Numbers({"x": 2 * np.asarray(values)}),
        "read": attempt(lambda path: Path(path).read_bytes()),
        "write": attempt(write),
        "remove": attempt(os.unlink),
        "chmod": attempt(lambda path: Path(path).chmod(0o600)),
        "times": attempt(lambda path: os.utime(path, (1, 1))),
        "connect": attempt(connect),
        "signal": attempt(lambda process: os.kill(process, signal.SIGTERM)),
        "look": attempt(lambda process: os.kill(process, 0)),
        "limit": attempt(limit_of),
        "mount": attempt(mount_again),
        "scratch": written_in_scratch,
        "child": by_a_child,
        "pair": lambda: "".join(str(end.send(b"a")) for end in socket.socketpair()),
        "threads": threading.active_count,
        "pid": os.getpid,
        "memory": lambda size: len(bytearray(size)),
        "garbage": garbage,
        "raise": lambda text: exec(f"raise {text}"),  # noqa: S102
        "end": os._exit,
    }
