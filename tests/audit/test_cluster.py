"""A dask cluster on loopback: the answer of the workers here, and nothing lost where a worker dies.

One scheduler and one pair of workers, started as an operator starts them, serve all the tests of this file;
those that kill workers come last. What is waited for is an event, never a time.
"""

from __future__ import annotations

import contextlib
import datetime as dt
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import dask
import distributed
import pytest
from distributed import utils

from tests import commands
from tests.audit.archive_made import FY, dated, recording, write
from tests.audit.worker_jobs import make
from toolkit import __version__
from toolkit.audit import archive as archive_module
from toolkit.audit import cluster as cluster_module
from toolkit.audit.archive import audit_archive
from toolkit.audit.cluster import run_on_cluster
from toolkit.audit.workers import DIED, Lost, late
from toolkit.calibration.registry.registry import Registry
from toolkit.errors import ConfigError

HOME = Path(__file__).resolve().parents[2]
REGISTRY = Registry(HOME / "calibrations")
KNOWN = dt.date(2026, 1, 1)
PATIENCE_S = 300  # a loaded machine starts slowly
FILES = 23


@pytest.fixture(scope="module", autouse=True)
def dask_without_its_thread():
    """End dask's thread of large messages with these tests: beside it every later worker would begin anew."""
    yield
    utils._offload_executor.shutdown()
    utils._offload_executor = ThreadPoolExecutor(max_workers=1, thread_name_prefix="Dask-Offload")


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

    def add_workers(self, count):
        place = ("--local-directory", str(self.folder))
        self._run(
            "dask_worker", self.address, "--nworkers", str(count), "--nthreads", "1", "--no-dashboard", *place
        )

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
            "PYTHONPATH": str(HOME),
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
    """The address while the cluster has one worker."""
    cluster.add_workers(1)
    return cluster.wait_for(1)


@pytest.fixture(scope="module")
def there_by_one(archive, one, tmp_path_factory):
    out = tmp_path_factory.mktemp("by one")
    return audit_command(archive, out, "--scheduler", one), out


@pytest.fixture(scope="module")
def two(cluster, there_by_one):
    """The address with two workers, once the one alone has done its part."""
    cluster.add_workers(1)
    return cluster.wait_for(2)


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    root = tmp_path_factory.mktemp("cluster") / "archive"
    dated(root / "test", "2019-06-01")
    for number in range(FILES - 3):
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


def audit_command(archive, out, *words):
    """The answer of the command, but for where it was written and how long it took."""
    home = ("--calibrations", str(HOME / "calibrations"), "--known-at", "2026-01-01", "--json")
    answer = json.loads(commands.result("audit", archive, *home, "--out", out, *words).stdout)
    del answer["timing"], answer["written"]
    return answer


@pytest.fixture(scope="module")
def there(archive, two, tmp_path_factory):
    """The command's answer by two workers of the cluster, and the folder of what they told."""
    out = tmp_path_factory.mktemp("there")
    return audit_command(archive, out, "--scheduler", two), out


def refusing():
    raise ConfigError("no", where="here", got="a", expected="b", next_step="c", rule="cluster")


def test_a_cluster_without_workers(cluster):
    cluster.wait_for(0)
    error = refused(lambda: list(run_on_cluster(make, ["a"], address=cluster.address, empty_s=0.5)))
    assert error.rule == "cluster"
    assert "no worker" in error.got


def test_a_cluster_answers_as_the_workers_here_do(archive, there, tmp_path):
    answer, out = there
    assert audit_command(archive, tmp_path, "--workers", "2") == answer
    assert len(lines(out)) == FILES
    assert lines(tmp_path) == lines(out)
    assert (tmp_path / "audit.jsonl").read_bytes() == (out / "audit.jsonl").read_bytes()


def test_one_worker_of_a_cluster_answers_as_two_do(there_by_one, there):
    (answer, out), (answer_of_two, out_of_two) = there_by_one, there
    assert answer == answer_of_two
    assert lines(out) == lines(out_of_two)
    assert (out / "audit.jsonl").read_bytes() == (out_of_two / "audit.jsonl").read_bytes()


def test_a_run_here_goes_on_from_what_a_cluster_did(archive, there, monkeypatch):
    answer, out = there
    monkeypatch.setattr(archive_module, "run_isolated", lambda *_, **__: iter([]))
    again = audit_archive(archive, REGISTRY, known_at=KNOWN, out=out)
    assert again.reused == FILES
    assert [one.sha256 for one in again.files] == [one["sha256"] for one in answer["files"]]


def test_what_a_worker_refuses_ends_the_run(two):
    assert refused(lambda: list(run_on_cluster(refusing, ["a"], address=two))).what == "no"


def test_a_worker_that_somebody_kills_in_mid_run_loses_nothing(two):
    names = [f"who {n}" for n in range(30)]
    found = {}
    for name, process in run_on_cluster(make, names, address=two, batch=2, empty_s=PATIENCE_S):
        if not found:
            os.kill(process, signal.SIGKILL)  # the one that answered first, results of its next tasks with it
        found[name] = process
    assert sorted(found) == sorted(names)
    assert all(isinstance(process, int) for process in found.values())
    assert len(set(found.values())) > 1
    assert os.getpid() not in found.values()


