"""Joint fits by free simulation: nominal parameters within their priors, effects' parameters, noise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, cast

import numpy as np

from toolkit.diagnosis.covariance import covariance
from toolkit.diagnosis.model import Active
from toolkit.diagnosis.noise import Layout, Noise, fit_noise, log_likelihood, whiten
from toolkit.errors import FitError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.diagnosis.problem import Problem

    Stacked = dict[str, NDArray[np.float64]]

_OUTER = 4  # times that the noise is estimated anew
_INNER = 12
_BETTER = 0.02  # of the log-likelihood: less is no step worth another round
_SAME = 0.05  # by which the coloured fit's residual variance may exceed the plain one's
_STEP = 1e-4  # of a parameter's size, for differences
_WITHIN = 4.0  # prior standard deviations; further off a parameter is not uncertain but imitates an effect


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fit:
    """One hypothesis fitted to some rows.

    ``p`` are the free nominal parameters in their units; ``residual`` recorded less simulated, over all
    rows; ``covariance`` of (p, effects' parameters) in their units; ``log_posterior`` has the priors in it.
    """

    p: tuple[float, ...]
    active: tuple[Active, ...]
    residual: Stacked
    simulated: Stacked
    noise: dict[str, Noise]
    log_posterior: float
    covariance: NDArray[np.float64]
    rows: NDArray[np.bool_] | None
    plain: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class _Solved:
    """One solution: the searched vector, its residual, the noise of that, and the log-posterior."""

    x: NDArray[np.float64]
    simulated: Stacked
    residual: Stacked
    noise: dict[str, Noise]
    score: float


@dataclass(frozen=True, slots=True, eq=False)
class _Space:
    """The vector that is searched: scaled free parameters, then the effects' values over their sizes."""

    problem: Problem
    active: tuple[Active, ...]
    sizes: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]

    def split(self, x: NDArray[np.float64]) -> tuple[list[float], tuple[Active, ...]]:
        """Return free parameters and effects with their values."""
        values = (x * self.sizes).tolist()
        n = len(self.problem.free)
        made, at = [], n
        for one in self.active:
            names = [each.name for each in one.searched]
            made.append(replace(one, values={**one.values, **dict(zip(names, values[at:], strict=False))}))
            at += len(names)
        return values[:n], tuple(made)


def size_of(one: Active, name: str) -> float:
    """Return the size on which a parameter is searched: its value, or its typical one where that is off."""
    parameter = next(each for each in one.effect.parameters if each.name == name)
    value = abs(one.values.get(name, 0.0))
    scale = one.values.get(f"_size_{name}", 0.0)
    if value and math.isfinite(value):
        return max(value, 0.2 * scale)
    return scale or abs(parameter.typical[0]) or 1.0


def fit(
    problem: Problem,
    active: Sequence[Active] = (),
    *,
    start: Sequence[float] | None = None,
    rows: NDArray[np.bool_] | None = None,
    noise: dict[str, Noise] | None = None,
    rounds: int = _OUTER,
    plain: bool | None = None,
) -> Fit:
    """Fit a hypothesis.

    Parameters
    ----------
    active : effects with the values from which the search starts
    start : free parameters from which it starts; their declared values by default
    rows : rows of all runs on which it is fitted; the simulation is free over whole runs in any case
    noise : from which the whitening starts; None for white noise first
    plain : ordinary least squares, or not; None lets a specification test decide
    """
    space = _space(problem, tuple(active))
    layouts = {name: problem.layout(name, rows) for name in problem.names}
    first = [one.value for one in problem.free] if start is None else list(start)
    begin = [*first, *(_clipped(one, each.name) for one in active for each in one.searched)]
    x = np.clip(np.asarray(begin, dtype=np.float64) / space.sizes, space.low, space.high)
    made = _coloured(space, layouts, x, noise, 2 if plain else rounds)
    if plain is None:
        other = _plain(space, layouts, made)
        plain = other is not None and _absorbs(made, other, layouts)
        chosen = other if plain and other is not None else made
    else:
        chosen = _plain(space, layouts, made) or made if plain else made
    p, found = space.split(chosen.x)
    return Fit(
        p=tuple(p),
        active=found,
        residual=chosen.residual,
        simulated=chosen.simulated,
        noise=chosen.noise,
        log_posterior=chosen.score,
        covariance=_covariance(space, chosen, layouts, plain=plain),
        rows=rows,
        plain=plain,
    )


