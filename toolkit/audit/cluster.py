"""Workers of a dask.distributed cluster, for archives that one machine would read for days.

Files travel by name, in batches; what the workers read and answer is what a worker here would. A file that
ends its worker ends the batch with it: the worker's nanny starts another, and the names of that batch are
given out one at a time, with nothing else at work, so that only the one that is to blame is set aside. The
memory of a worker is limited by its nanny.
"""

from __future__ import annotations

import asyncio
import gc
import os
import socket
import threading
import time
import uuid
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import urlsplit

from toolkit.audit.workers import DIED, TIMEOUT_S, Lost, late, under_limits
from toolkit.errors import ConfigError
from toolkit.inputs import raised_to
from toolkit.recording.extras import needed

# The scheduler of a cluster: whether one answers at an address, and with which certificates.


CONNECT_S = 10.0
_SECTION = "distributed.comm.tls"
_NEEDED = (("tls_ca_file", "ca-file"), ("tls_client_cert", "client.cert"))
_FILES = (*_NEEDED, ("tls_client_key", "client.key"))  # the key may stand in the certificate's file
_GREETING = 0.8  # of the time to connect: its own words say more than that the time is over


def security_of(distributed: Any, address: str) -> Any:
    """Return dask's security settings for an address, as its configuration has them.

    Raises
    ------
    ConfigError
        ``cluster``: ``tls://``, and the configuration lacks a certificate or names one that cannot be used
    """
    try:
        security = distributed.Security()
        if address.startswith("tls:"):
            _check_files(security, address)
        security.get_connection_args("client")
    except (OSError, ValueError) as error:  # an SSLError is an OSError
        raise trouble(
            address,
            f"certificates that cannot be used: {error}",
            f"{_SECTION} in dask's configuration: PEM files of ca-file, client.cert, client.key",
            "correct the files or the configuration; 'dask config list' shows it",
        ) from error
    return security


def _check_files(security: Any, address: str) -> None:
    lacking = [f"{_SECTION}.{key}" for field, key in _NEEDED if not getattr(security, field)]
    lack = f"dask's configuration without {' and '.join(lacking)}"
    if not lacking:
        files = [(key, str(getattr(security, field) or "")) for field, key in _FILES]
        absent = [f"{key} {text}" for key, text in files if text and "\n" not in text and not _there(text)]
        if not absent:
            return
        lack = f"no such file: {', '.join(absent)}"
    raise trouble(
        address,
        lack,
        "for tls://, the certificate authority and the client's certificate and key in dask's configuration",
        f"name {_SECTION}.ca-file, .client.cert and .client.key in ~/.config/dask/distributed.yaml, or set "
        "DASK_DISTRIBUTED__COMM__TLS__CA_FILE, ..__CLIENT__CERT and ..__CLIENT__KEY",
    )


def _there(text: str) -> bool:
    return Path(text).is_file()


def unreachable(distributed: Any, address: str, security: Any) -> str | None:
    """Return why no scheduler answers at an address, None where one does.

    A client asks whoever is there, and would wait for an answer without end.
    """
    try:
        parts = urlsplit(address)
        host, port = parts.hostname, parts.port
        if parts.scheme not in ("tcp", "tls") or not host or port is None:
            return f"{address!r}, which is no address of a scheduler"
        socket.create_connection((host, port), timeout=CONNECT_S).close()
        asyncio.run(asyncio.wait_for(_greeted(distributed, address, security), CONNECT_S))
    except TimeoutError:
        return f"no answer within {CONNECT_S:g} s"
    except (OSError, ValueError, RuntimeError) as error:
        cause = error.__cause__
        return f"{error}" + (f" ({cause})" if cause is not None and str(cause) not in str(error) else "")
    return None


async def _greeted(distributed: Any, address: str, security: Any) -> None:
    words = security.get_connection_args("client")
    comm = await distributed.core.connect(address, timeout=_GREETING * CONNECT_S, **words)
    await comm.close()


def trouble(address: str, actual: str, expected: str, next_step: str) -> ConfigError:
    """Return the error of a cluster that cannot be used."""
    return ConfigError(
        "the cluster cannot be used", where=f"--scheduler {address}", got=actual, expected=expected,
        next_step=next_step, rule="cluster",
    )  # fmt: skip


