"""Workers survive what a file does to one of them."""

from __future__ import annotations

import os
import signal
import time

import pytest

from toolkit.audit.workers import Lost, run_isolated
from toolkit.errors import ConfigError


def make():
    return work


def work(name):
    if name.startswith("die"):
        os.kill(os.getpid(), signal.SIGKILL)
    if name.startswith("hang"):
        time.sleep(60)
    return name.upper()


def once():
    return lambda name: os.kill(os.getpid(), signal.SIGKILL) if _first(name) else name.upper()


def _first(name):
    # True the first time that any process is asked for a name that is a path.
    try:
        os.close(os.open(name, os.O_CREAT | os.O_EXCL))
    except FileExistsError:
        return False
    return True


@pytest.mark.parametrize(("workers", "second"), [(1, 8), (2, 30)])
def test_only_the_file_that_kills_its_worker_is_lost(workers, second):
    names = [f"file {i}" for i in range(40)]
    names[7], names[second] = "die 1", "die 2"
    found = dict(run_isolated(make, names, workers=workers))
    assert sorted(found) == sorted(names)
    lost = {name for name, result in found.items() if isinstance(result, Lost)}
    assert lost == {"die 1", "die 2"}
    assert all(result == name.upper() for name, result in found.items() if name not in lost)


def test_a_file_that_hangs_is_given_up_and_the_others_go_on():
    names = ["a", "hang", "b", "c"]
    found = dict(run_isolated(make, names, workers=1, timeout_s=2.0))
    assert isinstance(found["hang"], Lost)
    assert found["hang"].reason.startswith("timeout")
    assert [found[name] for name in "abc"] == ["A", "B", "C"]


def test_a_file_whose_worker_was_killed_by_somebody_else_is_read_by_the_next(tmp_path):
    name = str(tmp_path / "innocent")
    assert dict(run_isolated(once, [name], workers=1)) == {name: name.upper()}


def test_nothing_to_do_starts_nothing():
    assert list(run_isolated(make, [], workers=2)) == []


def stillborn():
    os._exit(3)


def test_workers_that_never_start_end_the_run_with_an_error():
    with pytest.raises(ConfigError) as caught:
        list(run_isolated(stillborn, ["a", "b"], workers=1))
    assert caught.value.rule == "workers"
