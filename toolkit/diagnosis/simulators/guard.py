"""What a simulator of others may do to the process that runs it: nothing that outlives its run."""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO


@contextlib.contextmanager
def kept_apart() -> Iterator[None]:
    """Keep our standard input and output and the working folder as they are while simulators run.

    A simulator may print past ``sys.stdout``: a compiled library, a child process. One line of it would make
    the one JSON document of a command unreadable, so that the descriptor itself leads nowhere meanwhile. A
    simulator that changes the folder would send every relative path of ours somewhere else. One that asks
    for input is told that there is none: it would wait for ever, or eat what was meant for another.
    """
    folder = _here()
    try:
        with contextlib.ExitStack() as stack:
            nowhere = stack.enter_context(Path(os.devnull).open("w", encoding="utf-8"))
            nothing = stack.enter_context(Path(os.devnull).open(encoding="utf-8"))
            stack.enter_context(_fed_from(nothing))
            stack.enter_context(_led_to(nowhere.fileno()))
            stack.enter_context(contextlib.redirect_stdout(nowhere))
            yield
    finally:
        if folder is not None and _here() != folder:
            os.chdir(folder)


@contextlib.contextmanager
def _fed_from(nothing: TextIO) -> Iterator[None]:
    """Feed descriptor 0 and ``sys.stdin`` from another file; only the latter without standard input."""
    stream = sys.stdin
    try:
        before = os.dup(0)
    except OSError:
        before = None
    try:
        if before is not None:
            os.dup2(nothing.fileno(), 0)
        sys.stdin = nothing
        yield
    finally:
        sys.stdin = stream
        if before is not None:
            os.dup2(before, 0)
            os.close(before)


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
