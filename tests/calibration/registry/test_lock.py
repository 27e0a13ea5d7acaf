"""Where a file system has no locks: writers are refused or take a lock file, and readers go on."""

from __future__ import annotations

import errno
import fcntl
import json
import multiprocessing
import os
import subprocess
import sys
from collections.abc import Callable
from datetime import date
from pathlib import Path
from typing import Any

import pytest

from tests.calibration.calibration_factory import hub_data
from toolkit.calibration.registry import lock
from toolkit.calibration.registry.approval import approve
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.lock import LOCK_FILE
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.verify import verify_registry
from toolkit.errors import RegistryError

FORK = multiprocessing.get_context("fork")
DAY = date(2026, 2, 1)


def without_locks(monkeypatch: pytest.MonkeyPatch, number: int = errno.ENOLCK) -> None:
    def refuse(_handle: int, _operation: int) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(fcntl, "flock", refuse)


def decide(registry: Registry) -> bool:
    return approve(registry, "hub-r1", in_force_from=DAY, checked_by="B").done


def lock_of(**entries: Any) -> str:
    """Return a lock file of this process, with entries of another."""
    return json.dumps({**json.loads(lock._this_process()), **entries})


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lock, "PATIENCE_S", 0.1)


@pytest.mark.parametrize("number", [errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL])
def test_writers_are_refused_and_readers_go_on(
    registry: Registry, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    without_locks(monkeypatch, number)
    before = registry.digest("hub")
    with pytest.raises(RegistryError) as caught:
        decide(registry)
    error = caught.value
    assert (error.rule, error.got) == ("no-locks", os.strerror(number))
    assert "--lock-file" in (error.next_step or "")
    assert registry.digest("hub") == before
    assert [row.ok for row in verify_registry(registry)] == [True]
    assert registry.status("hub-r1").state == "candidate"


def test_a_lock_file_lets_a_writer_write_and_goes(
    registry: Registry, monkeypatch: pytest.MonkeyPatch
) -> None:
    without_locks(monkeypatch)
    assert decide(Registry(registry.folder, lock_file=True))
    assert registry.status("hub-r1").state == "approved"
    assert not (registry.folder / "hub" / LOCK_FILE).exists()
    assert [row.ok for row in verify_registry(registry)] == [True]


def _enter(path: Path, folder: Path) -> None:
    def refuse(_handle: int, _operation: int) -> None:
        raise OSError(errno.ENOLCK, "")

    fcntl.flock = refuse
    calibrate(path, Registry(folder, lock_file=True))


def test_writers_with_lock_files_lose_nothing(tmp_path: Path, make_session: Callable[..., Path]) -> None:
    sessions = [make_session(hub_data(40, 10 + i), name=f"s{i}") for i in range(3)]
    writers = [FORK.Process(target=_enter, args=(path, tmp_path / "cal")) for path in sessions]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join()
    assert [writer.exitcode for writer in writers] == [0] * 3
    registry = Registry(tmp_path / "cal")
    assert registry.ids("hub") == ("hub-r1", "hub-r2", "hub-r3")
    assert all(row.ok for row in verify_registry(registry))


@pytest.mark.parametrize("lock_file", [True, False])
@pytest.mark.parametrize(
    "entries",
    [{}, {"boot": "another"}, {"processes": "pid:[1]"}, {"started": None}, {"pid": "no number"}],
    ids=["runs", "another boot", "another container", "no start", "damaged"],
)
@pytest.mark.usefixtures("impatient")
def test_who_may_still_write_keeps_others_out(
    registry: Registry, lock_file: bool, entries: dict[str, Any]
) -> None:
    path = registry.folder / "hub" / LOCK_FILE
    path.write_text(lock_of(**entries))
    with pytest.raises(RegistryError) as caught:
        decide(Registry(registry.folder, lock_file=lock_file))
    assert (caught.value.rule, caught.value.where) == ("locked", str(path))
    assert path.exists()
    # Who only reads need not wait, and finds no stray file.
    assert [row.ok for row in verify_registry(registry)] == [True]


@pytest.mark.parametrize("lock_file", [True, False])
@pytest.mark.parametrize("ended", ["gone", "other"])
def test_a_lock_file_whose_process_has_ended_is_removed(
    registry: Registry, lock_file: bool, ended: str
) -> None:
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    # The number of a process that has ended may be that of another by now, which started at another time.
    entries = {"pid": process.pid} if ended == "gone" else {"started": "1"}
    path = registry.folder / "hub" / LOCK_FILE
    path.write_text(lock_of(**entries))
    assert decide(Registry(registry.folder, lock_file=lock_file))
    assert not path.exists()


@pytest.mark.usefixtures("impatient")
def test_a_lock_file_that_names_nobody_is_told(registry: Registry) -> None:
    (registry.folder / "hub" / LOCK_FILE).touch()
    with pytest.raises(RegistryError) as caught:
        decide(registry)
    assert caught.value.got == "a lock file that names no process"
