"""Coverage of Magic Formula parameters: curves of known parameters under white and autocorrelated noise.

Two questions for each parameter: does its interval of 95 % hold the truth, over every curve; and does value
plus and minus Student's t times the standard error hold it, over the curves for which an error is printed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter

from tests.coverage.rows import CoverageRow, row_of
from toolkit.estimate import coverage_factor
from toolkit.tires.fit import fit_curves
from toolkit.tires.model import Curve, CurveFit

if TYPE_CHECKING:
    from numpy.typing import NDArray

NAMES = ("B", "C", "D", "E", "Sh", "Sv")
# B [1/rad], C, D [N, N·m], E, Sh [rad], Sv [N, N·m]: a car tire's lateral force and aligning moment, a force
# without a peak within the range and one near the bound of E, and a moment of another shape.
TRUTHS = {
    "FY": (10.0, 1.40, -4000.0, -0.5, 0.003, 25.0),
    "FY late peak": (12.0, 1.15, -4000.0, -0.5, 0.003, 25.0),
    "FY flat": (10.0, 1.60, -4000.0, 0.2, 0.003, 25.0),
    "MZ": (13.0, 2.30, 95.0, -2.5, 0.002, 1.0),
    "MZ blunt": (12.0, 1.90, 95.0, -1.0, 0.002, 1.0),
}
PLACES = {
    "13 steps": np.radians(np.array([0, 1, -1, -2, 2, 4, -4, -6, 6, 8, -8, -10, 10]) - 0.3),
    "61 rows": np.radians(np.linspace(-12.0, 12.0, 61)),
    "241 rows": np.radians(np.linspace(-12.0, 12.0, 241)),
    "sweep of 1200 rows": np.radians(12.0 * np.sin(np.linspace(0.0, 4 * np.pi, 1200))),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """A tire, the places of its rows, and the noise: ``sd`` in parts of D, AR(1) with ``rho``."""

    tire: str
    places: str
    sd: float
    rho: float = 0.0

    @property
    def name(self) -> str:
        """How the table names it."""
        kind = f"AR {self.rho:g}" if self.rho else "white"
        return f"{self.tire}, {self.places}, {100 * self.sd:g} % {kind}"


CELLS = tuple(
    Cell(tire=tire, places=places, sd=sd, rho=rho)
    for places, sd, rho in (
        ("13 steps", 0.003, 0.0), ("61 rows", 0.01, 0.0), ("61 rows", 0.01, 0.6), ("241 rows", 0.01, 0.9),
        ("sweep of 1200 rows", 0.01, 0.9),
    )
    for tire in TRUTHS
)  # fmt: skip


def formula(p: Sequence[float], SA: NDArray[np.float64]) -> NDArray[np.float64]:
    """The Magic Formula written out anew: what is tested is not asked for the truth."""
    B, C, D, E, Sh, Sv = p
    x = B * (SA + Sh)
    return np.asarray(D * np.sin(C * np.arctan(x - E * (x - np.arctan(x)))) + Sv)


def curves(cell: Cell, repetitions: int, seed: int) -> list[Curve]:
    """Return curves of a cell with fresh noise."""
    rng = np.random.default_rng([seed, *cell.name.encode()])
    truth, SA = TRUTHS[cell.tire], PLACES[cell.places]
    made = []
    for _ in range(repetitions):
        white = rng.standard_normal(len(SA) + 400)
        noise = lfilter([math.sqrt(1 - cell.rho**2)], [1.0, -cell.rho], white)[400:]
        y = formula(truth, SA) + cell.sd * abs(truth[2]) * noise
        made.append(Curve(SA=SA, y=y, channel="MZ" if "MZ" in cell.tire else "FY", load_N=4000.0))
    return made


def run(cells: Sequence[Cell], repetitions: int, seed: int) -> list[CoverageRow]:
    """Return two rows a cell and parameter: every interval, and the errors that are printed."""
    rows = []
    for cell in cells:
        fits = fit_curves(curves(cell, repetitions, seed))
        for place, name in enumerate(NAMES):
            rows += _rows(fits, place, name, TRUTHS[cell.tire][place], cell.name)
    return rows


def _rows(fits: Sequence[CurveFit], place: int, name: str, true: float, condition: str) -> list[CoverageRow]:
    every = [fit.parameters[place] for fit in fits]
    # An interval that misses lies to one side: its end is as far from the truth as the row asks.
    errors, halves = [], []
    for p in every:
        low, high = p.interval95 or (None, None)
        below = low is None or low <= true
        above = high is None or true <= high
        errors.append(p.value - true)
        halves.append(abs(p.value - true) if below and above else 0.0)
    u = [max(abs(e), 1e-300) for e in errors]
    interval = row_of(f"{name}, interval", condition, errors=errors, u=u, U=halves)
    shown = [p for p in every if p.standard_error is not None]
    error = row_of(
        f"{name}, error where printed",
        condition,
        errors=[p.value - true for p in shown],
        u=[float(p.standard_error or 0.0) for p in shown],
        U=[coverage_factor(float(p.dof or 0.0)) * float(p.standard_error or 0.0) for p in shown],
    )
    return [interval.without_widths(), error]


def table(repetitions: int, seed: int, workers: int) -> list[CoverageRow]:
    """Return the rows of the table of coverage, shares of every cell; ``workers`` is not needed."""
    del workers
    return run(CELLS, repetitions, seed)
