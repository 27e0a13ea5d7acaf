"""A dask cluster on loopback: the answer of the workers here, and nothing lost where a worker dies."""

from __future__ import annotations

import contextlib
import datetime as dt
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import distributed
import pytest
from archive_made import FY, dated, recording, write
from typer.testing import CliRunner

from toolkit import __version__
from toolkit.audit import archive as archive_module
from toolkit.audit.archive import audit_archive
from toolkit.audit.cluster import run_on_cluster
from toolkit.audit.workers import Lost
from toolkit.calibration.registry.registry import Registry
from toolkit.cli.main import _register, app
from toolkit.errors import ConfigError

HOME = Path(__file__).resolve().parents[2]
REGISTRY = Registry(HOME / "calibrations")
KNOWN = dt.date(2026, 1, 1)
PATIENCE_S = 300  # a loaded machine starts slowly


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


class Cluster:
    """A scheduler and its workers as an operator starts them: processes of their own, with nannies."""

    def __init__(self, folder):
        self.folder, self.started = folder, []
        self.address = f"tcp://127.0.0.1:{free_port()}"
        port = self.address.rpartition(":")[2]
        self._run("dask_scheduler", "--host", "127.0.0.1", "--port", port, "--no-dashboard")

    def add_worker(self):
        place = ("--local-directory", str(self.folder))
        self._run("dask_worker", self.address, "--nthreads", "1", "--no-dashboard", *place)

    def wait_for(self, workers):
        deadline = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline:
            with (
                contextlib.suppress(OSError),
                distributed.Client(self.address, set_as_default=False, timeout=PATIENCE_S) as client,
            ):
                if workers:
                    client.wait_for_workers(workers, timeout=PATIENCE_S)
                return self.address
        raise AssertionError("the cluster did not start")

    def end(self):
        for process in reversed(self.started):
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()

    def _run(self, name, *words):
        settings = {
            "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0",
            "DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": f"{PATIENCE_S}s",
            "PYTHONPATH": str(Path(__file__).parent),
        }
        with (self.folder / "log").open("ab") as log:
            self.started.append(
                subprocess.Popen(
                    [sys.executable, "-m", f"distributed.cli.{name}", *words],
                    env={**os.environ, **settings}, stdout=log, stderr=log, start_new_session=True,
                )
            )  # fmt: skip


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    made = Cluster(tmp_path_factory.mktemp("dask"))
    try:
        yield made
    finally:
        made.end()


@pytest.fixture(scope="module")
def one(cluster):
    cluster.add_worker()
    return cluster.wait_for(1)


@pytest.fixture(scope="module")
def two(cluster, one):
    cluster.add_worker()
    return cluster.wait_for(2)


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    root = tmp_path_factory.mktemp("cluster") / "archive"
    dated(root / "test", "2019-06-01")
    for number in range(40):
        own = FY if number % 3 else (*FY[:2], -FY[2], FY[3])
        write(root / "test" / f"{number:02d}.xlsx", recording(seed=number, FY=own))
    write(root / "undated.xlsx", recording(seed=90))
    (root / "cut.xlsx").write_bytes(b"PK\x03\x04 and no more")
    (root / "own.json").write_text('{"generator": "toolkit"}')
    return root


def lines(folder):
    """What an audit keeps of each file, in the order of their names."""
    kept = [json.loads(line) for line in (folder / "results.jsonl").read_text().splitlines()[1:]]
    return sorted(kept, key=lambda line: line["path"])


@pytest.fixture(scope="module")
def here(archive, tmp_path_factory):
    """The answer of two workers here, and what they keep."""
    out = tmp_path_factory.mktemp("here")
    made = audit_archive(archive, REGISTRY, known_at=KNOWN, workers=2, out=out)
    kept = lines(out)
    assert len(kept) == 43
    return made, kept


def make():
    return work


def work(name):
    if name.startswith("die"):
        os.kill(os.getpid(), signal.SIGKILL)
    if name.startswith("hang"):
        time.sleep(60)
    if name.startswith("slow"):
        time.sleep(0.2)
    return f"{name} by {os.getpid()}" if name.startswith("who") else name.upper()


def refusing():
    raise ConfigError("no", where="here", got="a", expected="b", next_step="c", rule="cluster")


def test_something_that_is_no_scheduler_answers(monkeypatch):
    monkeypatch.setattr("toolkit.audit.cluster.CONNECT_S", 1.0)
    with socket.create_server(("127.0.0.1", 0)) as other:
        address = f"tcp://127.0.0.1:{other.getsockname()[1]}"
        assert refused(lambda: list(run_on_cluster(make, ["a"], address=address))).rule == "cluster"


def test_a_cluster_without_workers(cluster):
    cluster.wait_for(0)
    error = refused(lambda: list(run_on_cluster(make, ["a"], address=cluster.address, empty_s=1.0)))
    assert error.rule == "cluster"
    assert "no worker" in error.got


def test_one_worker_of_a_cluster_gives_the_lines_of_the_workers_here(archive, here, tmp_path, one):
    there = audit_archive(archive, REGISTRY, known_at=KNOWN, scheduler=one, out=tmp_path)
    assert lines(tmp_path) == here[1]
    assert there == here[0]


