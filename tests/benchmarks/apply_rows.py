"""A million rows of six indications to six loads, each with its U; the floor reads and writes the same text.

Ours is `toolkit calibration apply` from CSV to CSV, its start included: the record is proven, the budget of
every row and load is made. The peer is pandas alone: it reads the same indications and writes the very
columns that ours wrote.
"""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from tests.benchmarks.timing import run_command

ROWS = 1_000_000
CELLS, LOADS = ("A", "B", "C", "D", "E", "F"), ("FX", "FY", "FZ", "MX", "MY", "MZ")
FULL = np.array([4000.0, 4000.0, 10000.0, 400.0, 400.0, 300.0])
LEVELS = (0.0, 0.25, 0.5, 0.75, 1.0, 0.5, 0.0)
SESSION = """
instrument = "six"
date = 2026-03-02
operator = "first person"
indications = ["A", "B", "C", "D", "E", "F"]
loads = ["FX", "FY", "FZ", "MX", "MY", "MZ"]
data = "loads.csv"
zero = "tared"
"""


def run(folder: Path, _count: int) -> list[dict[str, object]]:
    """Time one run of the command, and the floor in the same minute."""
    import pandas as pd

    work = folder / "apply"
    work.mkdir()
    rng = np.random.default_rng(6)
    sensitivity = np.diag(1 / FULL) + 1e-3 * rng.normal(size=(6, 6)) / FULL
    _session(work, sensitivity, rng)
    at = np.arange(ROWS) / 1000
    cells = (0.95 * FULL * np.sin(at[:, None] * np.arange(1, 7))) @ sensitivity.T
    cells += rng.normal(0, 1e-5, cells.shape)
    header = ["time [s]", *(f"{cell} [mV/V]" for cell in CELLS)]
    np.savetxt(
        work / "data.csv", np.column_stack([at, cells]), fmt=["%.3f"] + ["%.5f"] * 6, delimiter=",",
        header=",".join(header), comments="",
    )  # fmt: skip
    registry = ["--calibrations", str(work / "calibrations")]
    run_command(["calibrate", str(work / "SESSION.toml"), "--quiet", *registry])
    tare = ",".join(f"{cell}=0" for cell in CELLS)
    words = ["calibration", "apply", "six-r1", str(work / "data.csv"), "--tare", tare, "--draft", "--quiet"]
    ours, peak = run_command([*words, "--out", str(work / "out.csv"), *registry])
    written = pd.read_csv(work / "out.csv")
    started = time.perf_counter()
    pd.read_csv(work / "data.csv")
    written.to_csv(work / "floor.csv", index=False)
    floor = time.perf_counter() - started
    what, name = "10^6 rows to six loads, each with its U, CSV to CSV", "pandas reads and writes the same"
    return [
        {"what": what, "ours_s": ours, "peer": name, "peer_s": floor, "ratio": ours / floor, "aim": "5"},
        {"what": "its rows a second", "ours_s": ROWS / ours, "peer": name, "peer_s": ROWS / floor,
         "ratio": floor / ours, "aim": "-", "unit": "/s"},
        {"what": "its peak memory", "ours_s": peak, "peer": "", "peer_s": None, "ratio": None, "aim": "600",
         "unit": "MB"},
    ]  # fmt: skip


def _session(work: Path, sensitivity: np.ndarray, rng: np.random.Generator) -> None:
    rows = []
    for number in (1, 2, 3):
        for axis in range(6):
            for sign in (1, -1):
                for at, level in enumerate(LEVELS):
                    load = np.where(np.arange(6) == axis, sign * level * FULL, 0.0)
                    cells = sensitivity @ load + rng.normal(0, 1e-5, 6)
                    rows.append([number, "up" if at < 5 else "down", *cells.round(6), *load])
    header = ["run", "direction", *(f"{cell} [mV/V]" for cell in CELLS)]
    header += [f"{load} [{'N' if load[0] == 'F' else 'N*m'}]" for load in LOADS]
    text = "\n".join(",".join(map(str, row)) for row in [header, *rows])
    (work / "loads.csv").write_text(text + "\n")
    (work / "SESSION.toml").write_text(SESSION)