def test_only_the_files_that_end_or_block_their_workers_are_lost(two):
    names = [f"file {n}" for n in range(12)]
    names[3], names[9] = "die", "hang"
    found = dict(
        run_on_cluster(make, names, address=two, batch=4, timeout_s=lambda _: 2.0, empty_s=PATIENCE_S)
    )
    lost = {name: result.reason for name, result in found.items() if isinstance(result, Lost)}
    assert lost == {"die": DIED, "hang": late(2.0)}
    assert sorted(found) == sorted(names)
    assert all(result == name.upper() for name, result in found.items() if name not in lost)


def test_a_file_whose_results_are_lost_time_after_time_is_set_aside(monkeypatch):
    given = []
    task = SimpleNamespace(cancel=lambda **_: None)
    client = SimpleNamespace(submit=lambda *given_, **_: given.append(given_[2]) or task)

    def lost(*_):
        raise cluster_module._LostResultError

    monkeypatch.setattr(cluster_module, "_wait", lambda *_: [task])
    monkeypatch.setattr(cluster_module, "_result", lost)
    result = cluster_module._alone(client, distributed, make, "a", 1.0, 1.0, "tcp://127.0.0.1:1")
    assert result == Lost(reason=DIED)
    assert given == [("a",)] * 3


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


def test_something_that_is_no_scheduler_answers(monkeypatch):
    monkeypatch.setattr("toolkit.audit.cluster.CONNECT_S", 0.3)
    with socket.create_server(("127.0.0.1", 0)) as other:
        address = f"tcp://127.0.0.1:{other.getsockname()[1]}"
        assert refused(lambda: list(run_on_cluster(make, ["a"], address=address))).rule == "cluster"


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
    assert error.next_step == 'pip install "tire-lab-toolkit[cluster]"'


def test_workers_are_here_or_of_a_cluster(archive):
    done = commands.said("audit", archive, "--scheduler", "tcp://127.0.0.1:1", "--workers", "2")
    assert done.code == 2
    assert "--scheduler" in done.err


def tls(**files):
    return dask.config.set({f"distributed.comm.tls.{key}": text for key, text in files.items()})


def test_a_secured_scheduler_needs_the_certificates_of_dask_s_configuration():
    with tls(**{"ca-file": None, "client.cert": None}):
        error = refused(lambda: list(run_on_cluster(make, ["a"], address="tls://127.0.0.1:1")))
    assert error.rule == "cluster"
    assert "distributed.comm.tls.ca-file and distributed.comm.tls.client.cert" in error.got
    assert "DASK_DISTRIBUTED__COMM__TLS__CA_FILE" in error.next_step


def test_a_certificate_that_is_not_there_is_named(tmp_path):
    absent, empty = tmp_path / "absent.pem", tmp_path / "empty.pem"
    empty.write_text("")
    with tls(**{"ca-file": str(absent), "client.cert": str(empty)}):
        error = refused(lambda: list(run_on_cluster(make, ["a"], address="tls://127.0.0.1:1")))
    assert error.got == f"no such file: ca-file {absent}"
    with tls(**{"ca-file": str(empty), "client.cert": str(empty)}):
        error = refused(lambda: list(run_on_cluster(make, ["a"], address="tls://127.0.0.1:1")))
    assert error.got.startswith("certificates that cannot be used")


@pytest.mark.campaign(
    "two more processes of a cluster: one without certificates answers, dies and loses files in every run"
)
@pytest.mark.skipif(shutil.which("openssl") is None, reason="openssl makes the certificates of this test")
def test_a_cluster_behind_certificates(tmp_path):
    ours, other = certificate(tmp_path, "ours"), certificate(tmp_path, "other")
    security = distributed.Security(
        tls_ca_file=ours["ca-file"], require_encryption=True,
        **{f"tls_{role}_{kind}": ours[f"client.{kind}"] for role in ("scheduler", "worker", "client")
           for kind in ("cert", "key")},
    )  # fmt: skip
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, protocol="tls", security=security,
        dashboard_address=":0", host="127.0.0.1",
    ) as secured:  # fmt: skip
        address = secured.scheduler_address
        with tls(**ours):
            assert dict(run_on_cluster(make, ["a", "b"], address=address)) == {"a": "A", "b": "B"}
        with tls(**other):
            error = refused(lambda: list(run_on_cluster(make, ["a"], address=address)))
        assert error.rule == "cluster"
        assert "CERTIFICATE_VERIFY_FAILED" in error.got


def certificate(folder, name):
    """A certificate that vouches for itself, and its key, as dask's configuration names them."""
    key, cert = folder / f"{name}.key", folder / f"{name}.pem"
    subprocess.run(
        ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes",
         "-keyout", str(key), "-out", str(cert), "-days", "2", "-subj", f"/CN={name}"],
        check=True, capture_output=True,
    )  # fmt: skip
    return {"ca-file": str(cert), "client.cert": str(cert), "client.key": str(key)}
