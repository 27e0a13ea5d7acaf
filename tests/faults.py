"""Commands whose n-th change of a folder fails, or whose process ends before it.

A library that is loaded before the C library (`faults.c`) counts every call that changes a file below one
folder: create, write, fsync, rename, unlink, mkdir, link, truncate, chmod. It is used in two ways:

    environment(root, at=3, fault=errno.EIO)    for a command of its own process, and for all that it starts
    with Runner() as runner:                    many commands, forked from a process that has imported them
        outcome = runner.run(["calibration", "list"], root=root, at=3, fault=errno.ENOSPC)

``at`` counts from 1, and 0 lets every call pass: ``Outcome.calls`` then says what there is to fail.
``fault`` is an errno or `KILL`. With ``lasting`` every later call fails too, of a full disk those that need
space. ``locks`` is an errno that flock answers with.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import hashlib
import importlib
import io
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests.remembered import share, shelves

KILL = 0
SOURCE = Path(__file__).with_suffix(".c")


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """How a command ended: ``code`` is negative for a signal; ``calls`` such as "3 rename a.json"."""

    code: int
    out: str
    err: str
    calls: tuple[str, ...]

    @property
    def answer(self) -> dict[str, Any]:
        """The JSON document that was printed."""
        document: dict[str, Any] = json.loads(self.out)
        return document


@functools.cache
def library() -> Path:
    """Return the compiled library; the test is skipped where there is no C compiler."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("the calls of the C library can only be counted by a library, and there is no C compiler")
    digest = hashlib.sha256(SOURCE.read_bytes()).hexdigest()[:16]
    target = Path(tempfile.gettempdir()) / f"toolkit-faults-{os.getuid()}-{digest}.so"
    if not target.exists():
        part = target.with_suffix(f".{os.getpid()}")
        subprocess.run([compiler, "-shared", "-fPIC", "-O2", "-o", part, SOURCE, "-ldl"], check=True)
        part.replace(target)
    return target


def environment(
    root: Path,
    *,
    at: int = 0,
    fault: int = KILL,
    lasting: bool = False,
    locks: int = 0,
    log: Path | None = None,
) -> dict[str, str]:
    """Return the environment of a process whose n-th change below ``root`` fails; ``log`` notes each call."""
    entries = {
        "LD_PRELOAD": str(library()),
        "FAULT_ROOT": str(root),
        "FAULT_AT": str(at),
        "FAULT_ERRNO": str(fault),
        "FAULT_LASTING": str(int(lasting)),
        "FAULT_FLOCK": str(locks),
    }
    return {**os.environ, **entries, **({} if log is None else {"FAULT_LOG": str(log)})}


class Runner:
    """A process that has imported the command line and forks once for each command."""

    def __enter__(self) -> Runner:
        """Start it."""
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.faults", *map(str, shelves())],
            env={**os.environ, "LD_PRELOAD": str(library())},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        return self

    def __exit__(self, *_error: object) -> None:
        """End it."""
        with self._process:  # closes its input, which ends it
            pass

    def run(
        self,
        words: Sequence[object],
        *,
        root: Path,
        at: int = 0,
        fault: int = KILL,
        lasting: bool = False,
        locks: int = 0,
        more: Mapping[str, str] | None = None,
    ) -> Outcome:
        """Run ``toolkit`` with words; ``more`` are entries of its environment."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        request = {
            "words": [str(word) for word in words], "root": str(root), "at": at, "fault": fault,
            "lasting": lasting, "locks": locks, "more": dict(more or {}),
        }  # fmt: skip
        self._process.stdin.write(json.dumps(request) + "\n")
        self._process.stdin.flush()
        answer = json.loads(self._process.stdout.readline())
        return Outcome(**{**answer, "calls": tuple(answer["calls"])})


def _serve() -> None:
    from tests.remembered_fits import remember_fits
    from toolkit.cli.main import command_tree

    command_tree()
    if folders := sys.argv[1:]:  # of a run of the tests: what is fitted is none of what fails
        remember_fits()
        share(Path(folders[0]))
    for line in sys.stdin:
        with tempfile.TemporaryDirectory() as place:
            sys.stdout.write(json.dumps(_forked(json.loads(line), Path(place))) + "\n")
        sys.stdout.flush()


def _forked(request: dict[str, Any], place: Path) -> dict[str, Any]:
    texts = [place / name for name in ("out", "err", "log", "modules")]
    for text in texts:
        text.touch()
    child = os.fork()
    if not child:
        _run(request, *texts)
    _, status = os.waitpid(child, 0)
    out, err, log, modules = (text.read_text() for text in texts)
    # What a command imports, the next one finds imported.
    for module in modules.split():
        with contextlib.suppress(Exception):
            importlib.import_module(module)
    return {"code": os.waitstatus_to_exitcode(status), "out": out, "err": err, "calls": log.splitlines()}


def _run(request: dict[str, Any], out: Path, err: Path, log: Path, modules: Path) -> None:
    from toolkit.cli.main import run

    os.environ.update(request["more"])
    before = set(sys.modules)
    for number, text in ((1, out), (2, err)):
        os.dup2(os.open(text, os.O_WRONLY | os.O_APPEND), number)
    sys.stdout, sys.stderr = io.TextIOWrapper(io.FileIO(1, "w")), io.TextIOWrapper(io.FileIO(2, "w"))
    shim = ctypes.CDLL(str(library()))
    shim.faults_without_locks(request["locks"])
    shim.faults_arm(
        request["root"].encode(), ctypes.c_long(request["at"]), request["fault"], int(request["lasting"]),
        str(log).encode(),
    )  # fmt: skip
    code = 101
    try:
        run(request["words"])
    except SystemExit as ended:
        code = ended.code if isinstance(ended.code, int) else 0
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        modules.write_text("\n".join(set(sys.modules) - before))
        os._exit(code)


if __name__ == "__main__":
    _serve()
