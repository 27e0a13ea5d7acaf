"""Coverage of U of a reading by a hub of six components, and of three: sessions drawn whole, as files.

Cells answer to loads by a matrix with crosstalk drawn anew for each session. A session applies single loads
up and down and some combined ones, in runs that differ in zero; the cells are noisy, and so is what the
reference reads. Held against the truth is U of `toolkit calibration budget`, for one reading of a combined
load in a run to come. Each component of a reading is counted: its error is mostly its own cell's.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.coverage.rows import CoverageRow, row_of
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.stored import stored_loads
from toolkit.calibration.uncertainty.budget import predict

LOADS = ("FX", "FY", "FZ", "MX", "MY", "MZ")
UNITS = ("N", "N", "N", "N*m", "N*m", "N*m")
FULL = np.array([5000.0, 6000.0, 9000.0, 1800.0, 900.0, 250.0])
NOISE = 2e-4  # of full indication, of each reading
REFERENCE = 1e-4  # of full scale


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """Components of the hub, runs of a session, how far their zeros differ, of full indication."""

    components: int
    runs: int
    run_zero: float = 0.0
    combined: int = 6

    @property
    def name(self) -> str:
        """How the table names it."""
        zeros = f"zeros differ by {100 * self.run_zero:g} %" if self.run_zero else "equal runs"
        return f"{self.components} components, {self.runs} runs, {zeros}, {self.combined} combined loads"


CELLS = (
    Cell(components=3, runs=3),
    Cell(components=6, runs=3),
    Cell(components=6, runs=5, run_zero=5e-4),
    Cell(components=6, runs=2, combined=12),
)


def errors_of(cell: Cell, rng: np.random.Generator) -> list[tuple[float, float, float]]:
    """Return error, u and U of a reading of every component, in parts of full scale."""
    size = cell.components
    names, full = LOADS[-size:], FULL[-size:]
    # What each cell says of full loads: near one for its own, a twentieth for others.
    matrix = np.eye(size) + rng.normal(0.0, 0.05, (size, size))
    parts = [step * one for one in np.eye(size) for step in (0.5, 1.0, 0.5, -0.5, -1.0, -0.5)]
    parts += [*rng.uniform(-0.7, 0.7, (cell.combined, size)), np.zeros(size)]
    head = [f"S{place} [mV/V]" for place in range(1, size + 1)]
    head += [f"{name} [{unit}]" for name, unit in zip(names, UNITS[-size:], strict=True)]
    lines = [",".join((*head, "run", "direction"))]
    for run in range(1, cell.runs + 1):
        zero = rng.normal(0.0, cell.run_zero, size)
        for part in parts:
            cells = matrix @ part + zero + rng.normal(0.0, NOISE, size)
            said = (part + rng.normal(0.0, REFERENCE, size)) * full
            lines.append(",".join(f"{float(value)!r}" for value in (*cells, *said)) + f",{run},up")
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        (home / "loads.csv").write_text("\n".join(lines) + "\n")
        (home / "SESSION.toml").write_text(
            'schema = 1\ninstrument = "hub"\ndate = 2026-02-01\noperator = "first person"\n'
            'data = "loads.csv"\n'
            f"indications = {[f'S{place}' for place in range(1, size + 1)]}\nloads = {list(names)}\n"
        )
        registry = Registry(home / "calibrations")
        record = calibrate(home / "SESSION.toml", registry).record
        loads = stored_loads(registry.folder, record)
        assert loads is not None
        part = rng.uniform(-0.7, 0.7, size)
        read = matrix @ part + rng.normal(0.0, cell.run_zero, size) + rng.normal(0.0, NOISE, size)
        readings = {f"S{place}": float(value) for place, value in enumerate(read, 1)}
        found = []
        for name, true, most in zip(names, part * full, full, strict=True):
            budget = predict(record, loads, None, name, readings).budget
            found.append(((budget.at - true) / most, budget.u / most, budget.U / most))
    return found


def run(cells: Sequence[Cell], repetitions: int, seed: int) -> list[CoverageRow]:
    """Return one row a cell, of every component."""
    rows = []
    for cell in cells:
        rng = np.random.default_rng([seed, *cell.name.encode()])
        found = [one for _ in range(repetitions) for one in errors_of(cell, rng)]
        errors, u, U = zip(*found, strict=True)
        rows.append(row_of("reading", cell.name, errors=errors, u=u, U=U))
    return rows


def table(repetitions: int, seed: int, workers: int) -> list[CoverageRow]:
    """Return the rows of the table of coverage; ``workers`` is not needed."""
    del workers
    return run(CELLS, repetitions, seed)
