"""``toolkit diagnose`` on a case that a benchmark has written: its answer and its processor time."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
from pathlib import Path
from typing import Any

from toolkit.errors import ToolkitError


def answer_of(case: Path, out: Path, *, budget_s: float) -> tuple[dict[str, Any], float]:
    """Return the answer, and the processor time [s] of the processes that have ended by themselves.

    Raises
    ------
    ToolkitError : where the command ends with an error
    """
    command = [sys.executable, "-m", "toolkit", "diagnose", str(case), "--out", str(out)]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    run = subprocess.run(
        [*command, "--budget", str(budget_s), "--quiet"],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ,
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if run.returncode not in (0, 1):
        raise ToolkitError(
            f"the diagnosis ended with exit code {run.returncode}", where=case, got=run.stderr.strip()[-400:]
        )
    answer = json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))
    return answer, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def entry(effect: dict[str, Any]) -> str:
    """Return an effect's name with the other names of its class."""
    return " = ".join([effect["name"], *effect["equivalent_to"]])
