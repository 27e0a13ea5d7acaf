"""Fixtures that more than one stage needs: the virtual machine's truth as a record, and a virtual test."""

from __future__ import annotations

import contextlib
import gc
import importlib
import json
import multiprocessing
import os
import sys
import threading
from collections.abc import Generator, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from _pytest.doctest import DoctestModule
from hypothesis import settings

from tests.built_once import built_once, common_folder
from tests.declared_answers import hold_to_declarations
from tests.kept_office import kept_office
from tests.remembered import share
from tests.remembered_fits import remember_fits
from tests.remembered_work import remembered_work
from toolkit.audit import workers
from toolkit.calibration.records.record import CalibrationRecord, Golden, Indication, LoadFit
from toolkit.simulation.plan import Plan, read_plan
from toolkit.system import can_fork
from toolkit.worker import posix

# Machines are shared and noisy: no example is judged by its time. CI repeats the same examples; a developer's
# machine draws new ones each time, so that fewer than the usual hundred a run add up.
settings.register_profile("toolkit", deadline=None, max_examples=40, derandomize=bool(os.environ.get("CI")))
settings.load_profile("toolkit")
hold_to_declarations()

# A case's worker is forked where no thread holds a lock that it may want. The runner's own thread waits for
# orders and holds none, and neither do the idle threads of compiled libraries, which stay from the first test
# that has a Parquet file written (Arrow) or a Schematron asked (a Java machine): without this every worker of
# every later test begins as a new interpreter, 0.5 s each.
if can_fork():
    _RUNNER = posix.threads()
    posix._has_threads = lambda: not {str(thread.native_id) for thread in threading.enumerate()} <= _RUNNER

# Twelve thousand tests and the modules that they ask for are objects that stay: a collector that looks at
# all of them again and again finds nothing. They are set aside once they are there, and what the tests
# themselves make is looked through less often.
gc.disable()


@pytest.hookimpl(wrapper=True)
def pytest_collect_file(
    file_path: Path,
) -> Generator[None, list[pytest.Collector], list[pytest.Collector]]:
    """Leave out what would be searched for examples and has none: of 1 500 files, all but 150."""
    collectors = yield
    without = file_path.suffix == ".py" and ">>>" not in file_path.read_text(encoding="utf-8")
    return [each for each in collectors if not (without and isinstance(each, DoctestModule))]


def pytest_collection(session: pytest.Session) -> None:
    """Have every second worker import the tests from the last on, where all are asked for.

    What one of them has compiled the others load: workers that all begin with the first compile all of a
    fresh clone's tests each, 12 s of processor time. A module that cannot be imported is told of by its
    collection.
    """
    worker = os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw")
    if int(worker) % 2 and session.config.args_source is pytest.Config.ArgsSource.TESTPATHS:
        root = Path(__file__).parent
        for path in sorted(root.rglob("test_*.py"), reverse=True):
            with contextlib.suppress(Exception, pytest.skip.Exception):
                importlib.import_module(".".join(("tests", *path.relative_to(root).with_suffix("").parts)))


def pytest_collection_finish() -> None:
    gc.collect()
    gc.freeze()
    gc.set_threshold(5_000, 10, 10)
    gc.enable()


# An audit's worker begins as a new interpreter, 0.4 s of imports each, and a job of the workbench as two, 2 s
# each. In tests all come of one process that has these behind it; `test_workers.py` holds what a user's
# computer does by scripts of its own, and `tests/lab/desk/test_jobs.py` a job.
if can_fork():
    _READY = multiprocessing.get_context("forkserver")
    _READY.set_forkserver_preload([
        "toolkit.audit.archive", "tests.workbench.kept_runner", "toolkit.lab.plans.plan_session",
        "toolkit.lab.tire_tests.reports", "toolkit.lab.studies.diagnosis",
        "statsmodels.regression.linear_model",
    ])  # fmt: skip
    workers.mp = SimpleNamespace(get_context=lambda _: _READY)

remember_fits()


