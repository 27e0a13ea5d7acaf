"""Running the tool, as a user does: `toolkit diagnose` once on every case, resumable, the answers still
sealed."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from proof.files import SESSIONS, enter
from proof.seal import verify


def _one_thread() -> dict[str, str]:
    """Return the environment with one thread for each process: the workers share the cores."""
    return {
        **os.environ,
        **dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"),
    }


def run_case(case: Path, out: Path, tool: list[str], budget: float) -> dict[str, Any]:
    """Run one case and store how it went beside its answer; what is done is not done again."""
    log = out / "run.json"
    if log.exists():
        done: dict[str, Any] = json.loads(log.read_text(encoding="utf-8"))
        return done
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    start = time.monotonic()
    command = [*tool, "diagnose", str(case / "CASE.toml"), "--out", str(out / "answer")]
    command += ["--budget", f"{budget:g}"]
    if (case / SESSIONS).is_dir():  # the laboratory's registry, entered as its owner does
        enter(sorted((case / SESSIONS).iterdir()), out / "calibrations", tool)
        command += ["--calibrations", str(out / "calibrations")]
    try:
        ran = subprocess.run(
            command, capture_output=True, text=True, timeout=3 * budget + 60, check=False, env=_one_thread()
        )
        code, text = ran.returncode, (ran.stderr or ran.stdout)[-2000:]
    except subprocess.TimeoutExpired:
        code, text = 124, "no answer within three budgets"
    row = {"case": case.name, "exit": code, "seconds": round(time.monotonic() - start, 2)}
    if code not in (0, 1):
        row["message"] = text
    part = out / "run.json.part"
    part.write_text(json.dumps(row) + "\n", encoding="utf-8")
    part.replace(log)
    return row


def run_batch(
    folder: Path,
    *,
    tool: list[str],
    workers: int,
    budget: float,
    progress: Callable[[str], None] = lambda _: None,
) -> list[dict[str, Any]]:
    """Run every case of a batch once; return how each went, in the cases' order."""
    verify(folder)
    cases = sorted(p for p in (folder / "cases").iterdir() if p.is_dir())
    rows = []
    with ThreadPoolExecutor(max_workers=workers) as pool:
        jobs = [pool.submit(run_case, case, folder / "runs" / case.name, tool, budget) for case in cases]
        for i, job in enumerate(jobs):
            rows.append(job.result())
            progress(f"{i + 1}/{len(cases)} {rows[-1]['case']} {rows[-1]['seconds']:.0f} s")
    return rows


def answer_of(folder: Path, case: str) -> dict[str, Any] | None:
    """Return the tool's answer for a case; None where there is none that can be read."""
    path = folder / "runs" / case / "answer" / "diagnosis.json"
    try:
        found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) and "verdict" in found else None
