"""Walls hold: what is tried from inside of an isolated worker is refused, and reading goes on."""

from __future__ import annotations

import contextlib
import os
import socket
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.worker.probes import handlers
from toolkit.errors import ConfigError
from toolkit.worker import posix, walls
from toolkit.worker.posix import Limits
from toolkit.worker.worker import Worker

ISOLATED = Limits(memory_bytes=1 << 32, processes=16, scratch_bytes=1 << 20, isolated=True)


@contextlib.contextmanager
def worker(limits: Limits = ISOLATED) -> Iterator[Worker]:
    inside = Worker(handlers, (), limits, time.monotonic() + 60)
    try:
        yield inside
    finally:
        inside.close()


def ask(inside: Worker, name: str, *arguments: object) -> str:
    return str(inside.value(name, arguments, time.monotonic() + 60))


@pytest.fixture(params=["namespaces", "landlock"])
def inside(request, monkeypatch) -> Iterator[Worker]:
    """An isolated worker, by name spaces and by Landlock alone: a forked guardian has what is replaced."""
    if request.param == "landlock":
        monkeypatch.setattr(walls, "_can_enter", lambda *_: False)
        monkeypatch.setattr(posix, "_has_threads", lambda: False)
    with worker() as made:
        yield made


def test_the_kernel_here_has_walls():
    # Everything below rests on it: a system without either has a test of its own.
    assert walls.landlock_version() >= 6


def test_nothing_is_written_outside_and_everything_is_read(inside, tmp_path):
    file = tmp_path / "file.txt"
    file.write_text("as it was")
    before = file.stat()
    assert ask(inside, "read", str(file)) == "done"
    tries = [("write", file), ("write", tmp_path / "new"), ("remove", file), ("chmod", file), ("times", file)]
    tries += [("write", Path("/dev/shm") / "probe"), ("write", Path("/proc/self/oom_score_adj"))]  # noqa: S108
    for name, path in tries:
        assert "Error" in ask(inside, name, str(path)), (name, path)
    assert file.read_text() == "as it was"
    assert (file.stat().st_mode, file.stat().st_mtime) == (before.st_mode, before.st_mtime)
    assert [path.name for path in tmp_path.iterdir()] == ["file.txt"]
    assert ask(inside, "write", "/dev/null") == "done"


def test_the_temporary_folder_is_its_own_and_goes_with_it(inside):
    folder = ask(inside, "scratch")
    assert folder.startswith("/")
    assert Path(folder).is_dir()
    inside.close()
    assert not Path(folder).exists()


@pytest.mark.parametrize("kind", [socket.SOCK_STREAM, socket.SOCK_DGRAM])
@pytest.mark.parametrize("family", [socket.AF_INET, socket.AF_INET6, socket.AF_UNIX])
def test_no_socket_leads_out(inside, tmp_path, family, kind):
    address: object = {socket.AF_INET: ("127.0.0.1", 0), socket.AF_INET6: ("::1", 0)}.get(
        family, str(tmp_path / "socket")
    )
    with socket.socket(family, kind) as listener:
        listener.bind(address)
        if kind == socket.SOCK_STREAM:
            listener.listen()
        listener.settimeout(0.0)
        there = listener.getsockname()
        told = ask(inside, "connect", int(family), int(kind), list(there)[:2] if family != 1 else there)
        assert "PermissionError" in told
        with pytest.raises(BlockingIOError):
            listener.accept() if kind == socket.SOCK_STREAM else listener.recv(10)


def test_no_abstract_socket_leads_out(inside):
    name = f"\0toolkit-{os.getpid()}"
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(name)
        listener.listen()
        assert "PermissionError" in ask(inside, "connect", int(socket.AF_UNIX), 1, name)


def test_no_signal_leads_out(inside):
    bystander = subprocess.Popen(["sleep", "60"])
    try:
        for process in (os.getpid(), bystander.pid):
            assert "Error" in ask(inside, "look", process)
            assert "Error" in ask(inside, "limit", process)
        assert "Error" in ask(inside, "signal", bystander.pid)
        assert bystander.poll() is None
    finally:
        bystander.kill()
        bystander.wait()


def test_what_the_code_starts_stands_within_the_same_walls(inside, tmp_path):
    text = f"""
import socket
for act in (lambda: socket.socket(), lambda: open({str(tmp_path / "new")!r}, "w")):
    try:
        act(); print("done")
    except OSError as error:
        print(type(error).__name__)
"""
    assert set(ask(inside, "child", text).split()) <= {"PermissionError", "OSError"}
    assert not (tmp_path / "new").exists()
    assert "Error" in ask(inside, "mount")
    assert ask(inside, "pair") == "11"  # two ends that both lie inside


def test_without_isolation_the_code_may_do_what_its_user_may(tmp_path):
    with worker(Limits(memory_bytes=1 << 32, processes=16, scratch_bytes=0)) as free:
        assert ask(free, "write", str(tmp_path / "new")) == "done"
        assert ask(free, "look", os.getpid()) == "done"


def test_a_kernel_without_either_is_told_and_nothing_runs(tmp_path, monkeypatch):
    monkeypatch.setattr(walls, "_can_enter", lambda *_: False)
    monkeypatch.setattr(walls, "landlock_version", lambda: 5)
    monkeypatch.setattr(posix, "_has_threads", lambda: False)
    with pytest.raises(ConfigError) as refused, worker():
        pytest.fail("it ran")
    assert refused.value.rule == "no-isolation"
    assert "Landlock 5" in str(refused.value.got)


def test_a_wall_that_does_not_hold_is_told_and_nothing_runs(monkeypatch):
    monkeypatch.setattr(walls, "_can_enter", lambda *_: False)
    monkeypatch.setattr(walls, "_filter_calls", lambda *_: None)
    monkeypatch.setattr(posix, "_has_threads", lambda: False)
    with pytest.raises(ConfigError, match="cannot be isolated") as refused, worker():
        pytest.fail("it ran")
    assert "socket" in str(refused.value.got)


def test_a_new_interpreter_stands_within_the_same_walls(tmp_path, monkeypatch):
    monkeypatch.setattr(posix, "_has_threads", lambda: True)
    with worker() as other:
        assert "Error" in ask(other, "write", str(tmp_path / "new"))
        assert ask(other, "read", __file__) == "done"
