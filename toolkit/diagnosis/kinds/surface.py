"""A smooth surface through simulated FY and MZ over slip angle and load, one for each direction."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.kinds.setting import nominal_load
from toolkit.diagnosis.kinds.tire import base_drive, rotation
from toolkit.effects.signals import Drive

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.diagnosis.case import Case, Run

_KNOTS, _LOADS = 22, 3
_ENOUGH = 0.02  # of the simulated output's spread that the surface may miss
_RIDGE, _BEND = 1e-7, 1e-3


class Surface:
    """Least squares of cubic B-splines in the slip angle times powers of the load."""

    def __init__(self, case: Case) -> None:
        self._load = nominal_load(case)
        self._fits: dict[tuple[str, str], NDArray[np.float64]] = {}
        self.good = True
        drives = [(run, base_drive(case, run, load_N=self._load, outputs=False)) for run in case.runs]
        slips = np.concatenate([drive.SA for _, drive in drives])
        margin = 0.25 * (np.ptp(slips) or 0.01)
        self._low, self._high = float(slips.min() - margin), float(slips.max() + margin)
        loads = np.concatenate([drive.FZ for _, drive in drives])
        self._powers = 1 if np.ptp(loads) < 0.02 * self._load else _LOADS
        for name, _ in case.simulation.simulated:
            for way in ("forward", "reverse"):
                chosen = [(run, drive) for run, drive in drives if rotation(run) == way]
                if chosen:
                    self._fit(name, way, chosen)

    def _fit(self, name: str, way: str, chosen: list[tuple[Run, Drive]]) -> None:
        basis = np.vstack([self._basis(drive.SA, drive.FZ) for _, drive in chosen])
        y = np.concatenate([run.simulated[name] for run, _ in chosen])
        good = np.isfinite(y)
        basis, y = basis[good], y[good]
        size = float(np.sqrt((basis**2).sum(axis=0).max()))
        # Smooth between few slip angles: second differences of the splines' heights cost a little.
        width = basis.shape[1] // self._powers
        bend = np.kron(np.eye(self._powers), np.diff(np.eye(width), 2, axis=0))
        penalty = np.vstack([_BEND * size * bend, _RIDGE * size * np.eye(basis.shape[1])])
        stacked = np.vstack([basis, penalty])
        found = np.linalg.lstsq(stacked, np.concatenate([y, np.zeros(len(penalty))]), rcond=None)[0]
        self._fits[name, way] = found
        missed = np.sqrt(np.mean((basis @ found - y) ** 2)) if len(y) else 0.0
        if missed > _ENOUGH * max(float(np.std(y)), 1e-300):
            self.good = False

    def _basis(self, SA: NDArray[np.float64], FZ: NDArray[np.float64]) -> NDArray[np.float64]:
        from scipy.interpolate import BSpline

        inner = np.linspace(self._low, self._high, _KNOTS)
        step = inner[1] - inner[0]
        knots = np.concatenate(
            [inner[0] - step * np.arange(3, 0, -1), inner, inner[-1] + step * np.arange(1, 4)]
        )
        clipped = np.clip(SA, self._low, self._high - 1e-12)
        splines = BSpline.design_matrix(clipped, knots, 3).toarray()
        load = FZ / self._load
        return np.hstack([splines * (load**k)[:, None] for k in range(self._powers)])

    def difference(
        self, name: str, run: Run, SA: NDArray[np.float64], FZ: NDArray[np.float64], start: Drive
    ) -> NDArray[np.float64]:
        """Return output at (SA, FZ) less output at the row's own slip angle and load, in its unit."""
        if SA is start.SA and FZ is start.FZ:
            return np.zeros(run.rows)
        fit = self._fits[name, rotation(run)]
        return (self._basis(SA, FZ) - self._basis(start.SA, start.FZ)) @ fit
