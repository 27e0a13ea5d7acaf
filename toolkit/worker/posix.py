"""Processes as Linux has them: a guardian, the worker it begets, their limits, and the end of all of them.

The guardian is a subreaper: whatever the worker's code starts, in whatever session, comes back to it, and is
ended with the worker. It holds none of the tool's descriptors, and the kernel signals it when the tool dies.
"""

from __future__ import annotations

import contextlib
import gc
import io
import json
import math
import os
import select
import signal
import sys
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import NoReturn

from toolkit.errors import ConfigError, ToolkitError
from toolkit.system import THREADS, can_fork
from toolkit.worker.walls import Walls, libc

with contextlib.suppress(ModuleNotFoundError):  # another system: `begin` refuses there
    import fcntl
    import resource

_ALLOCATORS = frozenset({"jemalloc_bg_thd"})  # Arrow's, which pandas loads: jemalloc is ready for forks
_PDEATHSIG, _SUBREAPER = 1, 36  # of prctl(2)
_LOOK_S = 0.05  # between two counts of the worker's processes: a bomb of Python has some dozens by then
_URGENT = -10  # of nice(2): where that is allowed, the guardian is not kept from its work by a bomb
_UNSEEN = 16  # times the allowed processes that the kernel stops at: what forks faster than it is counted
_FIRST = 10  # descriptors below are given to the guardian: ours must not stand in their place
_PATIENCE_S = 60.0  # for a guardian to end many processes: without it, they would stay
SOCKET, OUTPUT, STATUS = 3, 4, 5


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What a worker may use.

    memory_bytes : address space of each process, beyond what it has when the code begins
    processes : that come of the worker at once, itself among them
    isolated : without network, signals and writing but in a temporary folder of ``scratch_bytes``
    """

    memory_bytes: int
    processes: int
    scratch_bytes: int
    isolated: bool = False

    def numbers(self) -> tuple[int, ...]:
        """Return the limits as numbers, as they cross to a new interpreter."""
        return tuple(int(getattr(self, field.name)) for field in fields(self))


def begin(limits: Limits, ends: tuple[int, int, int], scratch: str) -> int:
    """Return the id of a new guardian, which holds three descriptors: socket, output, status.

    A process of one thread is forked: everything is loaded already. One of several may hold a lock at that
    moment, which nobody would ever open in the child: a new interpreter begins there. A thread of the memory
    allocator's own does not count.

    Raises
    ------
    ConfigError
        ``no-isolation``: the system cannot keep a process and all that it starts within limits
    """
    if not can_fork():
        raise ConfigError(
            "this system cannot run code of others within limits",
            where="the simulator's process", got=sys.platform, expected="Linux: forks, sessions, a guardian",
            next_step="run it in a container or on a Linux computer; a notebook may take it into its own "
            "process (in_process=True)", rule="no-isolation",
        )  # fmt: skip
    high = [fcntl.fcntl(end, fcntl.F_DUPFD_CLOEXEC, _FIRST) for end in ends]
    try:
        if _has_threads() and sys.executable:
            return _executed(limits, high, scratch)
        parent = os.getpid()
        with warnings.catch_warnings():  # from Python 3.12 on, of any thread
            warnings.simplefilter("ignore", DeprecationWarning)
            child = os.fork()
        if child == 0:
            _guarded(limits, high, scratch, parent)
        return child
    finally:
        for end in high:
            os.close(end)


def _has_threads() -> bool:
    return len(threads()) > 1


def threads() -> frozenset[str]:
    """Return the ids of this process' threads, without those that no fork has to fear."""
    return frozenset(
        task.name for task in Path("/proc/self/task").iterdir() if _name(task) not in _ALLOCATORS
    )


def _name(task: Path) -> str:
    try:
        with (task / "comm").open(errors="replace") as stream:
            return stream.read().strip()
    except OSError:  # it has ended meanwhile
        return ""


def _executed(limits: Limits, high: list[int], scratch: str) -> int:
    text = (
        f"import sys; sys.path[:] = {sys.path!r}; from toolkit.worker.posix import main; "
        f"main({limits.numbers()!r}, {scratch!r}, {os.getpid()})"
    )
    places = [(os.POSIX_SPAWN_DUP2, end, at) for end, at in zip(high, (SOCKET, OUTPUT, STATUS), strict=True)]
    environment = {**dict.fromkeys(THREADS, "1"), **os.environ}
    return os.posix_spawn(sys.executable, [sys.executable, "-c", text], environment, file_actions=places)


