"""One weighted least-squares problem: the vector that makes the whitened residual and the priors least.

A simulation is dear, and derivatives by differences take one for each parameter. They are taken anew only
where the simulation has left the straight line: on the way they are corrected by what each trial shows
(Broyden). An answer never rests on derivatives that are off by more than a few percent along the way to it.

Source: Broyden, Math. Comp. 19 (1965) 577.

The vector is that of a joint fit (`Space`): free parameters, then the effects' values, each over its size.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.fit.noise import Autoregression, Differences, Layout, whiten
from toolkit.diagnosis.policy import PRIORS
from toolkit.effects.applied import AppliedEffect
from toolkit.errors import FitError

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.fit.problem import Problem

    Stacked = dict[str, Array]

_TRIALS = 12
_AGAIN = 3
_BENT = 0.3  # of a step's response: more off the straight line, and derivatives are taken anew
_STRAIGHT = 0.02  # of the whole way's response: less off, and they were good enough to end on
_NOTHING = 0.1  # standard deviations of the noise, over the whole recording: no way at all
_RAN_AWAY = 1e100  # standard deviations: the square of more is no number


class Derivatives:
    """Derivatives of a simulation, kept from one trial to the next: d(simulated)/dx over all rows."""

    def __init__(self, space: Space) -> None:
        self.space = space
        self._last: tuple[Array, Stacked, Stacked] | None = None
        self._fresh: tuple[Array, Stacked, Stacked] | None = None

    def kept(self) -> Derivatives:
        """Return the last differences for another descent, which corrects them on its own way."""
        other = Derivatives(self.space)
        other._last = other._fresh = self._fresh
        return other

    def anew(self, x: Array) -> Stacked:
        """Return the derivatives at a vector by differences."""
        if self._fresh is None or not np.array_equal(self._fresh[0], x):
            self._fresh = (x.copy(), *self.space.around(x))
        self._last = self._fresh
        return self._fresh[2]

    def at(self, x: Array, weighing: Weighing) -> Stacked:
        """Return the derivatives at a vector: known ones, corrected ones, or those by differences."""
        if self._last is None:
            return self.anew(x)
        before, parts, slopes = self._last
        step = x - before
        if not step.any():
            return slopes
        simulated = self.space.simulated(x)
        moved = {name: column - parts[name] for name, column in simulated.items()}
        off = {name: change - slopes[name] @ step for name, change in moved.items()}
        if weighing.size(off) > max(_BENT * weighing.size(moved), _NOTHING):
            return self.anew(x)
        along = step / float(step @ step)
        self._last = (
            x.copy(),
            simulated,
            {name: slope + np.outer(off[name], along) for name, slope in slopes.items()},
        )
        return self._last[2]

    def trusted(self, x: Array, weighing: Weighing) -> bool:
        """Tell whether the last differences were taken near enough to a vector for it to be an answer."""
        if self._fresh is None:
            return False
        begun, there, slopes = self._fresh
        simulated = self.space.simulated(x)
        moved = {name: column - there[name] for name, column in simulated.items()}
        off = {name: change - slopes[name] @ (x - begun) for name, change in moved.items()}
        step = weighing.size(moved)
        return step < _NOTHING or weighing.size(off) < _STRAIGHT * step


class Weighing:
    """What rows are worth: their layouts and noise, and the priors beside them.

    Of an output in ``drifting`` what counts are its differences, and the noise is theirs.
    """

    def __init__(
        self,
        space: Space,
        layouts: dict[str, Layout],
        noise: dict[str, Autoregression],
        drifting: Mapping[str, Differences] = MappingProxyType({}),
    ) -> None:
        self._space, self._noise, self._drifting = space, noise, drifting
        self._layouts = {
            name: drifting[name].layout if name in drifting else where for name, where in layouts.items()
        }

    def _whitened(self, values: Stacked) -> Array:
        with np.errstate(over="ignore", invalid="ignore"):  # a trial that ran away is large, no fault
            parts = [
                whiten(
                    self._drifting[name].of(values[name])
                    if name in self._drifting
                    else values[name][where.index],
                    where,
                    self._noise[name],
                )
                for name, where in self._layouts.items()
            ]
        white = np.concatenate(parts)
        return np.where(np.isfinite(white), np.clip(white, -_RAN_AWAY, _RAN_AWAY), 1e6)

    def size(self, values: Stacked) -> float:
        """Return the size of a difference of simulations in standard deviations of the noise."""
        return float(np.linalg.norm(self._whitened(values)))

    def cost(self, x: Array) -> Array:
        """Return the whitened residual with the priors' beneath, large where nothing can be simulated."""
        try:
            residual = self._space.residual(self._space.simulated(x))
        except FitError:
            return np.full(
                sum(layout.n for layout in self._layouts.values()) + len(self._space.problem.free), 1e6
            )
        p, _ = self._space.split(x)
        return np.concatenate([self._whitened(residual), self._space.problem.off_priors(p)])

    def slope(self, slopes: Stacked) -> Array:
        """Return d(cost)/dx from d(simulated)/dx."""
        prior = self._space.problem.prior_rows(self._space.sizes, len(self._space.sizes))
        return np.concatenate([self._whitened({name: -slope for name, slope in slopes.items()}), prior])


