"""What the worker costs a diagnosis: processor time of the whole command, with it and in one process.

The cases are those of the golden files, of kind `python` and `ode`, and one of 6 000 rows. Each side is a new
interpreter that reads the case, diagnoses it and writes the answer; its processor time is that of all its
processes. The ratio of a pair is what counts.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from tests.benchmarks.diagnose_nulls import draw
from tests.benchmarks.timing import row
from tests.golden.cases import CASES

_NAMES = ("python-friction", "python-friction-and-delay", "ode-drag", "tire-offset")
_RUN = "import toolkit; toolkit.diagnose({case!r}, in_process={alone}).save({out!r})"


def run(folder: Path, pairs: int) -> list[dict[str, object]]:
    """Return processor seconds of a diagnosis with its code in a worker, beside one process for all."""
    cases = {}
    for name in _NAMES:
        place = folder / name
        place.mkdir(parents=True)
        for file, text in CASES[name]().items():
            (place / file).write_text(text, encoding="utf-8")
        cases[name] = place / "CASE.toml"
    cases["tire, 6 000 rows"] = draw(folder / "long", 0.9, seed=1)
    rows = []
    for name, case in cases.items():
        apart, alone = [], []
        for _ in range(pairs):
            apart.append(_seconds(case, folder / "out", alone=False))
            alone.append(_seconds(case, folder / "out", alone=True))
        rows.append(row(f"diagnose in a worker: {name}", apart, "one process", alone, "1.05"))
    return rows


def _seconds(case: Path, out: Path, *, alone: bool) -> float:
    """Return the processor time of one command and of all processes that it waited for."""
    text = _RUN.format(case=str(case), alone=alone, out=str(out))
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    process = os.posix_spawn(sys.executable, [sys.executable, "-c", text], environment)
    _, status, used = os.wait4(process, 0)
    if status:
        raise RuntimeError(text)
    return used.ru_utime + used.ru_stime
