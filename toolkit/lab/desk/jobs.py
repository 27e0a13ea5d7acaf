"""Long work of a home: one command at a time, in a process that outlives the page and the server.

A job is a folder ``jobs/<id>``: `Job` in job.toml, ``log`` with what the command printed, ``progress`` with
how far it is, and ``cancel`` once somebody asked for its end. Its runner (`toolkit.lab.desk.job_runner`) and
its command hold the lock of ``jobs/`` as long as they live: a job without an end whose lock is free was
interrupted, be it by a power cut.
"""

from __future__ import annotations

import os
import re
import secrets
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, Annotated, Any, ClassVar, Literal

from toolkit.declared import Entry, Format, Text, read_text, toml_text
from toolkit.errors import ConfigError, ToolkitError
from toolkit.files import write_atomic
from toolkit.inputs import (
    RESULT_FILE,
    SETTINGS_FILE,
    open_regular,
    open_regular_to_append,
    read_input,
    read_regular,
)
from toolkit.lab.progress_note import LEVEL, read_note
from toolkit.system import lock_folder

FOLDER, FILE, LOG, PROGRESS, CANCEL, LOCK = "jobs", "job.toml", "log", "progress", "cancel", "lock"
ID = re.compile(r"\d{8}T\d{6}-[0-9a-f]{8}")
_LOG_SHOWN = 20_000  # bytes of a log's end
_PROBES, _PAUSE = 5, 0.05  # somebody else who only looks holds the lock for microseconds
_LEAVING = 10.0  # seconds that a process may take to be gone after it has written its end

Level = Literal["warning", "error"]
Kind = Literal["audit", "repair", "preview", "report", "diagnosis", "plan"]
State = Literal["running", "interrupted", "cancelled", "clean", "findings", "refused", "failed"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """One command that was started from the workbench, and how it ended."""

    FORMAT: ClassVar[Format] = Format(title="job", schema=1)

    kind: Annotated[Kind, Entry("what the job does")]
    title: Annotated[str, Entry("what it is done to", example="archive")]
    words: Annotated[tuple[str, ...], Entry("of the command line", example=["audit", "archive"])]
    started: Annotated[str, Text(strip=True), Entry("UTC", example="2026-11-22T10:11:12Z")]
    ended: Annotated[str | None, Text(strip=True), Entry("UTC; nothing while it runs")] = None
    exit_code: Annotated[int | None, Entry("of the command")] = None
    cancelled: Annotated[bool, Entry("whether somebody asked for its end")] = False
    level: Annotated[Level | None, Entry("of the gravest finding of the command")] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SeenJob:
    """A job as it stands: its state, and how far it is (None where the command did not tell)."""

    id: str
    job: Job
    state: State
    progress: dict[str, Any] | None


def start_job(home: Path, *, kind: Kind, title: str, words: Sequence[str]) -> str:
    """Start a command as a job, and return its id.

    Raises
    ------
    ConfigError
        ``job-running``: another job of this home is not done
    """
    folder = home / FOLDER
    folder.mkdir(exist_ok=True)
    with open_regular_to_append(folder / LOCK) as lock:
        ends = time.monotonic() + _LEAVING
        while not _taken(lock):
            running = next((seen for seen in jobs_of(home) if seen.state == "running"), None)
            if running is None and time.monotonic() < ends:
                continue
            raise ConfigError(
                "a job of this home is not done yet", where=folder,
                got="a process that holds its lock"
                if running is None else f"{running.job.kind} of {running.job.title}",
                expected="one job at a time for each home",
                next_step="wait for its end, or cancel it; nothing was started", rule="job-running",
            )  # fmt: skip
        now = datetime.now(tz=UTC)
        job_id = f"{now:%Y%m%dT%H%M%S}-{secrets.token_hex(4)}"
        place = folder / job_id
        place.mkdir()
        job = Job(kind=kind, title=title, words=tuple(words), started=_time(now))
        write_job(place, job)
        with (place / LOG).open("wb") as log:
            # The lock goes with the descriptor: it is the runner's from here on, whoever else ends.
            runner = subprocess.Popen(
                [sys.executable, "-m", "toolkit.lab.desk.job_runner", str(place), str(lock.fileno())],
                stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT, cwd=home,
                start_new_session=True, pass_fds=(lock.fileno(),),
            )  # fmt: skip
        threading.Thread(target=runner.wait, daemon=True).start()  # so that it leaves no zombie
    return job_id


def jobs_of(home: Path) -> Iterator[SeenJob]:
    """Yield the jobs of a home, the newest first; what is no job is left out."""
    try:
        names = sorted((entry.name for entry in os.scandir(home / FOLDER)), reverse=True)
    except OSError:
        return
    for name in names:
        job = job_of(home, name)
        if job is not None:
            yield job


def job_of(home: Path, job_id: str) -> SeenJob | None:
    """Return a job by its id; None where there is none."""
    place = home / FOLDER / job_id
    if not ID.fullmatch(job_id):
        return None
    try:
        held = _is_held(home / FOLDER / LOCK)  # asked before the end is read: who ends writes first
        job = read_job(place)
    except (ToolkitError, OSError):
        return None
    return SeenJob(id=job_id, job=job, state=_state(job, held=held), progress=read_note(place / PROGRESS))


def cancel_job(home: Path, job_id: str) -> None:
    """Ask for the end of a job; its runner ends the command within seconds."""
    job = job_of(home, job_id)
    if job is not None and job.state == "running":
        write_atomic(home / FOLDER / job_id / CANCEL, "")


def log_of(home: Path, job_id: str) -> str:
    """Return the end of what a job's command printed."""
    try:
        with open_regular(home / FOLDER / job_id / LOG) as stream:
            size = stream.seek(0, os.SEEK_END)
            stream.seek(max(0, size - _LOG_SHOWN))
            return stream.read(_LOG_SHOWN).decode(errors="replace")
    except OSError:
        return ""


def read_job(place: Path) -> Job:
    """Read job.toml of a job's folder.

    Raises
    ------
    ConfigError
        it is missing, or none
    """
    return read_text(Job, read_input(place / FILE, SETTINGS_FILE), where=place / FILE)


def write_job(place: Path, job: Job) -> None:
    """Write job.toml, whole or not at all."""
    write_atomic(place / FILE, toml_text(job))


def ended(place: Path, job: Job, exit_code: int, *, cancelled: bool) -> Job:
    """Return a job that is over, with the gravest level that its command noted in its folder."""
    try:
        noted = read_regular(place / LEVEL, RESULT_FILE)
    except OSError:
        noted = b""
    level: Level | None = "error" if noted == b"error" else "warning" if noted == b"warning" else None
    return replace(
        job, ended=_time(datetime.now(tz=UTC)), exit_code=exit_code, cancelled=cancelled, level=level
    )


def _state(job: Job, *, held: bool) -> State:
    if job.ended is None:
        return "running" if held else "interrupted"
    if job.cancelled:
        return "cancelled"
    states: dict[int | None, State] = {0: "clean", 1: "findings", 2: "refused"}
    return states.get(job.exit_code, "failed")


def _is_held(path: Path) -> bool:
    try:
        with open_regular_to_append(path) as lock:
            return not _taken(lock, shared=True)
    except OSError:
        return False


def _taken(lock: IO[bytes], *, shared: bool = False) -> bool:
    for _ in range(_PROBES):
        try:
            lock_folder(lock.fileno(), shared=shared, wait=False)
        except OSError:
            time.sleep(_PAUSE)
        else:
            return True
    return False


def _time(moment: datetime) -> str:
    return moment.strftime("%Y-%m-%dT%H:%M:%SZ")