def _coloured(
    space: _Space,
    layouts: dict[str, Layout],
    x: NDArray[np.float64],
    noise: dict[str, Noise] | None,
    rounds: int,
) -> _Solved:
    """Return generalised least squares, the noise estimated anew in every round."""
    best: _Solved | None = None
    known = noise
    for turn in range(max(rounds, 1)):
        if known is None:
            known = _white(space.problem, _run(space, x)[1], layouts)
        here = _solve(space, layouts, x, known)
        if best is not None and here.score < best.score + _BETTER:
            return here if here.score > best.score else best
        best, x, known = here, here.x, here.noise
        if not len(x) and turn:
            break
    return cast("_Solved", best)


def _plain(space: _Space, layouts: dict[str, Layout], from_: _Solved) -> _Solved | None:
    """Return ordinary least squares, each output weighed by what its rows are worth; None for white noise."""
    if not len(from_.x) or not any(one.reflection for one in from_.noise.values()):
        return None
    weights = {
        name: Noise(reflection=(), sd=one.marginal_sd * math.sqrt(one.correlation_rows))
        for name, one in from_.noise.items()
    }
    return _solve(space, layouts, from_.x, weights)


def _absorbs(coloured: _Solved, plain: _Solved, layouts: dict[str, Layout]) -> bool:
    """Tell whether the coloured fit leaves a larger residual than noise alone can explain.

    Under the right model both estimate the same, and the plain one is smaller by what its parameters take.
    Where the coloured one is much larger, its noise has absorbed physics (a specification test in the
    manner of Hausman), and the plain one is to be trusted.
    """
    for name, where in layouts.items():
        one = float(np.mean(coloured.residual[name][where.index] ** 2)) if where.n else 0.0
        other = float(np.mean(plain.residual[name][where.index] ** 2)) if where.n else 0.0
        worth = plain.noise[name].correlation_rows / max(where.n, 1)
        if one > other * (1 + _SAME + 3 * len(plain.x) * worth):
            return True
    return False


def _solve(
    space: _Space, layouts: dict[str, Layout], x: NDArray[np.float64], weights: dict[str, Noise]
) -> _Solved:
    from scipy.optimize import least_squares

    problem = space.problem

    def cost(v: NDArray[np.float64]) -> NDArray[np.float64]:
        try:
            return _stack(problem, space, v, _run(space, v)[1], layouts, weights)
        except FitError:
            return np.full(sum(one.n for one in layouts.values()) + len(problem.free), 1e6)

    def slope(v: NDArray[np.float64]) -> NDArray[np.float64]:
        points = _moved(space, v)
        _prepare(space, [v, *points])
        here = cost(v)
        return np.stack([(cost(w) - here) / (w[i] - v[i]) for i, w in enumerate(points)], axis=1)

    if len(x):
        x = least_squares(
            cost,
            x,
            slope,
            bounds=(space.low, space.high),
            x_scale=1.0,
            max_nfev=_INNER,
            ftol=1e-6,
            xtol=1e-5,  # of a parameter's size: the step after it would be smaller by orders
            gtol=1e-9,
        ).x
    simulated, residual = _run(space, x)
    noise = noise_of(problem, residual, layouts, used=len(x))
    return _Solved(x, simulated, residual, noise, _score(problem, space, x, residual, layouts, noise))


def replace_effects(problem: Problem, made: Fit, active: tuple[Active, ...]) -> Fit:
    """Return a fit with other effects in it that nothing is fitted of: its covariance has them as known."""
    simulated = problem.simulate(made.p, active)
    width = len(problem.free) + sum(len(one.searched) for one in active)
    covariance = np.zeros((width, width))
    n = len(made.covariance)
    covariance[:n, :n] = made.covariance
    residual = {name: problem.observed[name] - one for name, one in simulated.items()}
    return replace(made, active=active, simulated=simulated, residual=residual, covariance=covariance)


def noise_of(
    problem: Problem, residual: Stacked, layouts: dict[str, Layout], *, used: int = 0
) -> dict[str, Noise]:
    """Return the noise of every output's residual."""
    return {
        name: fit_noise(
            residual[name][layouts[name].index],
            layouts[name],
            floor=problem.floor[name],
            sd=problem.sd_of(name),
            used=used // len(layouts),
        )
        for name in problem.names
    }


def log_prior(problem: Problem, p: Sequence[float]) -> float:
    """Return the logarithm of the priors' density, without its constant."""
    return -0.5 * sum(
        ((value - one.value) / (one.sd or 1.0)) ** 2 for value, one in zip(p, problem.free, strict=True)
    )


def held_out_score(problem: Problem, made: Fit, rows: NDArray[np.bool_]) -> float:
    """Return the log-likelihood of rows that a fit has not seen, under the noise of its training rows."""
    total = 0.0
    for name in problem.names:
        where = problem.layout(name, rows)
        if where.n:
            total += log_likelihood(made.residual[name][where.index], where, made.noise[name])
    return total