Result = TypeVar("Result")

BATCH = 16
_TRIES = 3  # of a file whose results are lost with a worker that had done it
EMPTY_S = 60.0  # without any worker, for so long a cluster is waited for
_GRACE_S = 30.0  # for a new worker to import what it needs
_AHEAD = 4  # batches a thread of the cluster has waiting
_TICK_S = 1.0
_made = threading.local()


def run_on_cluster(
    make: Callable[[], Callable[[str], Result]],
    names: Sequence[str],
    *,
    address: str,
    timeout_s: Callable[[str], float] = lambda _: TIMEOUT_S,
    batch: int = BATCH,
    empty_s: float = EMPTY_S,
) -> Iterator[tuple[str, Result | Lost]]:
    """Yield (name, result) of every name, in the order in which they are done.

    Parameters
    ----------
    make : called once in each thread of a worker, returns what is called with each name; both must pickle
    names : what there is to do
    address : of the scheduler, ``tcp://host:8786``; ``tls://``: see `toolkit.audit.scheduler`
    timeout_s : of each name; its worker is ended beyond, for its nanny to start again
    batch : names a task
    empty_s : how long a cluster without workers is waited for

    Raises
    ------
    ConfigError
        ``missing-extra``; ``cluster``: the scheduler cannot be reached or goes away, it has no workers, or
        they do not have this toolkit, or a certificate is lacking; and what ``make`` raises
    """
    distributed: Any = needed("distributed", extra="cluster", to="use a cluster", where=address)
    if not names:
        return
    client = _client(distributed, address)
    make = partial(under_limits, raised_to(), make)
    try:
        doubtful: list[str] = []
        yield from _batches(client, distributed, make, names, doubtful, timeout_s, batch, empty_s, address)
        for name in doubtful:
            yield name, _alone(client, distributed, make, name, timeout_s(name), empty_s, address)
    finally:
        client.close(timeout=CONNECT_S)


def _client(distributed: Any, address: str) -> Any:
    security = security_of(distributed, address)
    why = unreachable(distributed, address, security)
    if why is None:
        try:
            return distributed.Client(
                address, timeout=CONNECT_S, set_as_default=False, name="toolkit-audit", security=security
            )
        except (OSError, ValueError, TypeError) as error:
            why = str(error) or type(error).__name__
        gc.collect()  # a client that failed, found later while another one starts, would wait for it for ever
    raise trouble(
        address,
        why[:300],
        "a scheduler at an address such as tcp://host:8786, or tls:// with dask's own certificates",
        "start it with 'dask scheduler', and workers with 'dask worker ADDRESS'",
    )


def _batches(
    client: Any,
    distributed: Any,
    make: Callable[[], Callable[[str], Result]],
    names: Sequence[str],
    doubtful: list[str],
    timeout_s: Callable[[str], float],
    batch: int,
    empty_s: float,
    address: str,
) -> Iterator[tuple[str, Result | Lost]]:
    token = uuid.uuid4().hex
    todo = (names[i : i + batch] for i in range(0, len(names), batch))
    flying: dict[Any, Sequence[str]] = {}
    last_worker = time.monotonic()  # when there was a worker
    while True:
        threads = _threads(client, address)
        if threads:
            last_worker = time.monotonic()
        elif time.monotonic() - last_worker > empty_s:
            raise _no_workers(address, empty_s)
        for part in islice(todo, max(_AHEAD * max(threads, 1) - len(flying), 0)):
            limits = [timeout_s(name) for name in part]
            task = client.submit(_several, make, tuple(part), token, limits, pure=False, retries=0)
            flying[task] = part
        if not flying:
            return
        ready = _wait(client, distributed, list(flying))
        for task in ready:
            part = flying.pop(task)
            try:
                answer = _result(distributed, task, address)
            except _LostResultError:
                answer = None
            if answer is None:
                doubtful.extend(part)
            else:
                yield from zip(part, answer, strict=True)
            task.release()


