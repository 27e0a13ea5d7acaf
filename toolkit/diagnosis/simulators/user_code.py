"""Code of others: loaded from its file, silenced, and kept from changing the process that runs it."""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys
import types
import warnings
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import Any, TextIO, cast

import numpy as np

from toolkit.errors import ConfigError
from toolkit.files import real_path
from toolkit.inputs import CODE_FILE, read_regular
from toolkit.spelling import nearest


def load_functions(path: Path, *names: str) -> tuple[Callable[..., Any], ...]:
    """Return functions of one Python file, which is run once and may import its neighbours.

    Raises
    ------
    ConfigError
        the file raises or ends the process, or has no such function
    """
    space = types.ModuleType(f"simulator_{abs(hash(real_path(path)))}")
    space.__file__ = str(path)
    # Dataclasses and pickles look their module up by name.
    sys.modules[space.__name__] = space
    folder = str(real_path(path).parent)
    if folder not in sys.path:
        sys.path.append(folder)
    try:
        with silenced():
            exec(compile(read_regular(path, CODE_FILE), str(path), "exec"), space.__dict__)  # noqa: S102
    except (Exception, SystemExit) as error:
        raise ConfigError(
            "the simulator cannot be loaded", where=path, got=f"{type(error).__name__}: {error}",
            expected=f"a Python file with {names[0]}(..)", next_step="run the file by itself and mend it",
            rule="simulator",
        ) from error  # fmt: skip
    lines = []
    for name in names:
        function = getattr(space, name, None)
        if not callable(function):
            functions = [key for key, var in vars(space).items() if callable(var) and not key.startswith("_")]
            near = nearest(name, functions)
            raise ConfigError(
                f"the simulator has no function {name!r}", where=path,
                got=", ".join(functions) or "no functions",
                expected=f"def {name}(..)",
                next_step=f"did you mean {near!r}?" if near else "name the function in the case",
                rule="simulator",
            )  # fmt: skip
        lines.append(cast("Callable[..., Any]", function))
    return tuple(lines)


def raised(error: BaseException, **given: Collection[str]) -> str:
    """Return what a function of others raised; where it asked for a name that is not there, what is there.

    Parameters
    ----------
    given : argument of the function -> the names that it holds

    >>> raised(KeyError("sped"), p=["tau"], u=["speed", "load"])
    "KeyError: 'sped'; p has tau; u has speed, load; did you mean u['speed']?"
    >>> raised(KeyError("tau"), p=["tau"], u=[])
    "KeyError: 'tau'; p has tau; u has nothing; did you mean p['tau']?"
    >>> raised(ValueError("no oil"), p=["tau"])
    'ValueError: no oil'
    """
    text = f"{type(error).__name__}: {error}"
    name = error.args[0] if isinstance(error, KeyError) and error.args else None
    # A column of a table may be asked for as its attribute.
    if isinstance(error, AttributeError) and hasattr(error.obj, "columns"):
        name = error.name
    if not isinstance(name, str):
        return text
    parts = [f"{key} has {', '.join(names) or 'nothing'}" for key, names in given.items()]
    near = nearest(name, [known for names in given.values() for known in names])
    if near is not None:
        holder = next(key for key, names in given.items() if near in names)
        parts.append(f"did you mean {holder}[{near!r}]?")
    return "; ".join([text, *parts])


@contextlib.contextmanager
def silenced() -> Iterator[None]:
    """Keep what a simulator warns out of our own output; what it prints, `kept_apart` or its worker takes."""
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


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
