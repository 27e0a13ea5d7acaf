"""Timing of pairs: ours and a peer in turn."""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path


def pairs(
    ours: Callable[[], object], peer: Callable[[], object], count: int
) -> tuple[list[float], list[float]]:
    """Return the seconds of ``count`` pairs after one warm-up of each."""
    ours()
    peer()
    found: tuple[list[float], list[float]] = ([], [])
    for _ in range(count):
        for work, times in zip((ours, peer), found, strict=True):
            started = time.perf_counter()
            work()
            times.append(time.perf_counter() - started)
    return found


def row(
    what: str, ours: list[float], peer_name: str, peer: list[float] | None, aim: str, *, unit: str = "s"
) -> dict[str, object]:
    """Return one line of the result: medians in ``unit``, and the median of the ratios pair by pair."""
    ratio = statistics.median(a / b for a, b in zip(ours, peer, strict=True)) if peer else None
    return {
        "what": what,
        "ours_s": statistics.median(ours),
        "peer": peer_name,
        "peer_s": statistics.median(peer) if peer else None,
        "ratio": ratio,
        "aim": aim,
        "pairs": len(ours),
        "unit": unit,
    }


def run_command(words: list[str]) -> tuple[float, float]:
    """Return the seconds that `toolkit` takes with these words, and its peak memory [MB].

    The peak is that of the largest of its processes, as the kernel has it of each.

    Raises
    ------
    RuntimeError
        the command cannot use what it was given
    """
    started = time.perf_counter()
    program = str(Path(sys.executable).with_name("toolkit"))
    child = subprocess.Popen([program, *words], stdout=subprocess.DEVNULL)
    peak = 0.0
    while child.poll() is None:
        peak = max(peak, *(high_water_MB(pid) for pid in (child.pid, *_children(child.pid))))
        time.sleep(0.02)
    if child.returncode not in (0, 1):
        raise RuntimeError(f"toolkit {' '.join(words)}: exit code {child.returncode}")
    return time.perf_counter() - started, peak


def _children(pid: int) -> list[int]:
    try:
        return [int(one) for one in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    except OSError:
        return []


def high_water_MB(pid: int) -> float:
    """Return the most memory [MB] that a process has had, 0 where it is no more."""
    # Of this program alone: what wait4 tells includes the process that started it.
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return 0.0
    return next((int(line.split()[1]) / 1024 for line in lines if line.startswith("VmHWM")), 0.0)