def _alone(
    client: Any,
    distributed: Any,
    make: Callable[[], Callable[[str], Result]],
    name: str,
    timeout_s: float,
    empty_s: float,
    address: str,
    tries: int = _TRIES,
) -> Result | Lost:
    token = uuid.uuid4().hex
    task = client.submit(_several, make, (name,), token, [timeout_s], pure=False, retries=0)
    began = last_worker = time.monotonic()
    started = False
    try:
        while not _wait(client, distributed, [task]):
            now = time.monotonic()
            if _threads(client, address):
                last_worker = now
            elif now - last_worker > empty_s:
                raise _no_workers(address, empty_s)
            if not started and any(client.processing().values()):
                started = True
            elif not started:
                began = now  # a little before it starts
            if started and now - began > timeout_s + _GRACE_S:
                return Lost(reason=late(timeout_s))
        try:
            answer = _result(distributed, task, address)
        except _LostResultError:
            # It was done, and the worker that held it is no more: by what, nothing tells the first time.
            if tries <= 1:
                return Lost(reason=DIED)
            return _alone(client, distributed, make, name, timeout_s, empty_s, address, tries - 1)
        if answer is not None:
            result: Result = answer[0]
            return result
        # The worker ends itself where the time is up.
        over = started and time.monotonic() - began >= timeout_s
        return Lost(reason=late(timeout_s) if over else DIED)
    finally:
        task.cancel(force=True)


def _wait(client: Any, distributed: Any, tasks: list[Any]) -> list[Any]:
    # By hand: an iterator over what is done would wait for ever where no worker is left.
    try:
        with client.as_current():
            return list(distributed.wait(tasks, timeout=_TICK_S, return_when="FIRST_COMPLETED").done)
    except TimeoutError:
        return []


def _result(distributed: Any, task: Any, address: str) -> list[Any] | None:
    """Return the results of a task; None where its worker died of it.

    Raises
    ------
    ConfigError
        the scheduler is gone, or a worker has another installation
    _LostResultError
        the scheduler is there, but whoever held the results is not
    """
    if task.status in ("cancelled", "lost"):
        raise _lost(distributed, address)
    try:
        answers: list[Any] = task.result(timeout=CONNECT_S)
    except distributed.KilledWorker:
        return None
    except (ImportError, AttributeError) as error:
        raise trouble(
            address,
            f"a worker has not this toolkit: {error}",
            "the same installation on every worker",
            "install the toolkit for the workers, in the version that runs here",
        ) from error
    except (OSError, TimeoutError) as error:
        raise _lost(distributed, address) from error
    return answers


class _LostResultError(Exception):
    """Results are gone with the worker that held them."""


def _lost(distributed: Any, address: str) -> Exception:
    trouble = unreachable(distributed, address, security_of(distributed, address))
    return _LostResultError() if trouble is None else _lost_scheduler(address)


def _threads(client: Any, address: str) -> int:
    try:
        return sum(client.nthreads().values())
    except (OSError, TimeoutError) as error:
        raise _lost_scheduler(address) from error


def _several(
    make: Callable[[], Callable[[str], Result]], names: tuple[str, ...], token: str, limits: Sequence[float]
) -> list[Result]:
    """Do some names in a worker's thread, whose state is made once a run."""
    if getattr(_made, "token", None) != token:
        _made.work, _made.token = make(), token
    return [_timed(_made.work, name, limit) for name, limit in zip(names, limits, strict=True)]


def _timed(work: Callable[[str], Result], name: str, timeout_s: float) -> Result:
    # A thread cannot be ended from outside: the worker is, and its nanny starts another.
    watch = threading.Timer(timeout_s, os._exit, (3,))
    watch.daemon = True
    watch.start()
    try:
        return work(name)
    finally:
        watch.cancel()


def _lost_scheduler(address: str) -> ConfigError:
    return trouble(
        address,
        "the connection was lost",
        "a scheduler that is there until the audit ends",
        "start it again and repeat the command; with --out what is done is used again",
    )


def _no_workers(address: str, seconds: float) -> ConfigError:
    return trouble(
        address,
        f"no worker for {seconds:g} s",
        "workers, with nannies that start them again",
        f"start some with 'dask worker {address}'; with --out what is done is used again",
    )