def descend(
    space: Space,
    layouts: dict[str, Layout],
    x: Array,
    noise: dict[str, Autoregression],
    derivatives: Derivatives,
    drifting: Mapping[str, Differences] = MappingProxyType({}),
) -> Array:
    """Return the vector of least squares, searched from ``x``.

    Parameters
    ----------
    noise : by which each output is whitened
    derivatives : found before, or empty; they are kept up
    drifting : outputs of which differences count
    """
    from scipy.optimize import least_squares

    if not len(x):
        return x
    weighing = Weighing(space, layouts, noise, drifting)

    def slope(v: Array) -> Array:
        return weighing.slope(derivatives.at(v, weighing))

    for _ in range(_AGAIN):
        x = least_squares(
            weighing.cost,
            x,
            slope,
            bounds=(space.low, space.high),
            x_scale=1.0,
            max_nfev=_TRIALS,
            ftol=1e-6,
            xtol=1e-5,  # of a parameter's size: the step after it would be smaller by orders
            gtol=1e-9,
        ).x
        if derivatives.trusted(x, weighing):
            break
        derivatives.anew(x)
    return x


_STEP = 1e-4  # of a parameter's size, for differences
_REMEMBERED = 16  # simulations: a descent asks for the same vector from several sides


@dataclass(frozen=True, slots=True, eq=False)
class Space:
    """One hypothesis as a vector with bounds."""

    problem: Problem
    active: tuple[AppliedEffect, ...]
    sizes: Array
    low: Array
    high: Array
    _seen: dict[bytes, Stacked] = field(default_factory=dict)

    @staticmethod
    def of(problem: Problem, active: tuple[AppliedEffect, ...]) -> Space:
        """Return the space of a problem's free parameters and of the values that effects search.

        Steps that were read off the digits are left out: a staircase has no slope.
        """
        active = tuple(applied for applied in active if not applied.effect.from_digits)
        sizes, low, high = [], [], []
        for nominal in problem.free:
            size = nominal.sd or abs(nominal.value) or 1.0
            sizes.append(size)
            bounds = nominal.bounds or (-math.inf, math.inf)
            reach = PRIORS.within * nominal.sd if nominal.sd else math.inf
            low.append(max(bounds[0], nominal.value - reach) / size)
            high.append(min(bounds[1], nominal.value + reach) / size)
        for applied in active:
            for parameter in applied.searched:
                size = _size(applied, parameter.name)
                sizes.append(size)
                low.append(parameter.bounds[0] / size)
                high.append(parameter.bounds[1] / size)
        return Space(problem, active, np.array(sizes), np.array(low), np.array(high))

    def begin(self, p: Sequence[float]) -> Array:
        """Return the vector of free parameters and of the effects' values as they are, within the bounds."""
        begin = [
            *p,
            *(_clipped(applied, parameter.name) for applied in self.active for parameter in applied.searched),
        ]
        return np.clip(np.asarray(begin, dtype=np.float64) / self.sizes, self.low, self.high)

    def at(self, p: Sequence[float]) -> Array:
        """Return the same with the values as they are."""
        values = [
            *p,
            *(applied.values[parameter.name] for applied in self.active for parameter in applied.searched),
        ]
        return np.asarray(values, dtype=np.float64) / self.sizes

    def split(self, x: Array) -> tuple[list[float], tuple[AppliedEffect, ...]]:
        """Return free parameters and effects with their values."""
        values = (x * self.sizes).tolist()
        n = len(self.problem.free)
        effects, at = [], n
        for applied in self.active:
            names = [parameter.name for parameter in applied.searched]
            effects.append(
                replace(applied, values={**applied.values, **dict(zip(names, values[at:], strict=False))})
            )
            at += len(names)
        return values[:n], tuple(effects)

    def simulated(self, x: Array) -> Stacked:
        """Return every output over all runs.

        Raises
        ------
        FitError
            the simulation gives no usable output there
        """
        key = x.tobytes()
        return self._seen[key] if key in self._seen else self._anew(x, key)

    def _anew(self, x: Array, key: bytes) -> Stacked:
        p, active = self.split(x)
        simulated = self.problem.simulate(p, active)
        self._seen.pop(key, None)
        while len(self._seen) >= _REMEMBERED:
            del self._seen[next(iter(self._seen))]
        self._seen[key] = simulated
        return simulated

    def residual(self, simulated: Stacked) -> Stacked:
        """Return recorded less simulated."""
        return {name: self.problem.observed[name] - simulated[name] for name in simulated}

    def around(self, x: Array) -> tuple[Stacked, Stacked]:
        """Return what is simulated at a vector, and d(simulated)/dx by one-sided differences.

        They are (rows,) and (rows, parameters) for each output.

        Raises
        ------
        FitError
            the simulation gives no usable output at the vector itself
        """
        points = self._moved(x)
        # Together they have the same steps: what these leave is then no part of a difference.
        self.problem.prepare([self.split(point) for point in (x, *points)])
        simulated = self._anew(x, x.tobytes())
        slopes = {name: np.empty((len(column), len(x))) for name, column in simulated.items()}
        for i, moved in enumerate(points):
            try:
                trial = self.problem.simulate(*self.split(moved))
            except FitError:
                trial = simulated
            for name, column in trial.items():
                slopes[name][:, i] = (column - simulated[name]) / (moved[i] - x[i])
        return simulated, slopes

    def _moved(self, x: Array) -> list[Array]:
        points = []
        for i in range(len(x)):
            step = min(_STEP * max(abs(x[i]), 1.0), 0.1 * (self.high[i] - self.low[i]))
            step = -step if x[i] + step > self.high[i] else step
            moved = x.copy()
            moved[i] += step
            points.append(moved)
        return points


def _size(applied: AppliedEffect, name: str) -> float:
    """Return the size on which a parameter is searched: its value, or its typical one where that is off."""
    parameter = next(parameter for parameter in applied.effect.parameters if parameter.name == name)
    value = abs(applied.values.get(name, 0.0))
    scale = applied.values.get(f"_size_{name}", 0.0)
    if value and math.isfinite(value):
        return max(value, 0.2 * scale)
    return scale or abs(parameter.typical[0]) or 1.0


def _clipped(applied: AppliedEffect, name: str) -> float:
    parameter = next(parameter for parameter in applied.effect.parameters if parameter.name == name)
    low, high = parameter.bounds
    inside = 1e-9 * max(abs(low) if math.isfinite(low) else 0.0, 1e-9)
    return min(max(applied.values[name], low + inside), high)