def _flushed(handle: Any) -> None:
    os.fstat(handle if isinstance(handle, int) else handle.fileno())


# What is written is flushed to the disk before it is named, and tests of the registry write by the thousand:
# each waited for the disk, which the other worker holds up too. No test sees whether bytes are on a disk or
# about to be. `tests/crash` kills processes of their own, which flush, at each such call.
os.fsync = _flushed

# The many processes that tests start, and the next run, load compiled modules, whatever the environment says.
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)


@pytest.fixture(scope="session", autouse=True)
def _office(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    share(common_folder(tmp_path_factory) / "remembered")
    with kept_office(), remembered_work():
        yield


EXAMPLES = Path(__file__).resolve().parents[1] / "toolkit" / "examples"
SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


def record_of(
    loads: dict[str, tuple[str, tuple[float, ...]]], *, unit: str, zero: str = "tared"
) -> CalibrationRecord:
    """Return a linear record with the coefficients given (D51, D52, E5, intercept)."""
    terms = ("D51", "D52", "E5", "intercept")
    return CalibrationRecord(
        id="bench-r1",
        instrument="bench",
        kind="fit",
        date="2026-01-01",
        entered_by="a test",
        zero=zero,  # type: ignore[arg-type]
        cells=tuple(Indication(name=name, unit=unit) for name in terms[:3]),
        loads=tuple(
            LoadFit(load=load, unit=text, terms=terms, coefficients=c, issued=c, polarity=(0, 0, 0, 0))
            for load, (text, c) in loads.items()
        ),
        golden=Golden(),
        data=(),
        settings="{}",
        inputs_sha256="",
        sha256="0" * 64,
    )


@pytest.fixture(scope="session")
def published_record() -> CalibrationRecord:
    """The coefficients that the source document prints in its section 4.1 (lbf, lbf·ft)."""
    return record_of(
        {
            "FY": ("lbf", (0.99719, 0.99718, 1.0228, 0.6473)),
            "MZ": ("lbf*ft", (-0.15688, 0.16197, 0.0026666, 0.68759)),
        },
        unit="lbf",
        zero="included",
    )


@pytest.fixture(scope="session")
def virtual_plan() -> Plan:
    """The packaged plan of a virtual test."""
    return read_plan(EXAMPLES / "virtual" / "test_plan.toml")


@pytest.fixture(scope="session")
def virtual_record(virtual_plan: Plan) -> CalibrationRecord:
    """What a perfect reference-load session on the virtual machine finds (no covariance)."""
    from toolkit.simulation.cells import true_coefficients

    per_V_per_V = true_coefficients(virtual_plan.cells)
    return record_of(
        {
            "FY": ("N", (*(c * 1e-3 for c in per_V_per_V["FY"]), 0.0)),
            "MZ": ("N*m", (*(c * 1e-3 for c in per_V_per_V["MZ"]), 0.0)),
        },
        unit="mV/V",
    )


@pytest.fixture(scope="session")
def virtual_test(tmp_path_factory: pytest.TempPathFactory, virtual_plan: Plan) -> Path:
    """A virtual test as files; read it, never write into it."""
    return _test_of(virtual_plan, "virtual", tmp_path_factory)


@pytest.fixture(scope="session")
def virtual_repeat(tmp_path_factory: pytest.TempPathFactory, virtual_plan: Plan) -> Path:
    """The same tire tested again, with other noise; read it, never write into it."""
    return _test_of(replace(virtual_plan, seed=7), "repeat", tmp_path_factory)


def _test_of(plan: Plan, name: str, factory: pytest.TempPathFactory) -> Path:
    from toolkit.simulation.run import simulate
    from toolkit.simulation.write import write_test

    return built_once(factory, name, lambda folder: write_test(simulate(plan), folder / "test")) / "test"


@pytest.fixture(scope="session")
def virtual_truth(virtual_test: Path) -> dict[str, Any]:
    """The truth that the virtual machine stored beside its test."""
    found: dict[str, Any] = json.loads((virtual_test / "truth.json").read_text())
    return found
