"""Coverage of what is read off a single curve of noisy rows: slope and value at zero, peak.

A force is drawn by the Magic Formula written out apart, its shape anew for each curve, with 3 % of noise:
white, an autoregression, of a slip angle that is read with noise, or growing with the force. The best
possible is the Cramer-Rao bound of an oracle that knows shape, place and covariance of the noise and has the
same six parameters: the last column is the median half width over 1.96 times the bound.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import toeplitz

from tests.coverage.magic_formula import formula
from tests.coverage.rows import CoverageRow, row_of
from toolkit.tires.fit import fit_curves
from toolkit.tires.model import Curve, CurveFit

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """Slip angles [rad] of the rows, noise in parts of D and its autoregression, noise of the angle [rad]."""

    name: str
    SA: tuple[float, ...]
    sd: float = 0.03
    rho: float = 0.0
    sd_SA: float = 0.0
    growing: float = 0.0

    def covariance(self, p: Sequence[float]) -> Array:
        """Return the covariance of the rows, to first order in the noise of the slip angle."""
        SA = np.array(self.SA)
        size = self.sd * abs(p[2]) + self.growing * np.abs(formula(p, SA))
        correlation = toeplitz(self.rho ** np.arange(len(SA)))
        slope = (formula(p, SA + 1e-6) - formula(p, SA - 1e-6)) / 2e-6
        return np.asarray(correlation * np.outer(size, size) + np.diag((slope * self.sd_SA) ** 2))


def _spaced(count: int) -> tuple[float, ...]:
    return tuple(np.radians(np.linspace(-12.0, 12.0, count)).tolist())


CELLS = (
    Cell(name="13 rows, 3 % white", SA=_spaced(13)),
    Cell(name="39 rows, three ways, 3 % white", SA=(_spaced(13) + _spaced(13)[::-1] + _spaced(13))),
    Cell(name="61 rows, 3 % white", SA=_spaced(61)),
    Cell(name="121 rows, 3 % AR 0.7", SA=_spaced(121), rho=0.7),
    Cell(
        name="61 rows, 0.5 % and 0.15 deg of slip angle", SA=_spaced(61), sd=0.005, sd_SA=math.radians(0.15)
    ),
    Cell(name="61 rows, 0.5 % and 5 % of the force", SA=_spaced(61), sd=0.005, growing=0.05),
)
QUANTITIES = ("slope at 0", "value at 0", "D")


def tire(rng: np.random.Generator) -> tuple[float, ...]:
    """Return a drawn force: B [1/rad], C, D [N], E, Sh [rad], Sv [N]."""
    return (
        float(rng.uniform(8.0, 16.0)), float(rng.uniform(1.2, 1.6)), float(-rng.uniform(900.0, 6000.0)),
        float(rng.uniform(-1.5, 0.2)), float(rng.normal(0.0, 0.004)), float(rng.normal(0.0, 30.0)),
    )  # fmt: skip


def asked(p: Sequence[float]) -> tuple[float, float, float]:
    """Return slope and value at zero, and D."""
    slope = (formula(p, np.array([1e-6])) - formula(p, np.array([-1e-6])))[0] / 2e-6
    return float(slope), float(formula(p, np.zeros(1))[0]), p[2]


def bound(cell: Cell, p: Sequence[float]) -> Array:
    """Return the least standard deviation of each quantity of an unbiased estimator (3,)."""
    SA = np.array(cell.SA)
    step = np.array([1e-5 * max(abs(v), s) for v, s in zip(p, (1, 1, 1, 0.1, 1e-2, 10), strict=True)])

    def moved(f: Callable[[Sequence[float]], Array]) -> Array:
        columns = []
        for place, h in enumerate(step.tolist()):
            up, down = list(p), list(p)
            up[place] += h
            down[place] -= h
            columns.append((f(up) - f(down)) / (2 * h))
        return np.array(columns)

    J, g = moved(lambda q: formula(q, SA)), moved(lambda q: np.array(asked(q)))
    information = J @ np.linalg.solve(cell.covariance(p), J.T)
    size = 1 / np.sqrt(np.diag(information))
    inverse = np.linalg.pinv(information * np.outer(size, size), hermitian=True) * np.outer(size, size)
    return np.asarray(np.sqrt(np.diag(g.T @ inverse @ g)))


def run(cells: Sequence[Cell], repetitions: int, seed: int) -> list[CoverageRow]:
    """Return one row a cell and quantity; of an interval that is not stated nothing is counted."""
    rows = []
    for cell in cells:
        rng = np.random.default_rng([seed, *cell.name.encode()])
        SA = np.array(cell.SA)
        truths = [tire(rng) for _ in range(repetitions)]
        curves = []
        for p in truths:
            white = np.linalg.cholesky(
                cell.covariance(p) - np.diag(_angle_part(cell, p))
            ) @ rng.standard_normal(len(SA))
            y = formula(p, SA) + white
            curves.append(
                Curve(SA=SA + rng.normal(0.0, cell.sd_SA, len(SA)), y=y, channel="FY", load_N=4000.0)
            )
        fits = fit_curves(curves)
        for place, name in enumerate(QUANTITIES):
            rows.append(_row(name, cell, place, fits, truths))
    return rows


def _angle_part(cell: Cell, p: Sequence[float]) -> Array:
    SA = np.array(cell.SA)
    slope = (formula(p, SA + 1e-6) - formula(p, SA - 1e-6)) / 2e-6
    return np.asarray((slope * cell.sd_SA) ** 2)


def _row(
    name: str, cell: Cell, place: int, fits: Sequence[CurveFit], truths: Sequence[tuple[float, ...]]
) -> CoverageRow:
    errors, u, U, least = [], [], [], []
    for fit, p in zip(fits, truths, strict=True):
        true = asked(p)[place]
        if name == "D":
            low, high = fit.parameters[2].interval95 or (None, None)
            low, high = (-math.inf if low is None else low), (math.inf if high is None else high)
            value = fit.parameters[2].value
            errors.append(true - value)
            U.append(high - value if true > value else value - low)
            u.append(max(U[-1] / 1.96, 1e-300))
        else:
            estimate = fit.slope_at_zero if place == 0 else fit.value_at_zero
            if estimate is None:
                continue
            errors.append(estimate.value - true)
            u.append(estimate.u)
            U.append(estimate.expanded()[0])
        least.append(1.96 * float(bound(cell, p)[place]))
    row = row_of(name, cell.name, errors=errors, u=u, U=U)
    ratio = float(np.median(np.array(U) / np.array(least))) if U else None
    return CoverageRow(
        name=row.name, condition=row.condition, n=row.n, covered=row.covered, low=row.low, high=row.high,
        rms_ratio=row.rms_ratio, median_width_ratio=ratio,
    )  # fmt: skip


def table(repetitions: int, seed: int, workers: int) -> list[CoverageRow]:
    """Return the rows of the table of coverage; the last column is over the Cramer-Rao bound."""
    del workers
    return run(CELLS, 5 * repetitions, seed)
