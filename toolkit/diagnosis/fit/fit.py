"""Joint fits by free simulation: nominal parameters within their priors, effects' parameters, noise."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, cast

import numpy as np

from toolkit.diagnosis.fit.descent import Derivatives, Linear, Space, Weighing, descend
from toolkit.diagnosis.fit.noise import (
    Autoregression,
    Differences,
    Layout,
    autocovariance,
    fit_noise,
    log_likelihood,
    whiten,
)
from toolkit.diagnosis.policy import NOISE
from toolkit.effects.applied import AppliedEffect
from toolkit.errors import FitError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.arrays import Array
    from toolkit.diagnosis.fit.problem import Problem

    Stacked = dict[str, Array]

_OPEN = 1e12  # variance, in searched units, of what the data leave open altogether


def covariance(
    J: Stacked,
    prior: Array,
    sizes: Array,
    layouts: dict[str, Layout],
    noise: dict[str, Autoregression],
    *,
    plain: bool,
) -> Array:
    """Return the covariance of (p, effects' parameters) in their units.

    Of ordinary least squares it is the sandwich with the residual's autocovariance in it.

    Parameters
    ----------
    J : of every output over all rows, d(simulated)/d(x), (rows, k); x are the parameters over ``sizes``
    prior : rows of the priors, (free, k)
    """
    if not len(sizes):
        return np.zeros((0, 0))
    parts, spread = [], prior.T @ prior
    for name, where in layouts.items():
        columns = J[name][where.index]
        _refuse_beyond_numbers(name, columns)
        if plain:
            weight = 1 / (noise[name].marginal_sd ** 2 * noise[name].correlation_rows)
            parts.append(columns * math.sqrt(weight))
            spread = spread + weight**2 * columns.T @ _correlated(columns, where, noise[name])
        else:
            parts.append(whiten(columns, where, noise[name]))
    rows = np.vstack([*parts, prior])
    size = np.sqrt((rows**2).sum(axis=0))
    size[size == 0] = 1.0
    _, s, vt = np.linalg.svd(rows / size, full_matrices=False)
    keep = s > 1e-10 * s.max()
    inverse = (vt[keep].T / s[keep] ** 2) @ vt[keep]
    if plain:
        inverse = inverse @ (spread / np.outer(size, size)) @ inverse
    if not keep.all():
        inverse[np.diag_indices_from(inverse)] += np.where(np.abs(vt[~keep]).max(axis=0) > 0.1, _OPEN, 0.0)
    scale = sizes / size
    with np.errstate(over="ignore", invalid="ignore"):  # of what moves nothing: open, as far as numbers go
        return np.asarray(np.nan_to_num(inverse * np.outer(scale, scale)))


def _correlated(columns: Array, where: Layout, noise: Autoregression) -> Array:
    """Return the noise's covariance matrix times columns, segment by segment."""
    from scipy.signal import fftconvolve

    if not noise.reflection:
        return noise.sd**2 * columns
    products = np.empty_like(columns)
    for segment in where.segments:
        n = segment.stop - segment.start
        gamma = autocovariance(noise, n)
        kernel = np.concatenate([gamma[:0:-1], gamma])[:, None]
        products[segment] = fftconvolve(columns[segment], kernel, mode="full", axes=0)[n - 1 : 2 * n - 1]
    return products


_OUTER = 5  # times that the noise is estimated anew, the first roughly
_BETTER = 0.02  # of the log-likelihood: less is no step worth another round
_MARGIN = 0.5  # of what tells that noise has absorbed physics: nearer to it than that, both are fitted
_ROUGH = 1e-3  # of the squares: a first round that leads no farther is good enough to see the noise


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fit:
    """One hypothesis fitted to some rows.

    ``p`` are the free nominal parameters in their units; ``residual`` recorded less simulated, over all
    rows; ``covariance`` of (p, effects' parameters) in their units; ``log_posterior`` has the priors in it.
    """

    p: tuple[float, ...]
    active: tuple[AppliedEffect, ...]
    residual: Stacked
    simulated: Stacked
    noise: dict[str, Autoregression]
    log_posterior: float
    covariance: Array
    rows: NDArray[np.bool_] | None
    plain: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class _Solved:
    """One solution: the searched vector, its residual, the noise of that, and the log-posterior."""

    x: Array
    simulated: Stacked
    residual: Stacked
    noise: dict[str, Autoregression]
    score: float


def fit(
    problem: Problem,
    active: Sequence[AppliedEffect] = (),
    *,
    start: Sequence[float] | None = None,
    rows: NDArray[np.bool_] | None = None,
    noise: dict[str, Autoregression] | None = None,
    rounds: int = _OUTER,
    plain: bool | None = None,
    derivatives: Derivatives | None = None,
    least: float = -math.inf,
) -> Fit:
    """Fit a hypothesis.

    Parameters
    ----------
    active : effects with the values from which the search starts
    start : free parameters from which it starts; their declared values by default
    rows : rows of all runs on which it is fitted; the simulation is free over whole runs in any case
    noise : from which the whitening starts; None for white noise first
    plain : ordinary least squares, or not; None lets a specification test decide
    derivatives : those at the start, of a fit to other rows; then nobody asks for a covariance
    least : log-posterior below which nobody asks for the fit: one that cannot reach it is not ended, and has
        no covariance
    """
    intervals = derivatives is None
    if derivatives is None:
        derivatives = Derivatives(Space.of(problem, tuple(active)))
    space = derivatives.space
    layouts = {name: problem.layout(name, rows) for name in problem.names}
    x = white = space.begin([parameter.value for parameter in problem.free] if start is None else start)
    if plain and noise and any(each.is_coloured for each in noise.values()):  # what rows are worth is known
        begun = space.simulated(x)
        solved = _Solved(x, begun, space.residual(begun), noise, -math.inf)
    else:
        solved, white = _coloured(space, layouts, x, noise, 2 if plain else rounds, derivatives, least)
    alternative = None
    if solved.score < least:  # ordinary least squares are no likelier: the plain solution cannot reach it
        plain, intervals = False, False
    if plain is None:
        alternative = _plain_nearby(space, layouts, solved, derivatives)
        if alternative is not None and _absorbs(space, solved, alternative, layouts, margin=_MARGIN):
            alternative = _plain(space, layouts, solved, derivatives, white)
        plain = alternative is not None and _absorbs(space, solved, alternative, layouts)
        solution = alternative if plain and alternative is not None else solved
    else:
        solution = _plain(space, layouts, solved, derivatives, white) or solved if plain else solved
    p, values = space.split(solution.x)
    fitted = Fit(
        p=tuple(p),
        active=values,
        residual=solution.residual,
        simulated=solution.simulated,
        noise=solution.noise,
        log_posterior=solution.score,
        covariance=_covariance(
            space, solution, None if plain else alternative, layouts, derivatives, plain=plain
        )
        if intervals
        else np.zeros((0, 0)),
        rows=rows,
        plain=plain,
    )
    if len(values) == len(active):
        return fitted
    moved = iter(values)
    effects = tuple(applied if applied.effect.from_digits else next(moved) for applied in active)
    return resimulated(problem, fitted, effects)


def _coloured(
    space: Space,
    layouts: dict[str, Layout],
    x: Array,
    noise: dict[str, Autoregression] | None,
    rounds: int,
    derivatives: Derivatives,
    least: float,
) -> tuple[_Solved, Array]:
    """Return generalised least squares, the noise estimated anew in every round, and where white noise led.

    Each round gains less than the one before: where as much again does not reach ``least``, it is the last.
    """
    best: _Solved | None = None
    noise_now, white = noise, x
    for turn in range(max(rounds, 1)):
        first = noise_now is None
        if noise_now is None:
            noise_now = _white(space.problem, space.residual(space.simulated(x)), layouts)
        # White noise of what the start leaves is nobody's: it only leads to where the noise can be seen.
        solved = _solve(space, layouts, x, noise_now, derivatives, share=_ROUGH if first else 0.0)
        white = solved.x if first else white
        if best is not None and solved.score < best.score + _BETTER:
            return (solved if solved.score > best.score else best), white
        if best is not None and 2 * solved.score - best.score < least:
            return solved, white
        best, x, noise_now = solved, solved.x, solved.noise
        if not len(x) and turn:
            break
    return cast("_Solved", best), white


def _plain(
    space: Space, layouts: dict[str, Layout], from_: _Solved, derivatives: Derivatives, white: Array
) -> _Solved | None:
    """Return ordinary least squares, each output weighed by what its rows are worth; None for white noise.

    A coloured noise that has taken physics for its own led away from where white noise had led.
    Of an output that only drifts they are those of its differences: its own squares are the sum of all that
    pushed it before, and the smallest sum says nothing of what each push was.
    """
    if not _is_coloured(from_):
        return None
    drifting = _drifting(space, layouts)
    worth = _worth(space, from_, drifting)
    squares = [Weighing(space, layouts, worth, drifting).square(x) for x in (from_.x, white)]
    begin = white if squares[1] < squares[0] else from_.x
    return _solve(space, layouts, begin, worth, derivatives, drifting)


def _plain_nearby(
    space: Space, layouts: dict[str, Layout], from_: _Solved, derivatives: Derivatives
) -> _Solved | None:
    """Return where ordinary least squares lead as far as the derivatives tell; None for white noise.

    Nothing is simulated: where the straight way leads to hardly less, so does the bent one.
    """
    if not _is_coloured(from_):
        return None
    drifting = _drifting(space, layouts)
    weighing = Weighing(space, layouts, _worth(space, from_, drifting), drifting)
    slopes = derivatives.at(from_.x, weighing)
    step = Linear.of(weighing.slope(slopes), weighing.cost(from_.x)).step(
        space.low - from_.x, space.high - from_.x
    )[0]
    simulated = {name: column + slopes[name] @ step for name, column in from_.simulated.items()}
    residual = space.residual(simulated)
    noise = noise_of(space.problem, residual, layouts, used=len(step))
    return _Solved(from_.x + step, simulated, residual, noise, -math.inf)


def _is_coloured(solved: _Solved) -> bool:
    return len(solved.x) > 0 and any(each.is_coloured for each in solved.noise.values())


def _worth(space: Space, from_: _Solved, drifting: dict[str, Differences]) -> dict[str, Autoregression]:
    """Return white noise by which every output is weighed by what its rows are worth."""
    noise = from_.noise | _noise_of_differences(space, from_, drifting)
    return {
        name: Autoregression(
            reflection=(), sd=autoregression.marginal_sd * math.sqrt(autoregression.correlation_rows)
        )
        for name, autoregression in noise.items()
    }


def _drifting(space: Space, layouts: dict[str, Layout]) -> dict[str, Differences]:
    return {name: Differences(layouts[name], rows) for name, rows in space.problem.rates.items()}


def _noise_of_differences(
    space: Space, solved: _Solved, drifting: dict[str, Differences]
) -> dict[str, Autoregression]:
    return {
        name: fit_noise(each.of(solved.residual[name]), each.layout, floor=space.problem.floor[name])
        for name, each in drifting.items()
    }


def _absorbs(
    space: Space, coloured: _Solved, plain: _Solved, layouts: dict[str, Layout], *, margin: float = 1.0
) -> bool:
    """Tell whether the coloured fit leaves a larger residual than noise alone can explain.

    Under the right model both estimate the same, and the plain one is smaller by what its parameters take.
    Where the coloured one is much larger, its noise has absorbed physics (a specification test in the
    manner of Hausman), and the plain one is to be trusted.

    Parameters
    ----------
    margin : of what noise alone can explain
    """
    drifting = _drifting(space, layouts)
    noise = plain.noise | _noise_of_differences(space, plain, drifting)
    for name, where in layouts.items():
        judged = [
            drifting[name].of(each.residual[name]) if name in drifting else each.residual[name][where.index]
            for each in (coloured, plain)
        ]
        coloured_square, plain_square = (float(np.mean(rows**2)) if len(rows) else 0.0 for rows in judged)
        worth = noise[name].correlation_rows / max(len(judged[0]), 1)
        by_chance = NOISE.absorbed + NOISE.absorbed_by_chance * len(plain.x) * worth
        if coloured_square > plain_square * (1 + margin * by_chance):
            return True
    return False


def _solve(
    space: Space,
    layouts: dict[str, Layout],
    x: Array,
    weights: dict[str, Autoregression],
    derivatives: Derivatives,
    drifting: Mapping[str, Differences] = MappingProxyType({}),
    share: float = 0.0,
) -> _Solved:
    x = descend(space, layouts, x, weights, derivatives, drifting, share=share)
    simulated = space.simulated(x)
    residual = space.residual(simulated)
    noise = noise_of(space.problem, residual, layouts, used=len(x))
    for name, estimate in noise.items():
        _refuse_beyond_numbers(name, np.array(estimate.marginal_sd))
    return _Solved(x, simulated, residual, noise, _score(space, x, residual, layouts, noise))


def _refuse_beyond_numbers(name: str, values: Array) -> None:
    """Refuse a fit whose squares or slopes are beyond numbers: an effect's size has run away."""
    if not np.isfinite(values).all():
        raise FitError(
            "the simulation gives no usable output", where=name, rule="simulator", got="beyond numbers",
            expected="finite squares and slopes in every row", next_step="look at the sizes of its effects",
        )  # fmt: skip


def sizes_off(made: Fit, applied: AppliedEffect) -> tuple[float, list[int]]:
    """Return how far the sizes of one effect of a fit are off none, all together, and where they stand in it.

    In squared standard deviations, which are chi-squared of as many where there are none (Wald's test).
    """
    at = len(made.p)
    for each in made.active:
        if each.key == applied.key:
            break
        at += len(each.searched)
    own = [i for i, size in enumerate(applied.searched) if size.off is not None]
    off = np.array([applied.values[applied.searched[i].name] - (applied.searched[i].off or 0.0) for i in own])
    places = [at + i for i in own]
    covariance = made.covariance[np.ix_(places, places)]
    sd = np.sqrt(np.maximum(np.diag(covariance), 1e-300))  # of one scale: units part them by decades
    apart = off / sd
    return float(apart @ np.linalg.pinv(covariance / np.outer(sd, sd), hermitian=True) @ apart), places


def replace_effects(problem: Problem, fit: Fit, active: tuple[AppliedEffect, ...]) -> Fit:
    """Return a fit with other effects in it that nothing is fitted of: its covariance has them as known."""
    before, after = _columns(problem, fit.active), _columns(problem, active)
    covariance = np.zeros((len(after), len(after)))
    positions = [i for i, applied in enumerate(after) if applied in before]
    places = [before.index(after[i]) for i in positions]
    covariance[np.ix_(positions, positions)] = fit.covariance[np.ix_(places, places)]
    return replace(resimulated(problem, fit, active), covariance=covariance)


def resimulated(problem: Problem, fit: Fit, active: tuple[AppliedEffect, ...]) -> Fit:
    """Return a fit with what its parameters and other effects simulate, and what that leaves."""
    simulated = problem.simulate(fit.p, active)
    residual = {name: problem.observed[name] - column for name, column in simulated.items()}
    return replace(fit, active=active, simulated=simulated, residual=residual)


def _columns(problem: Problem, active: Sequence[AppliedEffect]) -> list[tuple[object, ...]]:
    """Return what tells the parameters of a fit apart, in the order of its covariance."""
    columns: list[tuple[object, ...]] = [(parameter.name,) for parameter in problem.free]
    for applied in active:
        at = applied.key
        columns += [(*at, parameter.name) for parameter in applied.searched]
    return columns


def noise_of(
    problem: Problem, residual: Stacked, layouts: dict[str, Layout], *, used: int = 0
) -> dict[str, Autoregression]:
    """Return the noise of every output's residual."""
    return {
        name: fit_noise(
            residual[name][layouts[name].index],
            layouts[name],
            floor=problem.floor[name],
            sd=problem.sd_of(name),
            used=used // len(layouts),
            memory=problem.memory.get(name),
        )
        for name in problem.names
    }


def log_prior(problem: Problem, p: Sequence[float]) -> float:
    """Return the logarithm of the priors' density, without its constant."""
    return -0.5 * sum(
        ((value - parameter.value) / (parameter.sd or 1.0)) ** 2
        for value, parameter in zip(p, problem.free, strict=True)
    )


def jacobian(problem: Problem, fit: Fit) -> tuple[dict[str, Array], Array]:
    """Return d(simulated)/d(x) over all rows of each output, and the sizes of x; x = (p, effects) / sizes."""
    space = Space.of(problem, fit.active)
    return space.around(space.at(fit.p))[1], space.sizes


def _white(problem: Problem, residual: Stacked, layouts: dict[str, Layout]) -> dict[str, Autoregression]:
    noise = {}
    for name, where in layouts.items():
        values = residual[name][where.index]
        size = math.sqrt(float(np.mean(values**2))) if len(values) else 0.0
        noise[name] = Autoregression(reflection=(), sd=max(size, problem.floor[name]))
    return noise


def _score(
    space: Space,
    x: Array,
    residual: Stacked,
    layouts: dict[str, Layout],
    noise: dict[str, Autoregression],
) -> float:
    p, _ = space.split(x)
    total = log_prior(space.problem, p)
    for name, where in layouts.items():
        if where.n:
            total += log_likelihood(residual[name][where.index], where, noise[name])
    return total if math.isfinite(total) else -math.inf


def _covariance(
    space: Space, solved: _Solved, alternative: _Solved | None, layouts: dict[str, Layout],
    derivatives: Derivatives, *, plain: bool,
) -> Array:  # fmt: skip
    """Return the covariance of a solution, with what the plain ``other`` disagrees with it beside.

    Under the right model the two differ as far as the plain one is the less sure. A parameter by which they
    differ by more depends on what the noise was taken for, and its uncertainty has that difference in it.
    """
    if not len(solved.x):
        return np.zeros((0, 0))
    J = derivatives.anew(solved.x)
    prior = space.problem.prior_rows(space.sizes, len(solved.x))

    def of_plain(solution: _Solved) -> Array:
        drifting = _drifting(space, layouts)
        return covariance(
            {name: drifting[name].of(rows) if name in drifting else rows for name, rows in J.items()},
            prior,
            space.sizes,
            layouts | {name: each.layout for name, each in drifting.items()},
            solution.noise | _noise_of_differences(space, solution, drifting),
            plain=True,
        )

    if plain:
        return of_plain(solved)
    matrix = covariance(J, prior, space.sizes, layouts, solved.noise, plain=False)

    def disagreeing(other: _Solved) -> Array:
        unsure = np.diag(of_plain(other))
        apart = ((other.x - solved.x) * space.sizes) ** 2
        expected = np.maximum(unsure - np.diag(matrix), 0.0)
        return np.where(apart > NOISE.apart**2 * expected, apart, 0.0)

    if alternative is None:
        return matrix
    added = disagreeing(alternative)
    if (
        added.any() and alternative.score == -math.inf
    ):  # by the straight way alone: the bent one tells how much
        added = disagreeing(_plain(space, layouts, solved, derivatives, solved.x) or alternative)
    return matrix + np.diag(added)
