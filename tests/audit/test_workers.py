"""Workers survive what a file does to one of them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pytest

from tests.audit.worker_jobs import make
from toolkit.audit import workers as module
from toolkit.audit.workers import TIMEOUT_S, Lost, late, run_isolated, time_limit
from toolkit.errors import ConfigError


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
    found = dict(run_isolated(make, names, workers=1, timeout_s=lambda _: 2.0))
    assert isinstance(found["hang"], Lost)
    assert found["hang"].reason.startswith("timeout")
    assert [found[name] for name in "abc"] == ["A", "B", "C"]


def test_the_limit_of_time_is_each_files_and_is_told():
    limits = {"a": 60.0, "hang": 1.0, "b": 60.0}
    found = dict(run_isolated(make, list(limits), workers=1, timeout_s=limits.__getitem__))
    assert found["hang"] == Lost(reason=late(1.0))
    assert "within 1 s, the limit of time for a file of its size" in late(1.0)
    assert (found["a"], found["b"]) == ("A", "B")


def test_the_limit_of_time_grows_with_the_size():
    # 2 million rows of seven numbers are 120 MB; the shortest limit is that of an empty file.
    assert time_limit(0) == TIMEOUT_S
    assert time_limit(120 * 2**20) - time_limit(60 * 2**20) == time_limit(60 * 2**20) - time_limit(0) > 60


def test_a_file_whose_worker_was_killed_by_somebody_else_is_read_by_the_next(tmp_path):
    name = str(tmp_path / "innocent")
    assert dict(run_isolated(once, [name], workers=1)) == {name: name.upper()}


def test_workers_start_under_a_limit_of_memory_that_is_lower_than_theirs():
    code = (
        "import resource; resource.setrlimit(resource.RLIMIT_AS, (2 << 30, 2 << 30))\n"
        "from tests.audit.worker_jobs import make\nfrom toolkit.audit.workers import run_isolated\n"
        "if __name__ == '__main__': print(dict(run_isolated(make, ['a', 'b'], workers=1)))"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert ended.stdout.strip() == "{'a': 'A', 'b': 'B'}", ended.stderr


def test_nothing_to_do_starts_nothing():
    assert list(run_isolated(make, [], workers=2)) == []


def stillborn():
    os._exit(3)


def only_one_starts(path):
    if not _first(path):
        os._exit(3)
    return lambda name: time.sleep(0.05) or name.upper()


def test_workers_that_cannot_start_beside_one_that_works_leave_the_work_to_it(tmp_path):
    names = [f"file {i}" for i in range(60)]
    found = dict(run_isolated(partial(only_one_starts, str(tmp_path / "first")), names, workers=3))
    assert found == {name: name.upper() for name in names}


def test_workers_that_never_start_end_the_run_with_an_error():
    with pytest.raises(ConfigError) as caught:
        list(run_isolated(stillborn, ["a", "b"], workers=1))
    assert caught.value.rule == "workers"


ABANDONED = """
import os
from tests.audit.test_workers import slow
from toolkit.audit.workers import run_isolated

if __name__ == "__main__":
    next(run_isolated(slow, [str(n) for n in range(40)], workers=2))
    os._exit(9)
"""


def slow():
    return lambda name: time.sleep(0.2) or name


def test_workers_whose_run_was_killed_end_without_a_word(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(ABANDONED)
    env = {**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parents[2])}
    # The pipes close when the last worker has ended: a timeout means that one is left.
    done = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, timeout=120, env=env, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (9, "", "")


def test_no_more_processes_start_than_there_are_names(monkeypatch):
    """Each takes the memory of its libraries: `--workers 1000` over three files had started a thousand."""
    started = []
    begin = module._Worker

    def counted(**given):
        started.append(given["process"].pid)
        return begin(**given)

    monkeypatch.setattr(module, "_Worker", counted)
    assert dict(run_isolated(make, ["a", "b", "c"], workers=12)) == {"a": "A", "b": "B", "c": "C"}
    assert len(started) <= 3
