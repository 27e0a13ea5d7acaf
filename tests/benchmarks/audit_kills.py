"""`toolkit audit` of an archive while one of its workers is killed every few seconds.

The peer is the same audit that nobody disturbs. A file without its answer, or with another than that of the
undisturbed run, ends the benchmark with an error. KILLED_FILES=2000 in the environment makes a short run.
"""

from __future__ import annotations

import multiprocessing
import os
import time
from pathlib import Path

from tests.benchmarks.archive_factory import KNOWN_AT, make_archive
from tests.benchmarks.timing import row

FILES = int(os.environ.get("KILLED_FILES", "20000"))
_EVERY_S = 5.0
_WORKERS = 2


def run(folder: Path, count: int) -> list[dict[str, object]]:
    """Time both audits and compare every answer."""
    from toolkit.audit.archive import audit_archive
    from toolkit.calibration.registry.registry import Registry

    archive = make_archive(folder / "killed", files=FILES)
    registry = Registry(archive.calibrations)
    last, kills = time.monotonic(), 0

    def kill(_: str) -> None:
        nonlocal last, kills
        workers = multiprocessing.active_children()
        if workers and time.monotonic() - last > _EVERY_S:
            last, kills = time.monotonic(), kills + 1
            workers[kills % len(workers)].kill()

    began = time.perf_counter()
    whole = audit_archive(archive.folder, registry, known_at=KNOWN_AT, workers=_WORKERS)
    between = time.perf_counter()
    last = time.monotonic()
    again = audit_archive(archive.folder, registry, known_at=KNOWN_AT, workers=_WORKERS, step=kill)
    seconds = time.perf_counter() - between
    if again != whole or len(again.files) != len(archive.truth):
        raise RuntimeError("an audit whose workers are killed answers otherwise")
    what = f"audit of {FILES}, a worker killed each {_EVERY_S:g} s ({kills} in all)"
    return [row(what, [seconds], "undisturbed", [between - began], "1.5")]
