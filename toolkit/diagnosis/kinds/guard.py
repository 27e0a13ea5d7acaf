"""What a simulator of others may do to the process that runs it: nothing that outlives its run."""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def kept_apart() -> Iterator[None]:
    """Keep our standard output and the working folder as they are while simulators run.

    A simulator may print past ``sys.stdout``: a compiled library, a child process. One line of it would make
    the one JSON document of a command unreadable, so that the descriptor itself leads nowhere meanwhile. A
    simulator that changes the folder would send every relative path of ours somewhere else.
    """
    folder = _here()
    try:
        with contextlib.ExitStack() as stack:
            nowhere = stack.enter_context(Path(os.devnull).open("w", encoding="utf-8"))
            stack.enter_context(_led_to(nowhere.fileno()))
            stack.enter_context(contextlib.redirect_stdout(nowhere))
            yield
    finally:
        if folder is not None and _here() != folder:
            os.chdir(folder)


@contextlib.contextmanager
def _led_to(descriptor: int) -> Iterator[None]:
    """Lead descriptor 1 to another one; nothing where the process has no standard output."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        sys.stdout.flush()
    try:
        before = os.dup(1)
    except OSError:
        yield
        return
    try:
        os.dup2(descriptor, 1)
        yield
    finally:
        # What a compiled library printed still stands in C's own buffer.
        with contextlib.suppress(OSError, AttributeError):
            ctypes.CDLL(None).fflush(None)
        os.dup2(before, 1)
        os.close(before)


def _here() -> Path | None:
    try:
        return Path.cwd()
    except FileNotFoundError:
        return None
