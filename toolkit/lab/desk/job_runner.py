"""The process of a job: it runs the command, ends it when somebody asks, and writes down how it ended.

It inherits the lock of the home's jobs, and the command does after it: whichever of the two lives keeps it.
``python -m toolkit.lab.desk.job_runner FOLDER LOCK``, with the number of the lock's descriptor.
"""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from toolkit.lab.desk.jobs import CANCEL, PROGRESS, ended, read_job, write_job
from toolkit.lab.progress_note import VARIABLE

_COMMAND = "from toolkit.cli.main import run; run()"
_LOOK = 0.2  # seconds between two looks at the command and at what is asked
_GRACE = 10.0  # seconds in which a command that is to end may clean up


def run_job(place: Path, lock: int) -> int:
    """Run the command of a job's folder, and return its exit code."""
    job = read_job(place)
    asked = False

    def ask(_number: int, _frame: object) -> None:
        nonlocal asked
        asked = True

    signal.signal(signal.SIGTERM, ask)  # the computer shuts down
    command = subprocess.Popen(
        [sys.executable, "-c", _COMMAND, *job.words],
        stdin=subprocess.DEVNULL, env=os.environ | {VARIABLE: str(place / PROGRESS)}, process_group=0,
        pass_fds=(lock,),
    )  # fmt: skip
    while command.poll() is None:
        if asked or (place / CANCEL).exists():
            asked = True
            _end(command)
            break
        time.sleep(_LOOK)
    code = command.wait()
    write_job(place, ended(place, job, code, cancelled=asked))
    return code


def _end(command: subprocess.Popen[bytes]) -> None:
    """End a command with all its processes: first asked, then made to."""
    _signal(command, signal.SIGTERM)
    with contextlib.suppress(subprocess.TimeoutExpired):
        command.wait(_GRACE)
    _signal(command, signal.SIGKILL)


def _signal(command: subprocess.Popen[bytes], number: signal.Signals) -> None:
    try:
        os.killpg(command.pid, number)
    except ProcessLookupError:
        return


if __name__ == "__main__":
    run_job(Path(sys.argv[1]), int(sys.argv[2]))
