"""What stands in the place of what a system lacks keeps the same contract; no other system was run."""

from __future__ import annotations

import errno
import os
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.report.template_factory import make, p
from toolkit import system
from toolkit.__main__ import main
from toolkit.simulation.plan import read_plan

EXAMPLES = Path(__file__).resolve().parents[1] / "toolkit" / "examples" / "virtual"

LIKE_WINDOWS = """
import builtins, errno, os, signal, sys
for name in ("fcntl", "resource", "pwd", "grp", "termios"):
    sys.modules[name] = None
import subprocess, tempfile, shutil, multiprocessing, asyncio, socket  # the standard library's own branches
for name in ("fork", "killpg", "setsid", "geteuid", "sched_getaffinity", "O_NONBLOCK", "O_NOCTTY",
             "O_DIRECTORY", "O_NOFOLLOW", "O_CLOEXEC"):
    delattr(os, name)
for name in ("SIGALRM", "setitimer"):
    delattr(signal, name)
_open = os.open
def opens_no_folder(path, *rest, **more):
    if sys._getframe(1).f_globals["__name__"].startswith("toolkit") and os.path.isdir(path):
        raise PermissionError(errno.EACCES, "Permission denied", str(path))
    return _open(path, *rest, **more)
os.open = opens_no_folder
from toolkit.cli.main import run
codes = []
for words in WORDS:
    try:
        run(words)
    except SystemExit as end:
        codes.append(end.code)
print("CODES", *codes)
"""


class Locking:
    """The one call of Windows' own module that is used, on the locks of this system."""

    LK_NBLCK = 2

    def locking(self, handle: int, mode: int, count: int) -> None:
        import fcntl

        assert (mode, count) == (self.LK_NBLCK, 1)
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)


