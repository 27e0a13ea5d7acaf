"""Watching a folder: what is whole is reported, what is not is waited for, what is bad is set aside."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from toolkit import files, publication
from toolkit.cli.watch import command
from toolkit.errors import (
    ConfigError,
    OutputError,
    RecordError,
    RegistryError,
    RenderError,
    ToolkitError,
    UnreadableError,
)
from toolkit.findings import Finding
from toolkit.lab.home import packaged_home
from toolkit.lab.tire_tests.reports import MadeReport
from toolkit.lab.tire_tests.watch import alone
from toolkit.lab.tire_tests.watching import BATCH, SET_ASIDE, STATE, Round, Watcher
from toolkit.recording.marks import is_own_output

office_needed = pytest.mark.skipif(
    not (shutil.which("soffice") and shutil.which("pdftotext")),
    reason="LibreOffice or poppler is not installed",
)


class Bench:
    """A watcher whose tests are read and reported by this class, with a clock that is turned by hand."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.now = folder / "inbox", 0.0
        self.folder.mkdir()
        self.read: list[str] = []
        self.reported: list[list[str]] = []
        self.faults: dict[str, ToolkitError] = {}
        self.findings: dict[str, tuple[Finding, ...]] = {}
        self.refusals: dict[str, ToolkitError] = {}
        self.registry = "one ledger"
        self.watcher = self.start()

    def start(self, settings: str = "as before", version: str = "1.2.0") -> Watcher:
        self.watcher = Watcher(
            self.folder, self.folder.parent / "out", resolve=self.resolve, report=self.report,
            settle_s=3, patience_s=60, clock=lambda: self.now,
            settings=settings, version=version, registry=lambda: self.registry,
        )  # fmt: skip
        return self.watcher

    def resolve(self, test: Path) -> Any:
        self.read.append(test.name)
        if test.name in self.faults:
            raise self.faults[test.name]
        return SimpleNamespace(findings=self.findings.get(test.name, ()))

    def report(self, ready: dict[Path, Any], folders: Sequence[Path]) -> list[MadeReport]:
        self.reported.append([test.name for test in ready])
        done = [
            SimpleNamespace(pdf=folder / "report.pdf", content_sha256="0", units=("N", "N*m"))
            for folder in folders
        ]
        return [
            MadeReport(test=test, resolved=ready[test], outcome=self.refusals.get(test.name, one))  # type: ignore[arg-type]
            for test, one in zip(ready, done, strict=True)
        ]

    def test(self, name: str, data: str = "x") -> Path:
        folder = self.folder / name
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "test.toml").write_text("")
        (folder / "run").write_text(data)
        return folder

    def look(self, after: float = 0.0) -> Round:
        self.now += after
        return self.watcher.look()


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


def truncated() -> UnreadableError:
    return UnreadableError("the file is cut off", where="run", rule="zip-truncated")


def test_a_test_is_reported_once_its_files_have_settled(bench: Bench) -> None:
    bench.test("one")
    bench.test("year/two")
    (bench.folder / "no test").mkdir()
    assert [one.reason for one in bench.look().waiting] == ["files are arriving"] * 2
    bench.test("one", "more")  # it still grows
    assert {one.test for one in bench.look(after=4).waiting} == {"one"}
    assert bench.reported == [["two"]]
    bench.look(after=4)
    bench.look(after=4)
    assert bench.reported == [["two"], ["one"]]  # and not again
    assert json.loads((bench.watcher.out / STATE).read_text())["tests"]["year/two"]["state"] == "made"


def test_a_file_that_grows_while_its_test_is_read_makes_one_report(bench: Bench) -> None:
    """What was hashed before is not what was read: reported at once, the test would be reported twice."""
    bench.test("one")
    bench.look()
    read = bench.watcher.resolve

    def slow(test: Path) -> Any:
        bench.test("one", "the rest came")
        bench.watcher.resolve = read
        return read(test)

    bench.watcher.resolve = slow
    assert [one.reason for one in bench.look(after=4).waiting] == ["files are arriving"]
    assert bench.reported == []
    bench.look(after=4)
    bench.look(after=4)
    bench.look(after=4)
    assert bench.reported == [["one"]]


