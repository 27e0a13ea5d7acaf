"""Reports in numbers: many figures (`full_report`), ten in one command against ten, and peak memory."""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
import sys
import threading
from pathlib import Path

from tests.benchmarks.full_report import FIGURES, TABLES
from tests.benchmarks.timing import pairs, row
from tests.benchmarks.virtual import virtual_test
from toolkit.lab.home import packaged_home

_TOOLKIT = str(Path(sys.executable).with_name("toolkit"))


def run(folder: Path, count: int) -> list[dict[str, object]]:
    """Time the full report against the bare conversion, one command against ten, and weigh the full one."""
    test, home = virtual_test(folder), packaged_home()
    reduced = folder / "test.xlsx"
    _call([_TOOLKIT, "process", str(test), "--home", str(home), "--out", str(reduced), "--quiet"])
    out, bare = folder / "full", folder / "bare"
    full = [sys.executable, "-m", "tests.benchmarks.full_report", str(reduced), str(home), str(out)]

    def convert() -> None:
        profile = folder / "profile"
        shutil.rmtree(profile, ignore_errors=True)
        _call(["soffice", f"-env:UserInstallation=file://{profile}", "--headless", "--convert-to", "pdf",
               "--outdir", str(bare), str(out / "report.docx")])  # fmt: skip

    times = pairs(lambda: _call(full), convert, count)
    rows = [
        row(
            f"report, {FIGURES} figures and {TABLES} tables (whole process)",
            times[0],
            "soffice converts its docx",
            times[1],
            "2",
        )
    ]
    peak = peak_MB(full)
    rows.append(row(f"the same, peak memory of all its processes {peak:.0f} MB", times[0], "", None, ""))
    tests = []
    for i in range(10):
        shutil.copytree(test, folder / f"ten-{i}", dirs_exist_ok=True)
        tests.append(str(folder / f"ten-{i}"))
    words = ["--home", str(home), "--quiet", "--out"]

    def one_command() -> None:
        _call([_TOOLKIT, "report", *tests, *words, str(folder / "one")])

    def ten_commands() -> None:
        for index, each in enumerate(tests):
            _call([_TOOLKIT, "report", each, *words, str(folder / f"out-{index}")])

    pair = pairs(one_command, ten_commands, max(1, count // 3))
    return [*rows, row("ten reports in one command", pair[0], "ten commands", pair[1], "1")]


def peak_MB(command: list[str]) -> float:
    """Return the largest resident memory of a command and of all that it starts, summed [MB]."""
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, start_new_session=True)
    peak = 0
    watcher = threading.Event()
    while process.poll() is None:
        peak = max(peak, sum(_resident(pid) for pid in _session(process.pid)))
        watcher.wait(0.02)
    return peak / 2**20


def _session(leader: int) -> list[int]:
    """Return the processes below one, by their parents: LibreOffice and the drawers have their own groups."""
    parents: dict[int, int] = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            with contextlib.suppress(OSError, IndexError, ValueError):
                parents[int(entry.name)] = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
    found, more = {leader}, True
    while more:
        below = {pid for pid, parent in parents.items() if parent in found} - found
        found |= below
        more = bool(below)
    return list(found)


def _resident(pid: int) -> int:
    with contextlib.suppress(OSError, IndexError, ValueError):
        return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    return 0


def _call(command: list[str]) -> None:
    # Findings are expected: the virtual acquisition program takes E5 with the wrong sign.
    done = subprocess.run(command, capture_output=True, check=False, timeout=3600)
    if done.returncode not in (0, 1):
        raise RuntimeError(done.stderr.decode("utf-8", "replace")[-2000:] or f"exit {done.returncode}")