def main(numbers: tuple[int, ...], scratch: str, parent: int) -> NoReturn:
    """Become the guardian in a new interpreter."""
    memory, processes, space, isolated = numbers
    limits = Limits(
        memory_bytes=memory, processes=processes, scratch_bytes=space, isolated=bool(isolated)
    )  # fmt: skip
    _guarded(limits, [SOCKET, OUTPUT, STATUS], scratch, parent)


def _guarded(limits: Limits, ends: list[int], scratch: str, parent: int) -> NoReturn:
    """Be the guardian; never return into what the parent was doing."""
    status = ends[2]
    try:
        gc.freeze()  # looking through the parent's objects would copy every page of its memory
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM, signal.SIGCHLD})
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGALRM, signal.SIGCHLD):
            signal.signal(number, signal.SIG_DFL)
        os.setsid()
        _close_others(ends)
        die_with_parent(signal.SIGTERM)
        if os.getppid() != parent:
            os._exit(0)
        _guard(limits, ends, scratch)
    except ToolkitError as error:
        _say(status, {"refused": [error.what, error.as_dict()]})
    except BaseException as error:  # noqa: BLE001  nothing of the parent's may go on in here
        _say(status, {"failed": f"{type(error).__name__}: {error}"})
    finally:
        os._exit(1)


def _guard(limits: Limits, ends: list[int], scratch: str) -> None:
    walls = Walls.around(scratch, limits.scratch_bytes) if limits.isolated else None
    if walls is not None and walls.namespaces:
        # The first process of a name space of processes: with its end the kernel ends all others.
        child = os.fork()
        if child:
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM, signal.SIGCHLD})
            die_with_parent(signal.SIGKILL)
            os.close(ends[2])
            os.waitpid(child, 0)
            os._exit(0)
        die_with_parent(signal.SIGKILL)
        walls.see_own_processes()
    libc().prctl(_SUBREAPER, 1, 0, 0, 0)
    worker = os.fork()
    if worker == 0:
        os.setpgid(0, 0)
        _be_worker(limits, ends, None if walls is None else walls.close)
    with contextlib.suppress(OSError):
        os.setpgid(worker, worker)
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, 0, _URGENT)
    os.close(ends[0])
    os.close(ends[1])
    ended, reason = _watched(worker, limits.processes)
    for pid, code in _end_all(worker):
        ended = code if pid == worker else ended
    _say(ends[2], {"status": ended, "reason": reason})


def lower_limit(kind: int, limit: int) -> None:
    """Set a limit of this process for good, unless it has a lower one already."""
    hard = resource.getrlimit(kind)[1]
    least = limit if hard == resource.RLIM_INFINITY else min(limit, hard)
    resource.setrlimit(kind, (least, least))


def _be_worker(limits: Limits, ends: list[int], wall: Callable[[], None] | None) -> NoReturn:
    from toolkit.worker.serve import serve

    try:
        die_with_parent(signal.SIGKILL)
        os.close(ends[2])
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM, signal.SIGCHLD})
        _own_streams(ends[1])
        for kind, limit in (
            (resource.RLIMIT_AS, _address_space() + limits.memory_bytes),
            (resource.RLIMIT_CORE, 0),
            (resource.RLIMIT_NPROC, _threads_of_user() + _UNSEEN * limits.processes),
        ):
            lower_limit(kind, limit)
        serve(ends[0], wall)
    finally:
        os._exit(1)


def _own_streams(output: int) -> None:
    """Lead standard output and error into the pipe, unbuffered: a process that dies loses nothing."""
    import faulthandler

    os.dup2(output, 1)
    os.dup2(output, 2)
    os.close(output)
    sys.stdin = io.TextIOWrapper(io.FileIO(0, closefd=False))
    for stream, name in ((1, "stdout"), (2, "stderr")):
        raw = io.FileIO(stream, "w", closefd=False)
        text = io.TextIOWrapper(raw, "utf-8", "replace", write_through=True)
        setattr(sys, name, text)
    faulthandler.enable(2, all_threads=False)


