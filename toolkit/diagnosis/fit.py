"""Joint fits by free simulation: nominal parameters within their priors, effects' parameters, noise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

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
_STEP = 1e-4  # of a parameter's size, for differences


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

    @property
    def parameters(self) -> int:
        """Number of the effects' parameters."""
        return sum(len(one.searched) for one in self.active)


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
) -> Fit:
    """Fit a hypothesis.

    Parameters
    ----------
    active : effects with the values from which the search starts
    start : free parameters from which it starts; their declared values by default
    rows : rows of all runs on which it is fitted; the simulation is free over whole runs in any case
    noise : from which the whitening starts; None for white noise first
    """
    from scipy.optimize import least_squares

    space = _space(problem, tuple(active))
    layouts = {name: problem.layout(name, rows) for name in problem.names}
    first = [one.value for one in problem.free] if start is None else list(start)
    begin = [*first, *(_clipped(one, each.name) for one in active for each in one.searched)]
    x = np.clip(np.asarray(begin, dtype=np.float64) / space.sizes, space.low, space.high)
    best: tuple[float, NDArray[np.float64], dict[str, Noise]] | None = None
    known = noise
    simulated, residual = _run(space, x)
    for turn in range(rounds):
        if known is None:
            known = _white(problem, residual, layouts)
        if len(x):

            def cost(v: NDArray[np.float64], weights: dict[str, Noise] = known) -> NDArray[np.float64]:
                try:
                    return _stack(problem, space, v, _run(space, v)[1], layouts, weights)
                except FitError:
                    return np.full(sum(one.n for one in layouts.values()) + len(problem.free), 1e6)

            solved = least_squares(
                cost,
                x,
                bounds=(space.low, space.high),
                diff_step=_STEP,  # type: ignore[arg-type]
                x_scale=1.0,
                max_nfev=_INNER,
                ftol=1e-7,
                xtol=1e-7,
                gtol=1e-9,
            )
            x = solved.x
        simulated, residual = _run(space, x)
        known = noise_of(problem, residual, layouts, used=len(x))
        score = _score(problem, space, x, residual, layouts, known)
        if best is not None and score < best[0] + _BETTER:
            if score > best[0]:
                best = (score, x, known)
            break
        best = (score, x, known)
        if not len(x) and turn:
            break
    if best is None:
        raise FitError("a fit needs a round", got=rounds, expected="one or more")
    score, x, known = best
    simulated, residual = _run(space, x)
    p, made = space.split(x)
    return Fit(
        p=tuple(p),
        active=made,
        residual=residual,
        simulated=simulated,
        noise=known,
        log_posterior=score,
        covariance=_covariance(problem, space, x, layouts, known),
        rows=rows,
    )


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
        low.append(bounds[0] / size)
        high.append(bounds[1] / size)
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
    for i in range(len(x)):
        step = _STEP * max(abs(x[i]), 1.0)
        step = -step if x[i] + step > space.high[i] else step
        moved = x.copy()
        moved[i] += step
        try:
            simulated, _ = _run(space, moved)
        except FitError:
            simulated = base
        for name, column in simulated.items():
            made[name][:, i] = (column - base[name]) / step
    return made


def _covariance(
    problem: Problem,
    space: _Space,
    x: NDArray[np.float64],
    layouts: dict[str, Layout],
    noise: dict[str, Noise],
) -> NDArray[np.float64]:
    if not len(x):
        return np.zeros((0, 0))
    base, _ = _run(space, x)
    J = _differences(space, x, base)
    parts = [whiten(J[name][where.index], where, noise[name]) for name, where in layouts.items()]
    prior = np.zeros((len(problem.free), len(x)))
    for i, one in enumerate(problem.free):
        prior[i, i] = space.sizes[i] / (one.sd or 1.0)
    whole = np.vstack([*parts, prior])
    size = np.sqrt((whole**2).sum(axis=0))
    size[size == 0] = 1.0
    u, s, vt = np.linalg.svd(whole / size, full_matrices=False)
    del u
    keep = s > 1e-10 * s.max()
    inverse = (vt[keep].T / s[keep] ** 2) @ vt[keep]
    inverse[np.diag_indices_from(inverse)] += (
        np.where(np.abs(vt[~keep]).max(axis=0) > 0.1, 1e12, 0.0) if (~keep).any() else 0.0
    )
    scale = space.sizes / size
    return np.asarray(inverse * np.outer(scale, scale))
