"""Coverage of calibration sessions: drawn whole, fitted, and what they say of themselves against the truth.

A cell of 2000 N per mV/V is loaded in five steps from zero to 4000 N, up and down in every run. The reference
standard reads what is applied; what is applied scatters about the steps; runs differ in zero and gain; the
cell's noise is white or an autoregression from row to row. Asked are U of a reading in a run to come, at zero
and at full scale, and the covariance of the coefficients that every test is handed, with k = 1.96.
"""

from __future__ import annotations

import itertools
import tempfile
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tests.coverage.rows import CoverageRow, row_of
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.stored import stored_loads
from toolkit.calibration.uncertainty.budget import predict
from toolkit.calibration.uncertainty.common_errors import record_covariance

FULL = 4000.0
SENSITIVITY = 2000.0
NOISE = 0.8
RUN_ZERO = 3.0
RUN_GAIN = 2.0
CORRELATION = 0.8
SCATTERS = (0.0, 5e-6, 5e-5, 5e-4)
QUANTITIES = ("reading at zero", "reading at full scale", "curve at zero", "curve at full scale", "slope")

_SESSION = """schema = 1
instrument = "cell"
date = 2026-02-01
operator = "first person"
indications = ["S"]
loads = ["F"]
data = "loads.csv"
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawn:
    """How sessions of one row of the table are drawn; ``scatter`` of the applied loads, of full scale."""

    runs: int
    scatter: float
    run_effects: bool
    correlated: bool

    @property
    def text(self) -> str:
        """The condition in words."""
        return (
            f"{self.runs} runs, loads scatter {100 * self.scatter:g} %, "
            f"{'zeros and gains differ' if self.run_effects else 'equal runs'}, "
            f"{'AR(0.8)' if self.correlated else 'white'} noise"
        )


CELLS = tuple(
    Drawn(runs=runs, scatter=scatter, run_effects=effects, correlated=correlated)
    for runs, scatter, effects, correlated in itertools.product(
        (3, 6), SCATTERS, (False, True), (False, True)
    )
)


def table(repetitions: int, seed: int, workers: int, cells: Sequence[Drawn] = CELLS) -> list[CoverageRow]:
    """Return the rows of every cell, each with ``repetitions`` sessions."""
    jobs = [(cell, repetitions, seed + at) for at, cell in enumerate(cells)]
    if workers == 1:
        return [row for job in jobs for row in rows_of_cell(*job)]
    with ProcessPoolExecutor(workers) as pool:
        return [row for rows in pool.map(rows_of_cell, *zip(*jobs, strict=True)) for row in rows]


def rows_of_cell(cell: Drawn, repetitions: int, seed: int) -> list[CoverageRow]:
    """Return one row a quantity."""
    rng = np.random.default_rng(seed)
    seen: dict[str, list[tuple[float, float, float]]] = {name: [] for name in QUANTITIES}
    for _ in range(repetitions):
        with tempfile.TemporaryDirectory() as folder:
            for name, outcome in _session(cell, rng, Path(folder)).items():
                seen[name].append(outcome)
    return [
        row_of(name, cell.text, errors=errors, u=u, U=U)
        for name, outcomes in seen.items()
        for errors, u, U in [zip(*outcomes, strict=True)]
    ]


def _session(cell: Drawn, rng: np.random.Generator, folder: Path) -> dict[str, tuple[float, float, float]]:
    """Return error, u and U [N] of each quantity for one session drawn anew."""
    zeros, gains = _runs(cell, rng, cell.runs)
    lines = ["S [mV/V],F [N],run,direction"]
    steps = np.linspace(0.0, FULL, 5)
    schedule = np.concatenate([steps, steps[::-1]])
    for run in range(cell.runs):
        applied = schedule + rng.normal(0.0, cell.scatter * FULL, len(schedule))
        read = applied + zeros[run] + gains[run] * applied / FULL + _noise(cell, rng, len(schedule))
        lines += [
            f"{float(x)!r},{float(y)!r},{run + 1},{'up' if at < len(steps) else 'down'}"
            for at, (x, y) in enumerate(zip(read / SENSITIVITY, applied, strict=True))
        ]
    (folder / "loads.csv").write_text("\n".join(lines) + "\n")
    (folder / "SESSION.toml").write_text(_SESSION)
    registry = Registry(folder / "calibrations")
    record = calibrate(folder / "SESSION.toml", registry).record
    loads = stored_loads(registry.folder, record)
    assert loads is not None
    found: dict[str, tuple[float, float, float]] = {}
    zero, gain = (values[0] for values in _runs(cell, rng, 1))
    covariance = record_covariance(record)["F"]
    (fit,) = record.loads
    c = np.asarray(fit.coefficients)
    for name, load in (("zero", 0.0), ("full scale", FULL)):
        read = load + zero + gain * load / FULL + rng.normal(0.0, NOISE)
        budget = predict(record, loads, None, "F", {"S": read / SENSITIVITY}).budget
        found[f"reading at {name}"] = (budget.at - load, budget.u, budget.U)
        J = np.array([load / SENSITIVITY, 1.0])
        found[f"curve at {name}"] = _normal(float(J @ c) - load, J, covariance)
    J = np.array([1.0, 0.0])
    found["slope"] = _normal(float(J @ c) - SENSITIVITY, J, covariance)
    return found


def _runs(
    cell: Drawn, rng: np.random.Generator, count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    size = 1.0 if cell.run_effects else 0.0
    return rng.normal(0.0, RUN_ZERO * size, count), rng.normal(0.0, RUN_GAIN * size, count)


def _noise(cell: Drawn, rng: np.random.Generator, count: int) -> NDArray[np.float64]:
    e = rng.normal(0.0, NOISE, count)
    if cell.correlated:
        for at in range(1, count):
            e[at] = CORRELATION * e[at - 1] + np.sqrt(1 - CORRELATION**2) * e[at]
    return e


def _normal(
    error: float, J: NDArray[np.float64], covariance: NDArray[np.float64]
) -> tuple[float, float, float]:
    u = float(np.sqrt(J @ covariance @ J))
    return error, u, 1.959964 * u
