"""One weighted least-squares problem: the vector that makes the whitened residual and the priors least.

A simulation is dear, and derivatives by differences take one for each parameter. They are taken anew only
where the simulation has left the straight line: on the way they are corrected by what each trial shows
(Broyden). An answer never rests on derivatives that are off by more than a few percent along the way to it.

A step is that of linear least squares within the bounds, damped where it leads beyond a radius in which the
last one held. Where the whole linear problem promises nothing, the search is at its end.

Sources: Broyden, Math. Comp. 19 (1965) 577; Stark and Parker, Comput. Stat. 10 (1995) 129, least squares
within bounds; Levenberg, Quart. Appl. Math. 2 (1944) 164, damping.

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
from toolkit.diagnosis.simulators.run_starts import RunStart
from toolkit.effects.applied import AppliedEffect
from toolkit.errors import FitError

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.fit.problem import Problem

    Stacked = dict[str, Array]

_TRIALS = 30
_PROMISED = 1e-4  # of the log-likelihood, a seventieth of a standard deviation: no step is worth less
_CREPT, _CREEPING = 4, 0.05  # trials, that together gain no more of the log-likelihood: it is rough there
_ROUGH = 1.0  # of the log-likelihood, that is promised there: of more it is worth to look on
_INSIDE = 0.9  # of the way to an effect's bound: where a wave has no size, none of its other values tells any
_NO_WAY = 1e-5  # of a parameter's size: the step after it would be smaller by orders
_POOR, _GOOD = 0.25, 0.75  # of what a step promised: the next may lead a part as far, or farther
_DAMPING, _DAMPED = 1e-6, 4.0  # of the derivatives' square, and by as much more until a step is short enough
_BENT = 0.3  # of a step's response: more off the straight line, and derivatives are taken anew
_STRAIGHT = 0.01  # of the whole way's response: less off, and they were good enough to end on
_NOTHING = 0.1  # standard deviations of the noise, over the whole recording: no way at all
_RAN_AWAY = 1e100  # standard deviations: the square of more is no number


class Derivatives:
    """Derivatives of a simulation, kept from one trial to the next: d(simulated)/dx over all rows."""

    def __init__(self, space: Space) -> None:
        self.space = space
        self._last: tuple[Array, Stacked, Stacked] | None = None
        self._fresh: tuple[Array, Stacked, Stacked] | None = None
        self.reach: Array | None = None  # over more than what the data leave open nothing is a derivative

    def kept(self) -> Derivatives:
        """Return the last differences for another descent, which corrects them on its own way."""
        other = Derivatives(self.space)
        other._last, other._fresh, other.reach = self._fresh, self._fresh, self.reach
        return other

    def anew(self, x: Array) -> Stacked:
        """Return the derivatives at a vector by differences."""
        if self._fresh is None or not np.array_equal(self._fresh[0], x):
            self._fresh = (x.copy(), *self.space.around(x, self.reach))
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

    def are_fresh(self, x: Array) -> bool:
        """Tell whether the last derivatives are differences at a vector, and not corrected."""
        return self._last is self._fresh and self._fresh is not None and np.array_equal(self._fresh[0], x)

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

    def square(self, x: Array) -> float:
        """Return half the square of that."""
        cost = self.cost(x)
        return 0.5 * float(cost @ cost)

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
    *,
    share: float = 0.0,
) -> Array:
    """Return the vector of least squares, searched from ``x``.

    A step is that of the linear problem within the bounds and within a radius. The search ends where the
    whole linear problem promises less than anybody would notice: nothing is simulated to see that.

    Parameters
    ----------
    noise : by which each output is whitened
    derivatives : found before, or empty; they are kept up
    drifting : outputs of which differences count
    share : of the squares, below which a promise is none: of a search that another one follows
    """
    if not len(x):
        return x
    weighing = Weighing(space, layouts, noise, drifting)
    residual = weighing.cost(x)
    square, radius = 0.5 * float(residual @ residual), max(float(np.linalg.norm(x)), 1.0)
    free = len(space.problem.free)

    def about(slopes: Stacked) -> Linear:
        linear = Linear.of(weighing.slope(slopes), residual)
        derivatives.reach = linear.reach
        return linear

    linear = about(derivatives.at(x, weighing))
    trials, squares = _TRIALS, [square]
    while trials:
        low, high = space.low - x, space.high - x
        step, promised = linear.step(low, high)
        crept = len(squares) > _CREPT and squares[-_CREPT - 1] - square < _CREEPING
        if crept and promised < _ROUGH:
            break
        if promised < max(_PROMISED, share * square):
            if share or derivatives.trusted(x, weighing):
                break
            linear, trials = about(derivatives.anew(x)), trials - 1
            continue
        if promised > _ROUGH:
            low[free:], high[free:] = _INSIDE * low[free:], _INSIDE * high[free:]
            step, promised = linear.step(low, high)
        if np.linalg.norm(step) > radius:
            step, promised = linear.step(low, high, radius)
        there = np.clip(x + step, space.low, space.high)
        way = float(np.linalg.norm(there - x))
        if way < _NO_WAY * (_NO_WAY + float(np.linalg.norm(x))):
            break
        trials -= 1
        tried = weighing.cost(there)
        reached = 0.5 * float(tried @ tried)
        gained = (square - reached) / promised
        if gained < _POOR:
            radius = _POOR * way
        elif gained > _GOOD:
            radius = max(radius, 2 * way)
        if reached < square:
            x, residual, square = there, tried, reached
            linear = about(derivatives.at(x, weighing))
        elif not derivatives.are_fresh(x):
            linear = about(derivatives.anew(x))
        squares.append(square)
    return x


@dataclass(frozen=True, slots=True, eq=False)
class Linear:
    """A problem of least squares, linear about a vector: ``factor`` times the step is to be ``target``."""

    factor: Array
    target: Array

    @staticmethod
    def of(slope: Array, residual: Array) -> Linear:
        """Return it with as many rows as parameters, in place of the recording's."""
        triangle = np.asarray(np.linalg.qr(np.column_stack([slope, residual]), mode="r"))
        return Linear(triangle[: slope.shape[1], :-1], -triangle[: slope.shape[1], -1])

    @property
    def reach(self) -> Array:
        """Standard deviation of every parameter with the others as they are, (k,)."""
        return np.asarray(1 / np.maximum(np.linalg.norm(self.factor, axis=0), 1e-300))

    def step(self, low: Array, high: Array, radius: float = math.inf) -> tuple[Array, float]:
        """Return the best step within bounds, (k,), and by how much it promises to lower half the square.

        Parameters
        ----------
        radius : beyond which no step leads; damping keeps it within (Levenberg and Marquardt)
        """
        from scipy.optimize import lsq_linear

        step, damping = np.zeros(0), 0.0
        while not len(step) or np.linalg.norm(step) > radius:
            damped = (
                np.vstack([self.factor, math.sqrt(damping) * np.eye(len(low))]) if damping else self.factor
            )
            target = np.concatenate([self.target, np.zeros(len(damped) - len(self.target))])
            step = lsq_linear(damped, target, bounds=(low, high), method="bvls").x
            damping = _DAMPED * damping or _DAMPING * float(np.linalg.norm(self.factor)) ** 2
        left = self.factor @ step - self.target
        return step, 0.5 * float(self.target @ self.target - left @ left)


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
        sizes = {applied.key: applied.values for applied in effects}
        return values[:n], tuple(
            replace(applied, values={**applied.values, **sizes.get(applied.sized_as, {})})
            if applied.sized_as is not None
            else applied
            for applied in effects
        )

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

    def around(self, x: Array, reach: Array | None = None) -> tuple[Stacked, Stacked]:
        """Return what is simulated at a vector, and d(simulated)/dx by one-sided differences.

        They are (rows,) and (rows, parameters) for each output.

        Parameters
        ----------
        reach : over which no difference goes, (k,)

        Raises
        ------
        FitError
            the simulation gives no usable output at the vector itself
        """
        points = self._moved(x, reach)
        # Together they have the same steps: what these leave is then no part of a difference.
        self.problem.prepare([self.split(point) for point in (x, *points)])
        simulated = self._anew(x, x.tobytes())
        slopes = {name: np.zeros((len(column), len(x))) for name, column in simulated.items()}
        for listed, moved in zip(self._groups(), points, strict=True):
            try:
                trial = self.problem.simulate(*self.split(moved))
            except FitError:
                trial = simulated
            for i, rows in listed:
                for name, column in trial.items():
                    slopes[name][rows, i] = (column[rows] - simulated[name][rows]) / (moved[i] - x[i])
        return simulated, slopes

    def _groups(self) -> list[list[tuple[int, slice]]]:
        """Return the parameters that one simulation serves, each with the rows that answer to it alone.

        Where a run starts moves no other run: one simulation moves a state's starts in all of them (Curtis,
        Powell and Reid, J. Inst. Math. Appl. 13 (1974) 117).
        """
        groups: dict[object, list[tuple[int, slice]]] = {}
        for i in range(len(self.sizes)):
            parameter = self.problem.free[i] if i < len(self.problem.free) else None
            if isinstance(parameter, RunStart):
                groups.setdefault(parameter.state, []).append((i, self.problem.slices[parameter.run]))
            else:
                groups[i] = [(i, slice(0, self.problem.rows))]
        return list(groups.values())

    def _moved(self, x: Array, reach: Array | None) -> list[Array]:
        points, most = [], np.full(len(x), math.inf) if reach is None else reach
        for listed in self._groups():
            moved = x.copy()
            for i, _ in listed:
                step = min(_STEP * max(abs(x[i]), 1.0), 0.1 * (self.high[i] - self.low[i]), most[i])
                moved[i] += -step if x[i] + step > self.high[i] else step
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
