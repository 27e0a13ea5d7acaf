"""A smooth surface through simulated FY and MZ over slip angle and load, one for each direction."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.simulators.setting import nominal_load
from toolkit.diagnosis.simulators.tire import base_drive, rotation
from toolkit.effects.signals import Drive
from toolkit.errors import ConfigError
from toolkit.findings import Finding

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.arrays import Array
    from toolkit.diagnosis.case.case import Case, Run

# A smooth function of slip angle and load through known points: a Gaussian process with a tire's shape.


_BENDS = tuple(float(np.radians(one)) for one in (0.5, 1.0, 2.0, 4.0))
_LENGTHS = (0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 4.0)
_LOAD_LENGTHS = (0.7, 1.5, 3.0)  # of the loads' range
_EVENS = (1e-6, 1e-4, 1e-2, 1.0)
_NOISES = (1e-10, 1e-8, 1e-6, 1e-4, 1e-2)
_ANGLE = 0.02  # of the warped slip angle: points nearer than that are one angle
_PIECE = 0.1  # of the warped slip angle: no angle is wider
_CELL = (_ANGLE, 0.02)  # of the warped slip angle, and nominal loads


@dataclass(frozen=True, slots=True, kw_only=True)
class Shape:
    """Which functions are likely.

    ``bend`` is the slip angle [rad] up to which angles count in proportion, beyond it by their logarithm;
    ``length`` the distance in that measure over which a function changes, ``load`` the same over the load,
    in nominal loads; ``even`` the variance of the part that is even in the slip angle, and ``noise`` of
    what no function of the two explains, both of the odd part's.
    """

    bend: float
    length: float
    load: float
    even: float
    noise: float


def covariance(shape: Shape, one: Array, other: Array) -> Array:
    """Return the covariance of points (n, 2) and (m, 2) of slip angle and load, (n, m), without noise."""
    a, b = np.arcsinh(one[:, 0] / shape.bend), np.arcsinh(other[:, 0] / shape.bend)
    near = _matern((a[:, None] - b) / shape.length)
    mirrored = _matern((a[:, None] + b) / shape.length)
    loads = np.exp(-0.5 * ((one[:, 1][:, None] - other[:, 1]) / shape.load) ** 2)
    return np.asarray(((near - mirrored) + shape.even * (near + mirrored)) * loads)


def _matern(away: Array) -> Array:
    """Return Matern's correlation of order 5/2 (4.17): no smoother, a tire begins to slide at a corner."""
    far = np.sqrt(5) * np.abs(away)
    return np.asarray((1 + far + far * far / 3) * np.exp(-far))


class Process:
    """The function through points (n, 2) of slip angle [rad] and load [nominal loads], values (n,)."""

    def __init__(self, shape: Shape, points: Array, values: Array) -> None:
        from scipy.linalg import cho_solve, cholesky

        self.shape, self.points, self.values = shape, points, values
        K = covariance(shape, points, points) + shape.noise * np.eye(len(points))
        self._root = cholesky(K, lower=True)
        self._weights = cho_solve((self._root, True), values)
        self._variance = max(float(values @ self._weights) / len(values), 1e-300)

    @property
    def log_likelihood(self) -> float:
        """Logarithm of the marginal likelihood at the best variance, up to a constant."""
        logs = np.log(np.diag(self._root)).sum()
        return float(-0.5 * len(self.values) * np.log(self._variance) - logs)

    def mean(self, points: Array) -> Array:
        """Return the function at points (m, 2), (m,)."""
        return np.asarray(covariance(self.shape, points, self.points) @ self._weights)

    def left_out(self) -> Array:
        """Return by how much every point is missed by the others at other slip angles, (n,).

        An angle is left out on both sides: the other side of an odd function would tell it. The largest has
        no neighbour beyond it and is missed by more; without it the widest gap of all would not count.
        """
        from scipy.linalg import cho_solve

        inverse = cho_solve((self._root, True), np.eye(len(self.points)))
        angle = angles_of(np.abs(self.points[:, 0]))
        missed = np.zeros(len(angle))
        for group in range(angle.max() + 1):
            at = np.flatnonzero(angle == group)
            missed[at] = np.linalg.solve(inverse[np.ix_(at, at)], self._weights[at])
        return missed


