"""After a kill -9 nothing runs on and nothing is left; a parent that cleans up itself is not disturbed."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import pytest

from toolkit.report.word.office import Guard

_PARENT = """
import os, subprocess, sys, time
from pathlib import Path
from toolkit.report.word.office import Guard
folder = Path(sys.argv[1])
guard = Guard(folder)
# As LibreOffice is started: a session of its own, the folder's name among its words.
sleeper = [sys.executable, "-c", "import time; time.sleep(600)", f"file://{folder}/profile"]
if sys.argv[2] == "late":
    # Its own command line begins some time after the parent's death, as while a program is being loaded.
    sleeper = ["/bin/sh", "-c", 'sleep 1; exec "$PYTHON" -c "import time; time.sleep(600)" "$PROFILE"']
words = {"PYTHON": sys.executable, "PROFILE": f"file://{folder}/profile"}
child = subprocess.Popen(sleeper, start_new_session=True, env={**os.environ, **words})
print(child.pid, flush=True)
time.sleep(600)
"""


def _until(asked: object) -> bool:
    end = time.monotonic() + 60
    while time.monotonic() < end:
        if asked():  # type: ignore[operator]
            return True
        time.sleep(0.05)
    return False


def _runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.parametrize("started", ["early", "late"])
def test_what_a_killed_parent_leaves_is_taken_away(tmp_path: Path, started: str) -> None:
    folder = tmp_path / f"office-{started} 'of [this] test'"
    (folder / "profile").mkdir(parents=True)
    beside = tmp_path / "office-other"
    beside.mkdir()
    parent = subprocess.Popen(
        [sys.executable, "-c", _PARENT, folder, started], stdout=subprocess.PIPE, text=True
    )
    assert parent.stdout is not None
    child = int(parent.stdout.readline())
    assert _runs(child)
    parent.kill()
    parent.wait()
    parent.stdout.close()
    assert _until(lambda: not _runs(child))
    assert _until(lambda: not folder.exists())
    assert beside.exists()


def test_a_guard_that_was_sent_away_takes_nothing(tmp_path: Path) -> None:
    folder = tmp_path / "office"
    folder.mkdir()
    guard = Guard(folder)
    guard.dismiss()
    assert guard._process.returncode is not None
    assert folder.exists()