def test_a_disk_too_full_for_the_state_ends_no_watch_and_is_written_later(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(path: Path, _data: str) -> None:
        raise OutputError("a file cannot be written", where=path, got="No space left on device")

    bench.test("one")
    bench.test("bad")
    bench.faults["bad"] = UnreadableError("it is no recording", where="run", rule="not-a-workbook")
    bench.look()
    monkeypatch.setattr(publication, "write_result", full)
    found = bench.look(after=4)
    assert [one.test.name for one in found.made] == ["one"]
    assert {one.test for one in found.waiting} == {STATE, "bad.txt"}
    assert all("No space left" in one.reason for one in found.waiting)
    monkeypatch.undo()
    assert bench.look(after=4).waiting == ()
    assert "not-a-workbook" in (bench.watcher.out / SET_ASIDE / "bad.txt").read_text()
    bench.start().look()  # a restart knows what was made
    bench.look(after=4)
    assert bench.reported == [["one"]]


def test_all_tests_that_are_whole_are_made_in_one_call(bench: Bench) -> None:
    bench.test("one")
    bench.test("two")
    bench.look()
    bench.look(after=4)
    assert bench.reported == [["one", "two"]]


def test_many_tests_are_made_in_batches_and_the_state_is_kept_with_each(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    for number in range(2 * BATCH + 3):
        bench.test(f"t{number:02}")
    bench.look()
    saved: list[int] = []
    save = bench.watcher._save
    monkeypatch.setattr(bench.watcher, "_save", lambda: (saved.append(len(bench.watcher.state)), save()))
    assert len(bench.look(after=4).made) == 2 * BATCH + 3
    assert [len(batch) for batch in bench.reported] == [BATCH, BATCH, 3]
    assert saved == [BATCH, 2 * BATCH, 2 * BATCH + 3]


def test_what_did_not_change_is_not_read_again(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    hashed: list[str] = []
    asked: list[str] = []
    real = files.sha256_file
    monkeypatch.setattr(files, "sha256_file", lambda path: (hashed.append(path.parent.name), real(path))[1])
    bench.watcher.registry = lambda: (asked.append("once"), bench.registry)[1]
    for number in range(5):
        bench.test(f"t{number}")
        bench.faults[f"t{number}"] = RegistryError("none is in force", rule="no-record-in-force")
    bench.look()
    saved: list[int] = []
    save = bench.watcher._save
    monkeypatch.setattr(bench.watcher, "_save", lambda: (saved.append(1), save()))
    assert len(bench.look(after=4).set_aside) == 5
    assert (len(hashed), len(asked), len(saved)) == (10, 2, 1)
    assert len(bench.look(after=4).set_aside) == 5
    assert (len(hashed), len(asked), len(saved)) == (10, 3, 1)
    bench.test("t3", "another content")
    bench.look(after=4)
    bench.look(after=4)
    assert hashed[10:] == ["t3", "t3"]


def test_a_partial_file_is_waited_for(bench: Bench) -> None:
    bench.test("one")
    bench.faults["one"] = truncated()
    bench.look()
    assert "zip-truncated" in bench.look(after=4).waiting[0].reason
    bench.look(after=4)
    assert bench.read == ["one"]  # an unchanged file is not read again at every look
    del bench.faults["one"]
    bench.test("one", "the whole file")
    bench.look(after=4)
    bench.look(after=4)
    assert bench.reported == [["one"]]


def test_a_missing_step_is_waited_for_and_after_long_patience_it_is_a_finding(bench: Bench) -> None:
    bench.test("one")
    bench.findings["one"] = (Finding(rule="missing", where="SA +10 deg", message="no file"),)
    bench.look()
    assert "SA +10 deg: no file" in bench.look(after=4).waiting[0].reason
    assert bench.reported == []
    bench.look(after=60)
    assert bench.reported == [["one"]]


def test_a_bad_file_sets_its_test_aside_with_the_reason_until_it_changes(bench: Bench) -> None:
    bench.test("year/bad")
    bench.test("good")
    bench.faults["bad"] = UnreadableError("the workbook holds macros", where="run", rule="macros")
    bench.look()
    found = bench.look(after=4)
    assert [(one.test, one.rule) for one in found.set_aside] == [("year/bad", "macros")]
    assert bench.reported == [["good"]]  # the other one is not held up
    note = bench.watcher.out / SET_ASIDE / "year%2Fbad.txt"
    assert "the workbook holds macros" in note.read_text()
    assert is_own_output(note)
    assert (bench.folder / "year/bad/run").read_text() == "x"  # the original stays as it is
    assert bench.look(after=4).set_aside == found.set_aside  # it stands aside until it changes
    assert bench.read.count("bad") == 1
    del bench.faults["bad"]
    bench.test("year/bad", "mended")
    bench.look(after=4)
    bench.look(after=4)
    assert bench.reported[-1] == ["bad"]
    assert not note.exists()


@pytest.mark.parametrize(
    "error",
    [
        RecordError("m15-r2 may not be used", rule="not-in-force"),
        RegistryError("no calibration of m15 is in force on 1950-01-01", rule="no-record-in-force"),
    ],
)
def test_a_watch_makes_no_drafts_and_tries_again_once_a_ledger_changes(
    bench: Bench, error: ToolkitError
) -> None:
    bench.test("early")
    bench.test("good")
    bench.faults["early"] = error
    bench.look()
    assert [one.rule for one in bench.look(after=4).set_aside] == [error.rule]
    assert bench.reported == [["good"]]
    assert [one.test for one in bench.look(after=4).set_aside] == ["early"]
    assert bench.read.count("early") == 1
    bench.faults.clear()
    bench.registry = "a ledger with one more line"
    assert bench.look(after=4).set_aside == ()
    assert bench.reported == [["good"], ["early"]]


def test_a_cut_file_that_stays_cut_is_set_aside(bench: Bench) -> None:
    bench.test("one")
    bench.faults["one"] = truncated()
    bench.look()
    assert bench.look(after=30).set_aside == ()
    assert [one.rule for one in bench.look(after=31).set_aside] == ["zip-truncated"]


def test_a_refused_report_is_set_aside_and_a_full_disk_is_tried_again(bench: Bench) -> None:
    bench.test("one")
    bench.test("two")
    bench.refusals["one"] = RenderError("the report was not verified", rule="not-verified")
    bench.refusals["two"] = OutputError("the report cannot be written", got="No space left on device")
    bench.look()
    found = bench.look(after=4)
    assert [one.rule for one in found.set_aside] == ["not-verified"]
    assert "No space left" in found.waiting[0].reason
    bench.refusals.clear()
    bench.look(after=4)
    assert bench.reported[-1] == ["two"]


def test_a_restart_goes_on_where_the_last_one_ended(bench: Bench) -> None:
    bench.test("one")
    bench.test("bad")
    bench.faults["bad"] = UnreadableError("the workbook holds macros", where="run", rule="macros")
    bench.look()
    bench.look(after=4)
    bench.start()
    bench.look()
    os.utime(bench.folder / "one" / "run", (1, 1))  # a copy of the same test is the same test
    bench.look(after=4)
    after = bench.look(after=4)
    assert bench.reported == [["one"]]
    assert bench.read.count("bad") == 1
    # A run that makes nothing is not clean while a test stands aside.
    assert [(one.test, one.rule, one.reason) for one in after.set_aside] == [
        ("bad", "macros", str(bench.faults["bad"]))
    ]


def test_what_was_refused_is_tried_again_by_other_settings_and_what_was_made_stays(bench: Bench) -> None:
    for name in ("one", "refused", "bad"):
        bench.test(name)
    bench.refusals["refused"] = RenderError("the report was not verified", rule="not-verified")
    bench.faults["bad"] = UnreadableError("the workbook holds macros", where="run", rule="macros")
    bench.look()
    bench.look(after=4)
    bench.refusals.clear()
    bench.start()
    bench.look()
    assert {one.test for one in bench.look(after=4).set_aside} == {"refused", "bad"}
    assert bench.reported == [["one", "refused"]]
    bench.start("another template")
    bench.look()
    assert [one.test for one in bench.look(after=4).set_aside] == ["bad"]
    assert bench.reported == [["one", "refused"], ["refused"]]
    assert not (bench.watcher.out / SET_ASIDE / "refused.txt").exists()


def test_what_an_older_toolkit_set_aside_is_tried_once_more(bench: Bench) -> None:
    for name in ("made", "refused", "bad", "worse"):
        bench.test(name)
    bench.refusals["refused"] = RenderError("the report was not verified", rule="not-verified")
    for name in ("bad", "worse"):
        bench.faults[name] = UnreadableError("the workbook holds macros", where="run", rule="macros")
    bench.look()
    bench.look(after=4)
    # The newer one can read and print what the older could not, but for one test.
    bench.refusals.clear()
    del bench.faults["bad"]
    bench.read.clear()
    bench.start(version="1.3.0")
    bench.look()
    assert [one.test for one in bench.look(after=4).set_aside] == ["worse"]
    assert sorted(bench.read) == ["bad", "refused", "worse"]
    assert bench.reported == [["made", "refused"], ["bad", "refused"]]
    # It tried: the one that it refused as well stays where it is, also after a restart.
    bench.look(after=4)
    bench.start(version="1.3.0")
    bench.look()
    assert [one.test for one in bench.look(after=4).set_aside] == ["worse"]
    assert len(bench.read) == 3


def test_a_state_that_names_no_version_is_an_older_toolkit_s(bench: Bench) -> None:
    bench.test("bad")
    bench.faults["bad"] = UnreadableError("the workbook holds macros", where="run", rule="macros")
    bench.look()
    bench.look(after=4)
    state = bench.watcher.out / STATE
    told = json.loads(state.read_text())
    del told["tests"]["bad"]["version"]
    state.write_text(json.dumps(told))
    bench.faults.clear()
    bench.start()
    bench.look()
    assert len(bench.look(after=4).made) == 1


def test_unknown_units_are_told_before_anything_is_written(tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        command(tmp_path, units="psi", out=tmp_path / "out")
    assert caught.value.rule == "unknown-units"
    assert not (tmp_path / "out").exists()


def test_tests_of_like_names_have_notes_of_their_own(bench: Bench) -> None:
    names = ["a/b", "a_b", "a%2Fb", "/".join(["long" * 30] * 4)]
    for name in names:
        bench.test(name)
        bench.faults[Path(name).name] = UnreadableError("the workbook holds macros", rule="macros")
    bench.look()
    assert len(bench.look(after=4).set_aside) == 4
    notes = [path.read_text() for path in (bench.watcher.out / SET_ASIDE).iterdir()]
    assert sorted(note.splitlines()[1] for note in notes) == sorted(f"{name}: macros" for name in names)


def test_a_broken_registry_is_no_fault_of_a_test(bench: Bench) -> None:
    bench.test("one")
    bench.faults["one"] = RegistryError("the ledger is damaged", rule="ledger")  # type: ignore[assignment]
    bench.look()
    with pytest.raises(RegistryError):
        bench.look(after=4)
    assert not (bench.watcher.out / STATE).exists()


@pytest.mark.parametrize(
    "text", ["", "[]", '{"generator": "other", "tests": {}}', '{"generator": "toolkit"}']
)
def test_a_damaged_state_is_told(bench: Bench, text: str) -> None:
    bench.watcher.out.mkdir()
    (bench.watcher.out / STATE).write_text(text)
    with pytest.raises(OutputError) as caught:
        bench.start()
    assert "delete it" in str(caught.value.next_step)


def watch(*words: object) -> list[str]:
    code = "from toolkit.cli.main import run; run()"
    home = packaged_home()
    return [sys.executable, "-c", code, "watch", *map(str, words), "--home", str(home), "--settle", "0.3",
            "--interval", "0.1"]  # fmt: skip


@pytest.mark.campaign("a process that watches, with a whole report: each of its steps is held in every run")
@office_needed
def test_a_test_that_arrives_bit_by_bit_is_reported_when_it_is_whole(
    virtual_test: Path, tmp_path: Path
) -> None:
    inbox, out = tmp_path / "inbox", tmp_path / "out"
    test = inbox / "a"
    test.mkdir(parents=True)
    summary = packaged_home() / "report_templates" / "summary.docx"
    running = subprocess.Popen(
        watch(inbox, "--template", summary, "--out", out, "--units", "lbf", "--json"),
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        files = sorted((path for path in virtual_test.iterdir()), key=lambda path: path.suffix == ".xlsx")
        *rest, last = files  # the last one is a recording
        for path in rest:
            shutil.copy(path, test / path.name)
        whole = last.read_bytes()
        (test / last.name).write_bytes(whole[: len(whole) // 2])
        time.sleep(1.5)
        assert not (out / "a").exists()
        (test / last.name).write_bytes(whole)
        end = time.monotonic() + 90
        while time.monotonic() < end and not (out / "a" / "manifest.json").is_file():
            time.sleep(0.2)
        again = subprocess.run(
            watch(inbox, "--out", out, "--once", "--json"), capture_output=True, text=True, check=False
        )
        assert again.returncode == 2
        assert json.loads(again.stdout)["error"]["rule"] == "watch-running"
    finally:
        running.send_signal(signal.SIGTERM)
        told = json.loads(running.communicate(timeout=90)[0])
    assert [one["verified"] for one in told["made"]] == [True]
    assert told["made"][0]["units"] == {"force": "lbf", "moment": "lbf*ft"}
    assert json.loads((out / STATE).read_text())["tests"]["a"]["units"] == ["lbf", "lbf*ft"]
    assert sorted(one.name for one in (out / "a").iterdir()) == ["manifest.json", "report.docx", "report.pdf"]
    once = subprocess.run(
        watch(inbox, "--out", out, "--once", "--json"), capture_output=True, text=True, check=False
    )
    assert once.returncode == 0
    assert json.loads(once.stdout)["made"] == []


def test_a_link_in_the_place_of_the_lock_loses_nothing(tmp_path: Path) -> None:
    kept = tmp_path / "kept.txt"
    kept.write_text("of somebody")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / ".watch.lock").symlink_to(kept)
    with alone(tmp_path / "out"):
        pass
    assert kept.read_text() == "of somebody"


def test_a_pipe_in_the_place_of_the_lock_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / ".watch.lock")
    with pytest.raises(OutputError), alone(tmp_path):
        pass
