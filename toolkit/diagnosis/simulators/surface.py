"""A smooth surface through simulated FY and MZ over slip angle and load, one for each direction."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.policy import SURFACE
from toolkit.diagnosis.simulators.gaussian_process import Process, cells_of, likeliest, thinned
from toolkit.diagnosis.simulators.setting import nominal_load
from toolkit.diagnosis.simulators.tire import base_drive, rotation
from toolkit.effects.signals import Drive
from toolkit.errors import ConfigError
from toolkit.findings import Finding

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.diagnosis.case.case import Case, Run

_OUTPUTS = ("FY", "MZ")
_POINTS, _TRIED = 400, 130  # through which it goes, and by which its shape is chosen
_FINE, _LOADS = 121, 17  # of the table that stands for it in simulations
_LEAST = 0.05  # nominal loads, below which a force is no longer counted to its load
_NO_STATE = frozenset(("date", "order", "repeat_of"))


class Surface:
    """Of output over load a Gaussian process in slip angle and load, tabulated finely for simulations.

    ``good`` tells whether the simulated outputs are such a surface at all; ``between`` how far it may be off
    between the slip angles that it was given, root mean square in the output's unit, and ``unsure`` the same
    of outputs where that is more than the recording's noise.
    """

    def __init__(self, case: Case) -> None:
        self._load = nominal_load(case)
        self._fits: dict[tuple[str, str], _FineGrid] = {}
        self.good = True
        self.between: dict[str, float] = {}
        self.unsure: dict[str, float] = {}
        self._case = case
        drives = [(run, base_drive(case, run, load_N=self._load, outputs=False)) for run in case.runs]
        _refuse_other_ways(case)
        slips = np.concatenate([drive.SA for _, drive in drives])
        margin = 0.25 * (np.ptp(slips) or 0.01)
        self._slips = (float(slips.min() - margin), float(slips.max() + margin))
        loads = np.concatenate([drive.FZ for _, drive in drives]) / self._load
        self._steady_load = float(np.ptp(loads)) < 0.02
        reach = 0.25 * float(np.ptp(loads))
        self._loads = (float(loads.min()) - reach, float(loads.max()) + reach)
        for name in _OUTPUTS:
            for way in ("forward", "reverse"):
                chosen = [(run, drive) for run, drive in drives if rotation(run) == way]
                if chosen and name in dict(case.simulation.simulated):
                    self._fit(name, way, chosen)

    def _fit(self, name: str, way: str, chosen: list[tuple[Run, Drive]]) -> None:
        points = np.vstack([self._points(drive.SA, drive.FZ) for _, drive in chosen])
        over = np.concatenate([self._over(drive.FZ) for _, drive in chosen])
        y = np.concatenate([run.simulated[name] for run, _ in chosen])
        good = np.isfinite(y) & (np.concatenate([drive.FZ for _, drive in chosen]) > 0)
        points, over, y = points[good], over[good], y[good]
        if not len(y) or not np.any(y):
            return
        few = thinned(points, _TRIED)
        shape = likeliest(points[few], y[few] / over[few])
        many = thinned(points, _POINTS)
        process = Process(shape, points[many], y[many] / over[many])
        self._fits[name, way] = _FineGrid(process, self._slips, self._loads)
        missed = float(np.sqrt(np.mean((over * self._fits[name, way].at(points) - y) ** 2)))
        if missed > SURFACE.missed * max(float(np.std(y)), 1e-300):
            self.good = False
        left_out = over[many] * process.left_out()
        between = float(np.sqrt(np.mean(left_out**2))) / SURFACE.closer
        self.between[name] = max(between, self.between.get(name, 0.0))

    def too_coarse(self) -> tuple[Finding, ...]:
        """Return a finding for each output that is known worse between slip angles than it is measured."""
        findings = []
        for name, between in self.between.items():
            noise = scatter(self._case, name, self._load)
            if noise is not None and between > noise and self.good:
                self.unsure[name] = between
                findings.append(
                    Finding(
                        rule="case-few-slip-angles",
                        where=f"{self._case.path.name}: simulation.simulated",
                        message=f"between the slip angles of the simulated {name} the tire is known to "
                        f"{between:.2g} {self._case.unit(name)}, the recording to {noise:.2g}: nothing "
                        "smaller than the first is judged, and small effects may be named for an error of "
                        "the table; simulate at more slip angles, or give the simulation as kind python",
                    )
                )
        return tuple(findings)

    def _points(self, SA: NDArray[np.float64], FZ: NDArray[np.float64]) -> NDArray[np.float64]:
        loads = np.full(len(SA), self._loads[0]) if self._steady_load else FZ / self._load
        return np.column_stack([np.clip(SA, *self._slips), np.clip(loads, *self._loads)])

    def _over(self, FZ: NDArray[np.float64]) -> NDArray[np.float64]:
        # Force over load is what changes little with the load.
        return np.ones(len(FZ)) if self._steady_load else np.maximum(FZ / self._load, _LEAST)

    def difference(
        self, name: str, run: Run, SA: NDArray[np.float64], FZ: NDArray[np.float64], start: Drive
    ) -> NDArray[np.float64]:
        """Return output at (SA, FZ) less output at the row's own slip angle and load, in its unit."""
        table = self._fits.get((name, rotation(run)))
        if table is None or (SA is start.SA and FZ is start.FZ):
            return np.zeros(run.rows)
        before = self._over(start.FZ) * table.at(self._points(start.SA, start.FZ))
        return self._over(FZ) * table.at(self._points(SA, FZ)) - before


