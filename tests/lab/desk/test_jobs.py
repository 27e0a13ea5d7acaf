"""Jobs: one at a time, told how far they are, ended when asked, and known for what they are after a crash."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from toolkit.errors import ConfigError
from toolkit.lab.desk.jobs import (
    FOLDER,
    LOCK,
    Job,
    SeenJob,
    cancel_job,
    job_of,
    jobs_of,
    log_of,
    read_job,
    start_job,
    write_job,
)
from toolkit.lab.progress_note import ProgressNote, note_of, read_note
from toolkit.system import lock_folder

ARCHIVE = ("audit", "archive", "--home", ".")


@pytest.fixture
def home(tmp_path: Path) -> Path:
    (tmp_path / "calibrations").mkdir()
    (tmp_path / "archive").mkdir()
    return tmp_path


def until(home: Path, job_id: str, done: Callable[[SeenJob], bool], seconds: float = 120.0) -> SeenJob:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        seen = job_of(home, job_id)
        assert seen is not None
        if done(seen):
            return seen
        time.sleep(0.05)
    raise AssertionError(f"{seen}: {log_of(home, job_id)}")


def over(seen: SeenJob) -> bool:
    return seen.job.ended is not None


def waiting(home: Path) -> str:
    """Start a job that goes on until it is ended: a workbench of the home."""
    words = ("open", ".", "--no-browser")
    return start_job(home, kind="audit", title="a server that waits", words=words)


def test_a_job_runs_a_command_and_keeps_its_log_and_its_end(home: Path) -> None:
    job_id = start_job(home, kind="audit", title="archive", words=(*ARCHIVE, "--out", "audits/archive"))
    seen = until(home, job_id, over)
    assert (seen.state, seen.job.exit_code, seen.job.title) == ("clean", 0, "archive")
    assert "0 files" in log_of(home, job_id)
    assert (home / "audits" / "archive" / "audit.jsonl").is_file()
    assert [one.id for one in jobs_of(home)] == [job_id]


def test_a_command_that_refuses_says_why_in_its_log(home: Path) -> None:
    job_id = start_job(home, kind="audit", title="nothing", words=("audit", "nowhere", "--home", "."))
    assert until(home, job_id, over).state == "refused"
    assert "the archive cannot be used" in log_of(home, job_id)


def test_a_second_job_is_refused_while_one_runs_and_the_first_can_be_cancelled(home: Path) -> None:
    job_id = waiting(home)
    assert until(home, job_id, lambda _: True).state == "running"
    with pytest.raises(ConfigError) as caught:
        start_job(home, kind="audit", title="second", words=ARCHIVE)
    assert caught.value.rule == "job-running"
    assert "a server that waits" in str(caught.value)
    cancel_job(home, job_id)
    assert until(home, job_id, over).state == "cancelled"
    # Its runner is gone: the next one is taken.
    second = until(home, start_job(home, kind="audit", title="second", words=ARCHIVE), over)
    assert second.state == "clean"


def test_a_runner_that_has_written_its_end_and_is_not_gone_yet_is_waited_for(home: Path) -> None:
    """The page says that the job is over, and a busy computer takes a second to end its process."""
    until(home, start_job(home, kind="audit", title="first", words=ARCHIVE), over)
    with (home / FOLDER / LOCK).open("ab") as leaving:
        lock_folder(leaving.fileno(), shared=False, wait=True)
        threading.Timer(1.0, leaving.close).start()
        second = until(home, start_job(home, kind="audit", title="second", words=ARCHIVE), over)
    assert second.state == "clean"


def test_a_job_whose_runner_was_killed_was_interrupted_and_keeps_nobody_waiting(home: Path) -> None:
    job_id = waiting(home)
    runner = _runner(home, job_id)
    children = [int(one) for one in Path(f"/proc/{runner}/task/{runner}/children").read_text().split()]
    os.kill(runner, signal.SIGKILL)
    for child in children:
        os.kill(child, signal.SIGKILL)
    assert until(home, job_id, lambda seen: seen.state != "running").state == "interrupted"
    next_job = start_job(home, kind="audit", title="next", words=ARCHIVE)
    assert until(home, next_job, over).state == "clean"


def _runner(home: Path, job_id: str) -> int:
    place = str(home / FOLDER / job_id).encode()
    end = time.monotonic() + 60
    while time.monotonic() < end:
        for process in Path("/proc").glob("[0-9]*"):
            try:
                words = (process / "cmdline").read_bytes().split(b"\0")
                children = (process / "task" / process.name / "children").read_text()
            except OSError:
                continue
            if place in words and children:
                return int(process.name)
        time.sleep(0.05)
    raise AssertionError("the runner has no command")


def test_a_state_file_that_is_damaged_or_no_job_is_no_job(home: Path) -> None:
    for name in ("20260101T000000-00000000", "notes"):
        (home / FOLDER / name).mkdir(parents=True)
        (home / FOLDER / name / "job.toml").write_text("schema = 1\nkind = 'flood'\n")
    assert list(jobs_of(home)) == []
    for name in ("../archive", "notes", "", "20260101T000000-zzzzzzzz"):
        assert job_of(home, name) is None


def test_a_job_file_is_read_as_it_was_written(tmp_path: Path) -> None:
    job = Job(kind="repair", title='a "b"', words=("audit", "x y"), started="2026-01-01T00:00:00Z")
    write_job(tmp_path, job)
    assert read_job(tmp_path) == job


def test_progress_is_noted_and_a_disk_that_fails_stops_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert note_of("audit", 3) is None
    monkeypatch.setenv("TOOLKIT_PROGRESS", str(tmp_path / "progress"))
    note = note_of("audit", 3)
    assert note is not None
    for name in ("a", "b", "c"):
        note.step(name)
    assert read_note(tmp_path / "progress") == {"title": "audit", "done": 3, "total": 3, "text": "c"}
    ProgressNote(path=tmp_path / "missing" / "progress", title="audit", total=1).step("a")
    (tmp_path / "progress").write_text("{")
    assert read_note(tmp_path / "progress") is None