def angles_of(SA: Array) -> NDArray[np.int64]:
    """Return to which of the slip angles, counted from the least, every point belongs, (n,).

    A sweep has no angles; it is cut into pieces.
    """
    warped = np.arcsinh(SA / _BENDS[1])
    order = np.argsort(warped, kind="stable")
    made = np.empty(len(SA), dtype=np.int64)
    group, first, last = -1, -np.inf, -np.inf
    for i in order:
        if warped[i] - last > _ANGLE or warped[i] - first > _PIECE:
            group, first = group + 1, warped[i]
        made[i], last = group, warped[i]
    return made


def cells_of(points: Array, coarser: float = 1.0) -> NDArray[np.int64]:
    """Return in which cell of slip angle and load each point (n, 2) lies, (n, 2)."""
    return np.round(_warped(points) / (coarser * np.array(_CELL))).astype(np.int64)


def thinned(points: Array, most: int) -> NDArray[np.int64]:
    """Return the indices of at most so many of the points (n, 2), spread evenly over what they cover."""
    coarser = 1.0
    while True:
        cells = cells_of(points, coarser)
        _, which, count = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
        if len(count) <= most:
            break
        coarser *= 1.25
    which = which.ravel()
    away = ((_warped(points) / (coarser * np.array(_CELL)) - cells) ** 2).sum(axis=1)
    order = np.lexsort((away, which))
    return np.asarray(order[np.unique(which[order], return_index=True)[1]])


def _warped(points: Array) -> Array:
    return np.column_stack([np.arcsinh(points[:, 0] / _BENDS[1]), points[:, 1]])


def likeliest(points: Array, values: Array) -> Shape:
    """Return the shape of the highest likelihood, of those tried: parameter by parameter, twice."""
    reach = float(np.ptp(points[:, 1])) or 1.0
    tried = {
        "bend": _BENDS,
        "length": _LENGTHS,
        "load": tuple(load * reach for load in _LOAD_LENGTHS),
        "even": _EVENS,
        "noise": _NOISES,
    }
    best = Shape(bend=_BENDS[1], length=1.0, load=1.5 * reach, even=1e-2, noise=1e-6)
    score = -np.inf
    for pair in (("bend", "length"), ("load", "noise"), ("even", "noise")) * 2:
        start = best
        for one in itertools.product(*(tried[name] for name in pair)):
            shape = Shape(**{**_told(start), **dict(zip(pair, one, strict=True))})
            try:
                made = Process(shape, points, values).log_likelihood
            except np.linalg.LinAlgError:
                continue
            if made > score:
                best, score = shape, made
    return best


def _told(shape: Shape) -> dict[str, float]:
    return {name: getattr(shape, name) for name in Shape.__slots__}


_OUTPUTS = ("FY", "MZ")
_MISSED = 0.02  # of the output's spread: a surface that misses more is none of a tire
_CLOSER = 8.0  # a left-out angle has neighbours twice as far away; of third order that is off by 2^3
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
        if missed > _MISSED * max(float(np.std(y)), 1e-300):
            self.good = False
        left_out = over[many] * process.left_out()
        between = float(np.sqrt(np.mean(left_out**2))) / _CLOSER
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

    def _points(self, SA: Array, FZ: Array) -> Array:
        loads = np.full(len(SA), self._loads[0]) if self._steady_load else FZ / self._load
        return np.column_stack([np.clip(SA, *self._slips), np.clip(loads, *self._loads)])

    def _over(self, FZ: Array) -> Array:
        # Force over load is what changes little with the load.
        return np.ones(len(FZ)) if self._steady_load else np.maximum(FZ / self._load, _LEAST)

    def difference(self, name: str, run: Run, SA: Array, FZ: Array, start: Drive) -> Array:
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

    def at(self, points: Array) -> Array:
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
