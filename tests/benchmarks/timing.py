"""Timing of pairs: ours and a peer in turn."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable


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
