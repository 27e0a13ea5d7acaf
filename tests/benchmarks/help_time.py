"""`toolkit --help` and `--version` as whole processes; the peer is the interpreter that imports nothing."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from tests.benchmarks.timing import pairs, row


def run(_folder: Path, count: int) -> list[dict[str, object]]:
    """Time the command and the bare interpreter."""
    bare = [sys.executable, "-c", "pass"]
    rows = []
    for option, aim in (("--help", "0.15 s"), ("--version", "0.1 s")):
        ours = [sys.executable, "-m", "toolkit", option]
        times = pairs(
            lambda words=ours: subprocess.run(words, check=True, capture_output=True),  # type: ignore[misc]
            lambda: subprocess.run(bare, check=True, capture_output=True),
            count,
        )
        rows.append(row(f"toolkit {option}", times[0], "python -c pass", times[1], aim))
    return rows
