"""Workers that a file cannot take down with it.

A reader may abort its whole process on a hostile file, hang, or ask for all the memory there is; a pool
that loses a worker that way loses what the others hold. Here every worker is a process with a memory limit
and a pipe of its own, and has one file at a time: where it dies or takes too long, that file alone is told,
a new worker takes its place and the others go on.
"""

from __future__ import annotations

import contextlib
import gc
import multiprocessing as mp
import os
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from typing import Generic, TypeVar

from toolkit.errors import ConfigError
from toolkit.inputs import raise_limits, raised_to
from toolkit.system import THREADS

Result = TypeVar("Result")

TIMEOUT_S = 120.0
_BYTES_PER_S = 2**19  # a slow machine under load reads and judges as much
DIED = "worker-died: the reader's process ended without an answer"
MEMORY_BYTES = 4 << 30
_TRIES = 3
_CYCLES = 20_000  # new objects until they are looked through
_AHEAD = 16  # files in a worker's pipe: it never waits for the next one


@dataclass(frozen=True, slots=True, kw_only=True)
class Lost:
    """A file whose worker died (``worker-died``) or took too long (``timeout``)."""

    reason: str


def time_limit(size: int) -> float:
    """Return how long a file of so many bytes may take [s].

    >>> time_limit(0), time_limit(256 * 2**20)
    (120.0, 632.0)
    """
    return TIMEOUT_S + size / _BYTES_PER_S


def late(limit_s: float) -> str:
    """Return why a file has no answer whose worker was ended at its limit of time."""
    return (
        f"timeout: no answer within {limit_s:.3g} s, the limit of time for a file of its size; whether it is "
        "sound was not found out"
    )


@dataclass(slots=True, kw_only=True, eq=False)
class _Worker(Generic[Result]):
    process: SpawnProcess
    pipe: Connection
    waiting: deque[str]
    since: float
    ready: bool = False


def run_isolated(
    make: Callable[[], Callable[[str], Result]],
    names: Sequence[str],
    *,
    workers: int = 1,
    timeout_s: Callable[[str], float] = lambda _: TIMEOUT_S,
) -> Iterator[tuple[str, Result | Lost]]:
    """Yield (name, result) of every name, in the order in which they are done.

    Parameters
    ----------
    make : called once in each worker, returns what is called with each name; both must pickle
    names : what there is to do
    workers : processes, no more than there are names
    timeout_s : of each name; its worker is killed beyond

    Raises
    ------
    ConfigError
        ``workers``: three processes in a row ended before they were ready, and no other one works

    A name whose worker died is given to a fresh worker, alone, once more: where several were in its pipe,
    the dead one is the first, but a machine that ran short of memory may have killed the wrong one.
    """
    context = mp.get_context("spawn")
    make = partial(under_limits, raised_to(), make)
    todo = deque(names)
    doubtful: set[str] = set()
    stillborn = 0  # workers that ended before they were ready, one after the other
    limit = workers
    pool: list[_Worker[Result]] = []

    def start() -> _Worker[Result]:
        ours, theirs = context.Pipe()
        process = context.Process(target=_serve, args=(make, theirs), daemon=True)
        with _one_thread():
            process.start()
        theirs.close()
        return _Worker(process=process, pipe=ours, waiting=deque(), since=time.monotonic())

    def feed(worker: _Worker[Result]) -> None:
        while worker.ready and todo and len(worker.waiting) < _AHEAD:
            if todo[0] in doubtful and worker.waiting:
                return  # a suspect runs alone
            name = todo.popleft()
            try:
                worker.pipe.send(name)
            except OSError:
                todo.appendleft(name)
                return
            if not worker.waiting:
                worker.since = time.monotonic()
            worker.waiting.append(name)
            if name in doubtful:
                return

    def bury(worker: _Worker[Result], reason: str) -> Lost | None:
        worker.process.kill()
        worker.process.join()
        worker.pipe.close()
        pool.remove(worker)
        if not worker.waiting:
            return None
        suspect = worker.waiting[0]
        todo.extendleft(reversed(worker.waiting))
        if suspect in doubtful or reason.startswith("timeout"):
            todo.popleft()
            return Lost(reason=reason)
        doubtful.add(suspect)
        return None

    try:
        while todo or any(worker.waiting for worker in pool):
            # One for each name that is read or waits for it: an idle process costs what a busy one does.
            while len(pool) < min(limit, len(todo) + sum(bool(worker.waiting) for worker in pool)):
                pool.append(start())
            for worker in pool:
                feed(worker)
            busy = [worker for worker in pool if worker.waiting or not worker.ready]
            ready = set(wait([worker.pipe for worker in busy], timeout=1.0))
            for worker in busy:
                if worker.pipe in ready:
                    try:
                        result = worker.pipe.recv()
                    except (EOFError, OSError):
                        if not worker.ready:
                            bury(worker, "")
                            stillborn += 1
                            if stillborn == _TRIES and not any(living.ready for living in pool):
                                raise _no_workers() from None
                            if stillborn == _TRIES:
                                limit, stillborn = len(pool), 0  # those that live go on alone
                            continue
                        name = worker.waiting[0]
                        lost = bury(worker, DIED)
                        if lost is not None:
                            yield name, lost
                        continue
                    worker.since = time.monotonic()
                    if not worker.ready:
                        worker.ready, stillborn, limit = True, 0, workers
                        continue
                    yield worker.waiting.popleft(), result
                elif worker.waiting and time.monotonic() - worker.since > timeout_s(worker.waiting[0]):
                    name = worker.waiting[0]
                    lost = bury(worker, late(timeout_s(name)))
                    if lost is not None:
                        yield name, lost
    finally:
        for worker in pool:
            worker.process.kill()
            worker.process.join()
            worker.pipe.close()


def under_limits(raised: int, make: Callable[[], Callable[[str], Result]]) -> Callable[[str], Result]:
    """Make a worker's function where inputs are read up to what they are read to at home."""
    raise_limits(raised)
    return make()


@contextlib.contextmanager
def _one_thread() -> Iterator[None]:
    # Each worker is one core's work: libraries that start threads of their own would only get in its way.
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update(dict.fromkeys(THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _no_workers() -> ConfigError:
    return ConfigError(
        "the workers cannot start",
        where="--workers",
        got=f"{_TRIES} processes, one after the other, that ended before their first file",
        expected="processes that start; their own messages stand above",
        next_step="free memory, and guard a script that calls this with 'if __name__ == \"__main__\"'",
        rule="workers",
    )


def _serve(make: Callable[[], Callable[[str], Result]], pipe: Connection) -> None:
    import signal

    from toolkit.system import limit_memory

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent is interrupted, and ends its workers
    limit_memory(MEMORY_BYTES)
    work = make()
    # What is there now stays, and a file leaves hardly any cycles that would have to be looked for.
    gc.freeze()
    gc.set_threshold(_CYCLES)
    answer: object = None  # ready
    while True:
        try:
            pipe.send(answer)
            name = pipe.recv()
        except (EOFError, OSError):
            return  # nobody waits for an answer any more
        answer = work(name)