def _close_others(ends: list[int]) -> None:
    """Lead every other descriptor nowhere: what stays open here would keep a pipe of the tool's from ending.

    A descriptor that was closed would be given out again, and then closed by the object that had it before.
    """
    nowhere = os.open(os.devnull, os.O_RDWR)
    for name in os.listdir("/proc/self/fd"):  # noqa: PTH208
        if int(name) not in (*ends, nowhere):
            with contextlib.suppress(OSError):
                os.fstat(int(name))
                os.dup2(nowhere, int(name), inheritable=int(name) < SOCKET)
    for stream in range(3):
        os.dup2(nowhere, stream)


def _watched(worker: int, most: int) -> tuple[int | None, str]:
    """Wait for the worker's end; return its status, and why it was ended: "" where it ended by itself."""
    while True:
        came = signal.sigtimedwait({signal.SIGTERM, signal.SIGCHLD}, _LOOK_S)
        for pid, status in _reaped():
            if pid == worker:
                return status, ""
        if came is not None and came.si_signo == signal.SIGTERM:
            return None, ""
        if len(_descendants(most)) > most:
            return None, f"more than {most} processes at once"


def _reaped() -> Iterator[tuple[int, int]]:
    with contextlib.suppress(ChildProcessError):
        while (pair := os.waitpid(-1, os.WNOHANG))[0]:
            yield pair


def _end_all(worker: int) -> Iterator[tuple[int, int]]:
    """End every process that came of this one, and give what becomes of each.

    A group gets a signal as one, and none of it can beget another meanwhile: the worker's first, then those
    that processes of it have begun.
    """
    groups = {worker}
    while groups:
        for group in groups:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(group, signal.SIGKILL)
        yield from _reaped()
        groups = set()
        for pid in _descendants():
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.kill(pid, signal.SIGKILL)
                groups.add(os.getpgid(pid))
        groups.discard(os.getpgrp())  # nothing keeps a process from joining the guardian's own
        if groups:
            signal.sigtimedwait({signal.SIGCHLD}, _LOOK_S)


def _descendants(most: float = math.inf) -> set[int]:
    """Return the processes that came of this one; no more are looked for beyond ``most``."""
    listed: set[int] = set()
    parents = ["self"]
    while parents and len(listed) <= most:
        folder = f"/proc/{parents.pop()}/task"
        children: list[str] = []
        with contextlib.suppress(OSError):
            for task in os.listdir(folder):  # noqa: PTH208
                with open(f"{folder}/{task}/children", encoding="ascii") as stream:  # noqa: PTH123
                    children += stream.read().split()
        fresh = [pid for pid in children if int(pid) not in listed]
        listed.update(map(int, fresh))
        parents += fresh
    return listed


def _threads_of_user() -> int:
    """Return how many threads this user has: the kernel counts them all against a limit."""
    count, user = 0, os.getuid()
    with os.scandir("/proc") as entries:
        for entry in entries:
            with contextlib.suppress(OSError):
                if entry.name.isdigit() and entry.stat().st_uid == user:
                    count += os.stat(f"{entry.path}/task").st_nlink - 2  # noqa: PTH116
    return count


def _address_space() -> int:
    with open("/proc/self/statm", encoding="ascii") as stream:  # noqa: PTH123
        return int(stream.read().split()[0]) * resource.getpagesize()


def die_with_parent(number: signal.Signals) -> None:
    """Have the kernel send this process a signal when its parent dies."""
    libc().prctl(_PDEATHSIG, int(number), 0, 0, 0)


def _say(status: int, content: dict[str, object]) -> None:
    with contextlib.suppress(OSError):
        os.write(status, json.dumps(content).encode())


def finish(pid: int) -> None:
    """End a guardian with all that came of it, and wait for that."""
    with contextlib.suppress(ProcessLookupError, ChildProcessError):
        handle = os.pidfd_open(pid)
        try:
            for number in (signal.SIGTERM, signal.SIGCONT):  # it may have been stopped
                os.kill(pid, number)
            if not select.select([handle], [], [], _PATIENCE_S)[0]:
                os.kill(pid, signal.SIGKILL)
        finally:
            os.close(handle)
        os.waitpid(pid, 0)


def end_of(status: int) -> str:
    """Return how a process ended, for people."""
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        name = signal.Signals(number).name if number in list(signal.Signals) else "a signal"
        return f"killed by signal {number} ({name})"
    return f"ended with exit code {os.waitstatus_to_exitcode(status)}"