def jacobian(problem: Problem, made: Fit) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.float64]]:
    """Return d(simulated)/d(x) over all rows of each output, and the sizes of x; x = (p, effects) / sizes."""
    space = _space(problem, made.active)
    values = [*made.p, *(one.values[each.name] for one in made.active for each in one.searched)]
    x = np.asarray(values, dtype=np.float64) / space.sizes
    return _differences(space, x, made.simulated), space.sizes


def _space(problem: Problem, active: tuple[Active, ...]) -> _Space:
    sizes, low, high = [], [], []
    for one in problem.free:
        size = one.sd or abs(one.value) or 1.0
        sizes.append(size)
        bounds = one.bounds or (-math.inf, math.inf)
        reach = _WITHIN * one.sd if one.sd else math.inf
        low.append(max(bounds[0], one.value - reach) / size)
        high.append(min(bounds[1], one.value + reach) / size)
    for each in active:
        for parameter in each.searched:
            size = size_of(each, parameter.name)
            sizes.append(size)
            low.append(parameter.bounds[0] / size)
            high.append(parameter.bounds[1] / size)
    return _Space(problem, active, np.array(sizes), np.array(low), np.array(high))


def _clipped(one: Active, name: str) -> float:
    parameter = next(each for each in one.effect.parameters if each.name == name)
    low, high = parameter.bounds
    inside = 1e-9 * max(abs(low) if math.isfinite(low) else 0.0, 1e-9)
    return min(max(one.values[name], low + inside), high)


def _run(space: _Space, x: NDArray[np.float64]) -> tuple[Stacked, Stacked]:
    p, active = space.split(x)
    simulated = space.problem.simulate(p, active)
    return simulated, {name: space.problem.observed[name] - simulated[name] for name in simulated}


def _stack(
    problem: Problem,
    space: _Space,
    x: NDArray[np.float64],
    residual: Stacked,
    layouts: dict[str, Layout],
    noise: dict[str, Noise],
) -> NDArray[np.float64]:
    parts = [whiten(residual[name][where.index], where, noise[name]) for name, where in layouts.items()]
    p, _ = space.split(x)
    parts.append(
        np.array([(v - one.value) / (one.sd or 1.0) for v, one in zip(p, problem.free, strict=True)])
    )
    stacked = np.concatenate(parts)
    return np.where(np.isfinite(stacked), stacked, 1e6)


def _white(problem: Problem, residual: Stacked, layouts: dict[str, Layout]) -> dict[str, Noise]:
    made = {}
    for name, where in layouts.items():
        values = residual[name][where.index]
        size = math.sqrt(float(np.mean(values**2))) if len(values) else 0.0
        made[name] = Noise(reflection=(), sd=max(size, problem.floor[name]))
    return made


def _score(
    problem: Problem,
    space: _Space,
    x: NDArray[np.float64],
    residual: Stacked,
    layouts: dict[str, Layout],
    noise: dict[str, Noise],
) -> float:
    p, _ = space.split(x)
    total = log_prior(problem, p)
    for name, where in layouts.items():
        if where.n:
            total += log_likelihood(residual[name][where.index], where, noise[name])
    return total if math.isfinite(total) else -math.inf


def _differences(space: _Space, x: NDArray[np.float64], base: Stacked) -> dict[str, NDArray[np.float64]]:
    made = {name: np.empty((len(column), len(x))) for name, column in base.items()}
    points = _moved(space, x)
    _prepare(space, [x, *points])
    for i, moved in enumerate(points):
        try:
            simulated, _ = _run(space, moved)
        except FitError:
            simulated = base
        for name, column in simulated.items():
            made[name][:, i] = (column - base[name]) / (moved[i] - x[i])
    return made


def _moved(space: _Space, x: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Return the points of one-sided differences, within the bounds."""
    points = []
    for i in range(len(x)):
        step = min(_STEP * max(abs(x[i]), 1.0), 0.1 * (space.high[i] - space.low[i]))
        step = -step if x[i] + step > space.high[i] else step
        moved = x.copy()
        moved[i] += step
        points.append(moved)
    return points


def _prepare(space: _Space, points: Sequence[NDArray[np.float64]]) -> None:
    """Have the simulations of several points made at once."""
    space.problem.prepare([space.split(one) for one in points])


def _covariance(
    space: _Space, solved: _Solved, layouts: dict[str, Layout], *, plain: bool
) -> NDArray[np.float64]:
    J = _differences(space, solved.x, solved.simulated) if len(solved.x) else {}
    prior = np.zeros((len(space.problem.free), len(solved.x)))
    for i, one in enumerate(space.problem.free):
        prior[i, i] = space.sizes[i] / (one.sd or 1.0)
    return covariance(J, prior, space.sizes, layouts, solved.noise, plain=plain)
