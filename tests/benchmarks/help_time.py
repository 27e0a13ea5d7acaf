"""`toolkit --help` as a whole process; the peer is the interpreter that imports nothing."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from tests.benchmarks.timing import pairs, row


def run(_folder: Path, count: int) -> list[dict[str, object]]:
    """Time the command and the bare interpreter."""
    ours = [str(Path(sys.executable).with_name("toolkit")), "--help"]
    bare = [sys.executable, "-c", "pass"]
    times = pairs(
        lambda: subprocess.run(ours, check=True, capture_output=True),
        lambda: subprocess.run(bare, check=True, capture_output=True),
        count,
    )
    return [row("toolkit --help", times[0], "python -c pass", times[1], "0.3 s")]