def test_what_a_worker_refuses_ends_the_run(one):
    assert refused(lambda: list(run_on_cluster(refusing, ["a"], address=one))).what == "no"


def test_two_workers_of_a_cluster_give_the_same_lines(archive, here, tmp_path, two):
    there = audit_archive(archive, REGISTRY, known_at=KNOWN, scheduler=two, out=tmp_path)
    assert lines(tmp_path) == here[1]
    assert there == here[0]


def test_a_run_here_goes_on_from_what_a_cluster_did(archive, tmp_path, two, monkeypatch):
    first = audit_archive(archive, REGISTRY, known_at=KNOWN, scheduler=two, out=tmp_path / "out")
    monkeypatch.setattr(archive_module, "run_isolated", lambda *_, **__: iter([]))
    again = audit_archive(archive, REGISTRY, known_at=KNOWN, out=tmp_path / "out")
    assert again == first
    assert again.reused == 43


def test_the_work_is_done_by_the_workers_of_the_cluster(two):
    done = [
        result for _, result in run_on_cluster(make, [f"who {n}" for n in range(30)], address=two, batch=1)
    ]
    people = {text.rpartition(" ")[2] for text in done}
    assert len(people) == 2
    assert str(os.getpid()) not in people


def test_only_the_file_that_kills_its_worker_is_lost(two):
    names = [f"file {n}" for n in range(40)]
    names[7], names[30] = "die 1", "die 2"
    found = dict(run_on_cluster(make, names, address=two, batch=8, empty_s=PATIENCE_S))
    assert sorted(found) == sorted(names)
    assert {name for name, result in found.items() if isinstance(result, Lost)} == {"die 1", "die 2"}
    assert found["die 1"].reason.startswith("worker-died")
    assert all(result == name.upper() for name, result in found.items() if not isinstance(result, Lost))


def test_a_worker_that_somebody_kills_in_mid_run_loses_nothing(two):
    names = [f"slow {n}" for n in range(40)]
    with distributed.Client(two, set_as_default=False) as client:
        client.wait_for_workers(2, timeout=PATIENCE_S)
        victim = next(iter(client.run(os.getpid).values()))
    threading.Timer(0.7, os.kill, (victim, signal.SIGKILL)).start()
    found = dict(run_on_cluster(make, names, address=two, batch=4, empty_s=PATIENCE_S))
    assert found == {name: name.upper() for name in names}


def test_a_file_that_hangs_is_given_up_and_the_others_go_on(two):
    found = dict(
        run_on_cluster(make, ["a", "hang", "b"], address=two, batch=3, timeout_s=8.0, empty_s=PATIENCE_S)
    )
    assert isinstance(found["hang"], Lost)
    assert found["hang"].reason == "timeout: no answer within 8 s"
    assert (found["a"], found["b"]) == ("A", "B")


def test_nothing_to_do_asks_nobody():
    assert list(run_on_cluster(make, [], address="tcp://127.0.0.1:1")) == []


def refused(action):
    with pytest.raises(ConfigError) as caught:
        action()
    error = caught.value
    assert error.where
    assert error.got
    assert error.expected
    assert error.next_step
    return error


@pytest.mark.parametrize(
    "address", ["tcp://127.0.0.1:{port}", "nonsense://x:1", "tcp://", "tcp://127.0.0.1:not-a-port"]
)
def test_a_scheduler_that_cannot_be_reached(address, monkeypatch):
    monkeypatch.setattr("toolkit.audit.cluster.CONNECT_S", 1.0)
    where = address.format(port=free_port())
    error = refused(lambda: list(run_on_cluster(make, ["a"], address=where)))
    assert error.rule == "cluster"
    assert where in error.where


def test_workers_with_another_registry_or_archive_are_refused(archive):
    for wrong in ({"digest": "0" * 64}, {"version": "0.0"}, {"archive": archive / "nowhere"}):
        given = {
            "archive": archive,
            "registry": REGISTRY,
            "day": KNOWN,
            "digest": "of another",
            "version": __version__,
        } | wrong
        error = refused(lambda given=given: archive_module._same(**given))
        assert error.rule == "cluster"


def test_an_absent_library_is_named_with_its_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    error = refused(lambda: list(run_on_cluster(make, ["a"], address="tcp://127.0.0.1:1")))
    assert error.rule == "missing-extra"
    assert error.next_step == 'pip install "toolkit[cluster]"'


def test_the_command_takes_workers_here_or_those_of_a_cluster(archive, two):
    def run(*words):
        _register()
        home = ("--calibrations", str(HOME / "calibrations"), "--known-at", "2026-01-01", "--json")
        return CliRunner().invoke(app, ["audit", str(archive), *home, *words], standalone_mode=False)

    there, here = (json.loads(run(*words).stdout) for words in (("--scheduler", two), ("--workers", "2")))
    for answer in (there, here):
        del answer["timing"]
    assert there == here
    assert run("--scheduler", two, "--workers", "2").return_value != 0