@pytest.fixture(params=["this system", "Windows", "neither"])
def branch(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    if request.param != "this system":
        monkeypatch.setattr(system, "fcntl", None)
        monkeypatch.setattr(system, "msvcrt", Locking() if request.param == "Windows" else None)
        monkeypatch.delattr(os, "killpg")
        monkeypatch.delattr(os, "sched_getaffinity")
        monkeypatch.delattr(os, "geteuid")
    return str(request.param)


def test_a_file_is_locked_for_one_and_its_place_is_kept(branch: str, tmp_path: Path) -> None:
    path = tmp_path / "lock"
    path.write_bytes(b"12345")
    with path.open("rb+") as mine, path.open("rb+") as other:
        mine.seek(3)
        system.lock_file(mine.fileno())
        assert os.lseek(mine.fileno(), 0, os.SEEK_CUR) == 3
        if branch != "neither":
            with pytest.raises(BlockingIOError):
                system.lock_file(other.fileno())
    with path.open("rb+") as later:
        system.lock_file(later.fileno())


def test_a_folder_is_opened_locked_and_let_go(branch: str, tmp_path: Path) -> None:
    folder, link = tmp_path / "folder", tmp_path / "link"
    folder.mkdir()
    link.symlink_to(folder)
    mine, other = system.open_folder(folder), system.open_folder(link)
    done = True if branch == "this system" else None
    assert system.lock_if_any(mine) is done
    assert system.lock_if_any(other, wait=False) is (False if done else None)
    # By number: the system says its errors in the language of whoever asked first.
    refusal = errno.EWOULDBLOCK if done else errno.ENOLCK
    with pytest.raises(OSError, match=rf"\[Errno {refusal}\]"):
        system.lock_folder(other, shared=True, wait=False)
    assert system.is_open_at(mine, folder)
    system.unlock_folder(mine)
    assert system.lock_if_any(other, wait=False) is done
    system.close_folder(other)
    system.sync_folder(folder)
    (folder / "written").write_bytes(b"1")
    system.sync_file(folder / "written")
    for path, links in ((tmp_path / "none", True), (link, False)):
        with pytest.raises((FileNotFoundError, NotADirectoryError)):
            system.open_folder(path, links=links)


def test_a_process_is_ended(branch: str) -> None:
    child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"], start_new_session=True)
    system.end_group(child)
    assert child.wait(timeout=30) != 0
    system.end_group(child)  # one that has ended is no error


def test_figures_of_the_system(branch: str) -> None:
    assert system.processors() >= 1
    assert system.is_administrator() in ((True, False) if branch == "this system" else (False,))


def test_a_limit_of_memory_that_does_not_exist_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(system, "_module", lambda _: None)
    system.limit_memory(1)  # a byte would end this process
    calls: list[object] = []
    limits = SimpleNamespace(
        RLIMIT_AS=9, RLIM_INFINITY=-1, getrlimit=lambda _: (5, 100),
        setrlimit=lambda *words: calls.append(words),
    )  # fmt: skip
    monkeypatch.setattr(system, "_module", lambda _: limits)
    system.limit_memory(200)
    assert calls == [(9, (100, 100))]  # a lower limit that stands is kept


def test_the_whole_path_without_what_windows_lacks(tmp_path: Path) -> None:
    """No fcntl, resource, fork, alarm, process group; folders that cannot be opened. Not a run on Windows."""
    session, test = EXAMPLES / "session_plan.toml", tmp_path / "test_plan.toml"
    assert read_plan(session) is not None
    plan = (EXAMPLES / "test_plan.toml").read_text()
    test.write_text(plan.replace("rows_per_revolution = 100", "rows_per_revolution = 4"))
    make(tmp_path, p("{{tk:test.name}}"), name="short.docx")
    words = [
        ["init", "lab"],
        ["simulate", str(session), "--out", "session", "--home", "lab", "-q"],
        ["calibrate", "session/SESSION.toml", "--home", "lab", "-q"],
        ["calibration", "approve", "m15-virtual-r1", "--in-force-from", "2026-03-03", "--checked-by",
         "second person", "--reason", "the first record of this home", "--home", "lab", "-q"],
        ["calibration", "verify", "--home", "lab", "-q"],
        ["simulate", str(test), "--out", "test", "--home", "lab", "-q"],
        ["process", "test", "--out", "test.xlsx", "--home", "lab", "-q"],
        ["audit", "test", "--out", "audit", "--home", "lab", "-q"],
        ["report", "test.xlsx", "--template", "short.docx", "--out", "out", "--home", "lab", "-q"],
    ]  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-c", LIKE_WINDOWS.replace("WORDS", repr(words))], cwd=tmp_path, check=False,
        capture_output=True, text=True, timeout=300,
        env={name: text for name, text in os.environ.items() if name != "TOOLKIT_SOFFICE"},
    )  # fmt: skip
    # 1 is a finding: the virtual test's own FY and MZ are wrong on purpose.
    assert done.stdout.split("CODES")[-1].split() == [*"000000111"], done.stdout + done.stderr
    assert (tmp_path / "out" / "report.pdf").is_file()
    assert not [
        path for path in tmp_path.rglob("*") if path.name.startswith(".toolkit-") or path.name == ".lock"
    ]


def test_modules_that_only_some_systems_have_are_imported_in_two_places() -> None:
    root = Path(system.__file__).parent
    foreign = re.compile(r"(?m)^\s*(?:import|from) (?:fcntl|resource|pwd|grp|termios|msvcrt)\b")
    places = {
        path.relative_to(root).as_posix() for path in root.rglob("*.py") if foreign.search(path.read_text())
    }
    assert places <= {"system.py", "worker/posix.py"}


@pytest.mark.parametrize(("said", "threads"), [(None, "1"), ("3", "3")])
def test_the_command_line_keeps_linear_algebra_on_one_thread(monkeypatch, said, threads):
    """Two threads on a shared core wait for each other: a decomposition took a hundred times as long."""
    for name in system.THREADS:
        monkeypatch.delenv(name, raising=False)
        if said is not None:
            monkeypatch.setenv(name, said)
    monkeypatch.setattr("sys.argv", ["toolkit", "fit", "--help"])
    with pytest.raises(SystemExit):
        main()
    assert {os.environ[name] for name in system.THREADS} == {threads}
