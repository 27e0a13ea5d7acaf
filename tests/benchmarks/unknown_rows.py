"""`toolkit inspect` and `toolkit process` on one long CSV file, whose Fy and Mz no record computed.

The peer is the same file with Fy and Mz by a record of the registry. Both grow over a decade of rows, which a
linear cost multiplies by ten at most; what is printed in few digits meets thousands of candidates by chance.
UNKNOWN_ROWS=20000 in the environment makes a short run.
"""

from __future__ import annotations

import os
from functools import partial
from pathlib import Path

import numpy as np

from tests.benchmarks.archive_factory import EDITIONS, HEADERS, LOADS
from tests.benchmarks.timing import row, run_command

ROWS = int(os.environ.get("UNKNOWN_ROWS", "2000000"))
_PAIRS = 3
_AT_A_TIME = 50_000
_UNKNOWN = (0.9831, 1.0112, 0.9927, 0.31), (-0.1511, 0.1655, 0.0131, 0.4)
_KNOWN = EDITIONS[1][1:]


def run(folder: Path, count: int) -> list[dict[str, object]]:
    """Time both files at both lengths, pair by pair, and take the peaks of memory."""
    from toolkit.lab.home import packaged_home

    work = folder / "unknown-rows"
    work.mkdir()
    home = ["--calibrations", str(packaged_home() / "calibrations")]
    inspect = partial(_inspected, home)
    few, many = ROWS // 10, ROWS
    kinds = {"known": (_KNOWN, 4), "unknown": (_UNKNOWN, 4), "in few digits": (_UNKNOWN, 1)}
    files = {
        (name, rows): _written(work / f"{name} {rows}" / "M15_1.csv", rows, *kind)
        for name, kind in kinds.items()
        for rows in (few, many)
    }
    times: dict[tuple[str, int], list[tuple[float, float]]] = {key: [] for key in files}
    for _ in range(min(count, _PAIRS)):
        for key, file in files.items():
            times[key].append(inspect(file))
    seconds = {key: [s for s, _ in measured] for key, measured in times.items()}
    peak = {key: [MB for _, MB in measured] for key, measured in times.items()}
    process = ["process", str(files["unknown", many].parent), "--draft", *home]
    processed = run_command(process)
    known, unknown = ("known", many), ("unknown", many)
    what, shorter = f"inspect of {many} rows", f"{few} rows"
    return [
        row(f"{what}, unknown", seconds[unknown], "by a record", seconds[known], "3"),
        row(f"{what}, unknown, in few digits", seconds["in few digits", many],
            "by a record", seconds[known], "3"),
        row(f"{what}, unknown", seconds[unknown], shorter, seconds["unknown", few], "10"),
        row(f"{what}, by a record", seconds[known], shorter, seconds["known", few], "10"),
        row(f"{what}, unknown: peak memory", peak[unknown], shorter,
            peak["unknown", few], "10", unit="MB"),
        row(f"process of {many} rows", [processed[0]], "", None, ""),
        row(f"process of {many} rows: peak memory", [processed[1]], "a gigabyte", [1000.0], "1", unit="MB"),
    ]  # fmt: skip


def _inspected(home: list[str], file: Path) -> tuple[float, float]:
    return run_command(["inspect", str(file), "--machine", "m15", *home])


def _written(path: Path, rows: int, equations: tuple[tuple[float, ...], ...], decimals: int) -> Path:
    """Write a recording of five load blocks, in the columns of the machine, and its test.toml."""
    path.parent.mkdir()
    (path.parent / "test.toml").write_text('machine = "m15"\ndate = "2019-06-04"\n')
    rng = np.random.default_rng(rows)
    with path.open("w") as stream:
        stream.write(",".join(HEADERS) + "\n")
        for start in range(0, rows, _AT_A_TIME):
            n = min(_AT_A_TIME, rows - start)
            FZ = np.array(LOADS)[np.arange(start, start + n) * len(LOADS) // rows] + rng.normal(0, 3, n)
            share = np.array([[0.2], [0.2], [0.1]])
            D51, D52, E5 = np.round(share * FZ + rng.normal(0, 8, (3, n)), decimals)
            x = np.stack([D51, D52, E5, np.ones(n)])
            FY, MZ = (np.array(equation) @ x for equation in equations)
            table = np.round(np.stack([FZ, D52, D51, E5, rng.normal(1, 0.01, n), FY, MZ]), decimals)
            form = ",".join([f"%.{decimals}f"] * len(HEADERS)) + "\n"
            stream.writelines(form % tuple(line) for line in table.T.tolist())
    return path
