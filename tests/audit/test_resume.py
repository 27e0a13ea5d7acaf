"""An audit goes on where it was ended, and does again only what changed."""

from __future__ import annotations

import json
import multiprocessing
import resource
import shutil
from pathlib import Path

import pytest

from tests.recording.fig4_4 import write_fig4_4
from toolkit import machine as machine_module
from toolkit.audit import archive as archive_module
from toolkit.audit.archive import audit_archive
from toolkit.audit.one_file import ArchivedFile
from toolkit.audit.resume import RESULTS, Done, Results
from toolkit.calibration.registry.registry import Registry
from toolkit.declared import json_value, object_of
from toolkit.errors import OutputError

HOME = Path(__file__).resolve().parents[2]


@pytest.fixture
def archive(tmp_path):
    root = tmp_path / "archive"
    for name in ("one", "two", "three"):
        (root / name).mkdir(parents=True)
        write_fig4_4(root / name)
    (root / "bad.xlsx").write_bytes(b"PK\x03\x04 and nothing more")
    return root


@pytest.fixture
def asked(monkeypatch):
    """Names that a run gave to its workers; the work is done here, for what starts processes is not asked."""
    names = []

    def run(make, todo, *, workers, timeout_s=None):
        assert workers == 1
        names.extend(todo)
        work = make()
        return [(name, work(name)) for name in todo]

    monkeypatch.setattr(archive_module, "run_isolated", run)
    return names


def registry(folder=HOME / "calibrations"):
    return Registry(folder)


def test_results_survive_the_way_through_the_file(archive):
    for one in audit_archive(archive, registry()).files:
        assert object_of(ArchivedFile, json.loads(json.dumps(json_value(one)))) == one


def test_a_second_run_reads_nothing_and_answers_the_same(archive, tmp_path, asked):
    first = audit_archive(archive, registry(), out=tmp_path / "out")
    assert len(asked) == len(first.files)
    asked.clear()
    assert audit_archive(archive, registry(), out=tmp_path / "out") == first
    assert asked == []


def test_only_what_changed_is_done_again(archive, tmp_path, asked):
    audit_archive(archive, registry(), out=tmp_path / "out")
    asked.clear()
    changed = next((archive / "two").iterdir())
    changed.write_bytes(b"not a recording any more")
    (archive / "three" / "test.toml").write_text('schema = 1\nmachine = "m15"\ndate = 2019-05-05\n')
    audit_archive(archive, registry(), out=tmp_path / "out")
    expected = {changed.relative_to(archive).as_posix()}
    expected |= {
        p.relative_to(archive).as_posix() for p in (archive / "three").iterdir() if p.suffix != ".toml"
    }
    assert set(asked) == expected


def test_another_registry_makes_every_result_new(archive, tmp_path, asked):
    audit_archive(archive, registry(), out=tmp_path / "out")
    asked.clear()
    shutil.copytree(HOME / "calibrations" / "m15", tmp_path / "calibrations" / "m15")
    audit_archive(archive, registry(tmp_path / "calibrations"), out=tmp_path / "out")
    assert len(asked) == 7


def test_a_line_that_a_crash_cut_off_costs_one_file(archive, tmp_path, asked):
    first = audit_archive(archive, registry(), out=tmp_path / "out")
    results = tmp_path / "out" / RESULTS
    data = results.read_bytes()
    results.write_bytes(data[:-20])
    asked.clear()
    assert audit_archive(archive, registry(), out=tmp_path / "out") == first
    assert len(asked) == 1
    assert len(results.read_bytes()) == len(data)


@pytest.mark.usefixtures("asked")
def test_a_damaged_line_costs_one_file(archive, tmp_path, asked):
    first = list(audit_archive(archive, registry(), out=tmp_path / "out").files)
    results = tmp_path / "out" / RESULTS
    data = results.read_bytes()
    results.write_bytes(data.replace(b'"grade": "stale"', b'"grade": "exact"', 1))
    asked.clear()
    assert list(audit_archive(archive, registry(), out=tmp_path / "out").files) == first
    assert len(asked) == 1


def test_a_machine_of_its_own_is_part_of_a_test(archive, tmp_path, asked):
    definition = Path(machine_module.__file__).with_name("m15.toml").read_text()
    (archive / "two" / "own.toml").write_text(definition)
    (archive / "two" / "test.toml").write_text('schema = 1\nmachine = "own.toml"\n')
    audit_archive(archive, registry(), out=tmp_path / "out")
    asked.clear()
    (archive / "two" / "own.toml").write_text(definition + "# looked at again\n")
    audit_archive(archive, registry(), out=tmp_path / "out")
    assert set(asked) == {f"two/{name}" for name in ("M15_fig4_4.xlsx", "own.toml")} | {
        p.relative_to(archive).as_posix() for p in (archive / "two").iterdir() if p.suffix != ".toml"
    }


def test_an_output_folder_inside_the_archive_is_no_part_of_it(archive):
    first = audit_archive(archive, registry(), out=archive / "audit")
    again = audit_archive(archive, registry(), out=archive / "audit")
    assert [one.path for one in again.files] == [one.path for one in first.files]


def test_two_audits_do_not_write_one_folder(archive, tmp_path):
    with (
        Results(tmp_path, archive=archive, registry_hash=""),
        pytest.raises(OutputError, match="another audit"),
    ):
        Results(tmp_path, archive=archive, registry_hash="")


def test_a_file_that_becomes_a_result_of_the_toolkit_and_back_is_what_it_is_now(archive, tmp_path, asked):
    def paths():
        return {one.path for one in audit_archive(archive, registry(), out=tmp_path / "out").files}

    every = paths()
    recording = (archive / "two" / "M15_fig4_4.xlsx").read_bytes()
    for _ in range(2):
        (archive / "two" / "M15_fig4_4.xlsx").write_text('{"generator": "toolkit", "schema": 1}')
        assert paths() == paths() == every - {"two/M15_fig4_4.xlsx"}
        (archive / "two" / "M15_fig4_4.xlsx").write_bytes(recording)
        assert paths() == paths() == every


def test_a_large_file_has_the_same_hash_as_a_small_one(archive, tmp_path, asked, monkeypatch):
    audit_archive(archive, registry(), out=tmp_path / "out")
    asked.clear()
    monkeypatch.setattr("toolkit.audit.resume._SMALL", 100)  # every file is read in pieces
    audit_archive(archive, registry(), out=tmp_path / "out")
    assert asked == []


def _put_until_full(folder, told):
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, resource.RLIM_INFINITY))
    try:
        with Results(folder, archive=folder, registry_hash="") as results:
            for number in range(100):
                results.put(f"{number}.xlsx", Done(sha256=None, body=b"{}" * 50))
    except Exception as error:  # noqa: BLE001  whatever comes out of it is what a user reads
        told.put((type(error).__name__, str(getattr(error, "where", None))))


def test_a_full_disk_is_told_with_the_file_that_has_no_room(tmp_path):
    """Closing the file writes again what could not be written: that error is none of its own."""
    fork = multiprocessing.get_context("fork")
    told = fork.Queue()
    process = fork.Process(target=_put_until_full, args=(tmp_path, told))
    process.start()
    assert told.get(timeout=60) == ("OutputError", str(tmp_path / RESULTS))
    process.join()
