"""Jobs whose two processes are forked from one that has imported them, where each would begin anew.

A job is a runner and its command: two new interpreters, 2 s of imports. `tests/lab/desk/test_jobs.py` has
them as a laboratory's computer has. Here both are processes of their own as well, in the same groups, with
the same log, lock and environment; what other tests have fitted, reduced and drawn is remembered.
"""

from __future__ import annotations

import atexit
import contextlib
import multiprocessing
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from multiprocessing import reduction
from pathlib import Path
from types import SimpleNamespace
from typing import Any, BinaryIO

import pytest

from tests.remembered import share, shelves
from tests.remembered_fits import remember_fits
from tests.remembered_work import remembered_work
from toolkit.cli.main import run
from toolkit.lab.desk import job_runner, jobs
from toolkit.system import can_fork


@contextlib.contextmanager
def kept_runner() -> Iterator[None]:
    """Have the jobs of this process forked; nothing where a system does not fork."""
    with pytest.MonkeyPatch.context() as patch:
        if can_fork():
            patch.setattr(jobs, "subprocess", _with(_Runner))
        yield


def _with(process: type) -> SimpleNamespace:
    """Return what stands in the place of `subprocess` in a module that starts one process."""
    return SimpleNamespace(
        Popen=process, DEVNULL=subprocess.DEVNULL, STDOUT=subprocess.STDOUT,
        TimeoutExpired=subprocess.TimeoutExpired,
    )  # fmt: skip


class _Descriptor:
    """A descriptor that goes to another process with what it is given."""

    def __init__(self, number: int) -> None:
        self.number = number

    def __getstate__(self) -> dict[str, Any]:
        return {"handed": reduction.DupFd(self.number)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.number = state["handed"].detach()


class _Runner:
    """The process of a job, begun as `start_job` begins it."""

    def __init__(
        self, words: Sequence[str], *, stdout: BinaryIO, cwd: Path, pass_fds: tuple[int], **_more: object
    ) -> None:
        self._process = multiprocessing.get_context("forkserver").Process(
            target=_run_job,
            args=(words[-2], str(cwd), _Descriptor(stdout.fileno()), _Descriptor(pass_fds[0])),
            kwargs={"environment": dict(os.environ), "shelf": str(shelves()[0])},
        )
        self._process.start()
        self.wait = self._process.join


def _run_job(
    place: str, home: str, log: _Descriptor, lock: _Descriptor, *, environment: Mapping[str, str], shelf: str
) -> None:
    os.setsid()
    os.chdir(home)
    os.environ.clear()
    os.environ.update(environment)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    for number in (1, 2):
        os.dup2(log.number, number)
    share(Path(shelf))
    remember_fits()
    job_runner.subprocess = _with(_Command)  # type: ignore[attr-defined]
    with remembered_work():
        job_runner.run_job(Path(place), lock.number)


class _Command:
    """The process of a job's command, begun as `run_job` begins it."""

    def __init__(self, words: Sequence[str], *, env: Mapping[str, str], **_more: object) -> None:
        self._code: int | None = None
        self.pid = os.fork()
        if self.pid:
            with contextlib.suppress(OSError):
                os.setpgid(self.pid, self.pid)
            return
        os.setpgid(0, 0)
        os.environ.update(env)
        code = 101
        try:
            run([*words[3:]])
        except SystemExit as ended:
            code = ended.code if isinstance(ended.code, int) else 0
        finally:
            atexit._run_exitfuncs()
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(code)

    def poll(self) -> int | None:
        """Return the exit code of one that has ended."""
        if self._code is None:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            if pid:
                self._code = os.waitstatus_to_exitcode(status)
        return self._code

    def wait(self, timeout: float = 1e9) -> int:
        """Return the exit code once it has ended."""
        end = time.monotonic() + timeout
        while (code := self.poll()) is None:
            if time.monotonic() > end:
                raise subprocess.TimeoutExpired("a job's command", timeout)
            time.sleep(0.02)
        return code
