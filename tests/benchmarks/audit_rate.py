"""`toolkit audit` on an archive of 5 000 recordings whose grades were decided when they were made.

Peers: a plain script (pandas on openpyxl, least squares, comparison with every calibration) on one core, on
a sample; and the gate with python-calamine alone, which reads every cell, in the same workers, on all of
it. A dask cluster of one and two workers on loopback has a smaller archive. A wrong grade, or another answer
of the cluster, ends the run with an error: no rate counts beside it. AUDIT_FILES=400 in the environment
makes a short run.
"""

from __future__ import annotations

import os
import statistics
import time
import warnings
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from tests.benchmarks.archive_factory import (
    CELLS,
    EDITIONS,
    HEADERS,
    KNOWN_AT,
    Archive,
    compare,
    make_archive,
)
from tests.benchmarks.timing import row, run_command

FILES, WORKERS = int(os.environ.get("AUDIT_FILES", "5000")), 2
FEW = max(FILES // 10, 40)
_SAMPLE = 150
_PAIRS = 3


def run(folder: Path, count: int) -> list[dict[str, object]]:
    """Time the audit against its peers, then a second run, memory, and hold every grade against the truth."""
    from toolkit.audit.archive import audit_archive, inventory
    from toolkit.calibration.registry.registry import Registry

    big = make_archive(folder / "big", files=FILES)
    names = inventory(big.folder).files
    registry = Registry(big.calibrations)
    made: list[Any] = []

    def audit(workers: int = WORKERS, out: Path | None = None) -> None:
        made[:] = [audit_archive(big.folder, registry, known_at=KNOWN_AT, workers=workers, out=out)]

    ours, reader = _in_turn(audit, partial(_read_all, big.folder, names), min(count, _PAIRS))
    sample = names[:: max(1, len(names) // _SAMPLE)]
    plain = [_seconds(partial(_plain_script, big.folder, sample)) * len(names) / len(sample) for _ in ours]
    exact = _check(big, made[0].files.plain())
    first = _seconds(partial(audit, out=folder / "out"))
    again = [_seconds(partial(audit, out=folder / "out")) for _ in range(3)]
    single = _seconds(partial(audit, 1))
    small = make_archive(folder / "small", files=FEW)
    cluster = _clustered(small)
    peak = {one.folder: _peak_MB(one) for one in (small, big)}
    head = f"audit of {FILES}"
    return [
        row(f"{head}, {WORKERS} workers{_rate(ours)}", ours,
            f"pandas on openpyxl, one core (sampled){_rate(plain)}", plain, "0.083"),
        row(f"{head}, {WORKERS} workers{_rate(ours)}", ours,
            f"gate and calamine, same workers{_rate(reader)}", reader, "1.43"),
        row(f"{head}, second run{_rate(again)}", again,
            f"the first run{_rate([first])}", [first] * len(again), "0.05"),
        row(f"{head}, 1 worker{_rate([single])}", [single], f"{WORKERS} workers", [min(ours)], ""),
        row(f"audit of {FEW}, 2 dask workers{_rate([cluster[2]], FEW)}", [cluster[2]],
            f"1 dask worker{_rate([cluster[1]], FEW)}", [cluster[1]], ""),
        row(f"wrong grades of {len(big.truth)} (of {exact} exact: 0 false)", [0.0], "", None, "0", unit=""),
        row(f"peak memory at {FILES} files", [peak[big.folder]], f"at {FEW} files",
            [peak[small.folder]], "1.1", unit="MB"),
    ]  # fmt: skip


def _rate(seconds: list[float], files: int = FILES) -> str:
    return f", {files / statistics.median(seconds):.0f}/s"


def _check(archive: Archive, files: Iterable[dict[str, Any]]) -> int:
    """Return how many files are exact, as they were made.

    Raises
    ------
    RuntimeError
        a grade, record, variant or segment is wrong
    """
    told = list(files)
    wrong = compare(archive.truth, {"files": told})
    false = [one["path"] for one in told if one["grade"] == "exact" != archive.truth[one["path"]].grade]
    if wrong or false:
        lines = "\n".join(wrong[:20])
        raise RuntimeError(
            f"{len(wrong)} of {len(told)} files are wrong, {len(false)} a false exact:\n{lines}"
        )
    return sum(one["grade"] == "exact" for one in told)


def _clustered(archive: Archive) -> dict[int, float]:
    """Return the seconds of an audit by one and by two workers of a dask cluster on loopback.

    Raises
    ------
    RuntimeError
        their answer is not that of a worker here
    """
    import distributed

    from toolkit.audit.archive import audit_archive
    from toolkit.calibration.registry.registry import Registry

    registry = Registry(archive.calibrations)
    here = audit_archive(archive.folder, registry, known_at=KNOWN_AT, workers=1).files
    seconds: dict[int, float] = {}
    for count in (1, 2):
        with distributed.LocalCluster(  # type: ignore[no-untyped-call]
            n_workers=count, threads_per_worker=1, host="127.0.0.1", dashboard_address=None
        ) as cluster:
            audit = partial(
                audit_archive,
                archive.folder,
                registry,
                known_at=KNOWN_AT,
                scheduler=cluster.scheduler_address,
            )
            if audit().files != here:  # warm, too
                raise RuntimeError(f"{count} dask workers do not answer as a worker here")
            seconds[count] = _seconds(audit)
    return seconds


def _seconds(work: Callable[[], object]) -> float:
    started = time.perf_counter()
    work()
    return time.perf_counter() - started


def _in_turn(
    ours: Callable[[], object], peer: Callable[[], object], count: int
) -> tuple[list[float], list[float]]:
    pairs = [(_seconds(ours), _seconds(peer)) for _ in range(count)]
    return [a for a, _ in pairs], [b for _, b in pairs]


class _Reader:
    # The gate and python-calamine, nothing else.
    def __init__(self, folder: Path) -> None:
        from toolkit.machine import load_machine

        self.folder, self.machine = folder, load_machine("m15")

    def __call__(self, name: str) -> int:
        from toolkit.errors import ToolkitError
        from toolkit.recording.columns import header_of
        from toolkit.recording.safe_open import gate
        from toolkit.recording.xlsx import read_sheet

        try:
            return len(read_sheet(gate(self.folder / name), header_of(self.machine), grids=False)[1].rows)
        except ToolkitError:
            return 0


def _read_all(folder: Path, names: tuple[str, ...]) -> None:
    from toolkit.audit.workers import run_isolated

    for _ in run_isolated(partial(_Reader, folder), names, workers=WORKERS):
        pass


def _plain_script(folder: Path, names: tuple[str, ...]) -> list[str]:
    # What an engineer writes in an afternoon: fit each file, name the calibration that is nearest.
    import pandas as pd

    told = []
    for name in names:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                table = pd.read_excel(folder / name, engine="openpyxl")
        except Exception:  # noqa: BLE001  a plain script
            told.append("unreadable")
            continue
        x = table[[f"{cell} (Filtered)" for cell in CELLS]].to_numpy()
        design = np.column_stack([x, np.ones(len(x))])
        found = [np.linalg.lstsq(design, table[y].to_numpy(), rcond=None)[0] for y in HEADERS[-2:]]
        off = [
            max(
                float(np.abs(design @ (f - np.array(e))).max())
                for f, e in zip(found, edition[1:], strict=True)
            )
            for edition in EDITIONS
        ]
        told.append(f"m15-r{int(np.argmin(off)) + 1}")
    return told


def _peak_MB(archive: Archive) -> float:
    words = ["audit", str(archive.folder), "--calibrations", str(archive.calibrations), "--workers",
             str(WORKERS), "--json"]  # fmt: skip
    return run_command(words)[1]