def _refuse_other_ways(case: Case) -> None:
    ways = {rotation(run) for run in case.runs}
    for run in case.predict:
        if rotation(run) not in ways:
            raise ConfigError(
                "a tire of simulated columns is not known in this direction",
                where=f"{case.path}: {run.name}",
                got=f"rotation {rotation(run)}",
                expected=f"one of {', '.join(sorted(ways))}, as the recorded runs have",
                next_step="leave the prediction out, or add a recorded run in its direction",
                rule="case",
            )


class _FineGrid:
    """A process on a fine grid, with cubic splines between: at a thousand rows a hundred times faster."""

    def __init__(self, found: Process, slips: tuple[float, float], loads: tuple[float, float]) -> None:
        from scipy.interpolate import RectBivariateSpline

        self._bend = found.shape.bend
        low, high = (float(np.arcsinh(slip / self._bend)) for slip in slips)
        u = np.linspace(low, high, _FINE)
        z = np.linspace(loads[0], max(loads[1], loads[0] + 1e-3), _LOADS)
        SA, load = np.meshgrid(np.sinh(u) * self._bend, z, indexing="ij")
        mean = found.mean(np.column_stack([SA.ravel(), load.ravel()]))
        self._spline = RectBivariateSpline(u, z, mean.reshape(SA.shape), kx=3, ky=3)

    def at(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the process at points (n, 2), (n,)."""
        return np.asarray(self._spline.ev(np.arcsinh(points[:, 0] / self._bend), points[:, 1]))


def scatter(case: Case, name: str, load_N: float) -> float | None:
    """Return by how much recorded less simulated scatters where nothing changes, in the output's unit.

    Nothing changes within one slip angle, load and condition; which run of several it is does not count, nor
    its date. None where no place has two rows.
    """
    stated = next((output.sd for output in case.outputs if output.name == name), None)
    if stated is not None:
        return stated
    places: dict[object, list[float]] = {}
    for run in case.runs:
        if name not in run.columns:
            continue
        start = base_drive(case, run, load_N=load_N, outputs=False)
        cells = cells_of(np.column_stack([start.SA, start.FZ / load_N]))
        state = tuple(sorted((k, v) for k, v in run.conditions.items() if k not in _NO_STATE))
        away = run.columns[name] - run.simulated[name]
        for cell, value in zip(cells.tolist(), away.tolist(), strict=True):
            if np.isfinite(value):
                places.setdefault((state, *cell), []).append(value)
    several = [np.asarray(place) for place in places.values() if len(place) > 1]
    rows = sum(len(group) - 1 for group in several)
    return float(np.sqrt(sum(float(group.var() * len(group)) for group in several) / rows)) if rows else None
