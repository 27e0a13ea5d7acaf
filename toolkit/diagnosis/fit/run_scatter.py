"""Zeros and gains that move from run to run, in the values of a fit and in their intervals.

A load cell comes back to another zero, an amplifier to another gain. A fit that takes all runs for one
sample weighs every row, and states a drift by thousands of rows of three runs: too sure, and pulled by the
runs that happen to lie off. Here every run has a zero and a gain of its own, drawn from a normal distribution
about none whose two sizes make the recording likeliest (restricted maximum likelihood). Values are those of
generalised least squares beside them, and what they make a value unsure by has the quantile of as many runs.

A scatter is taken up only where it makes the recording likelier than the coloured noise that else holds it.

A parameter may move from run to run as well: the mass of water that somebody wrote down, a clamp that was
tightened anew. A value of its own then fits every run, and no common one does.

Source: Laird and Ware, Biometrics 38 (1982) 963; Pinheiro and Bates, Mixed-Effects Models (2000), ch. 2.
"""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.fit.descent import Space
from toolkit.diagnosis.fit.fit import Fit, fit, jacobian, resimulated
from toolkit.diagnosis.fit.noise import Autoregression, fit_noise, log_likelihood, whiten
from toolkit.diagnosis.fit.scatter_sizes import likeliest_sizes
from toolkit.diagnosis.policy import SCATTER, VERDICT
from toolkit.errors import FitError

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.fit.folds import HeldOut
    from toolkit.diagnosis.fit.problem import Problem


_PASSES = 4  # linear about the fit of the pass before
_BETTER = 1e-3  # of the log-likelihood: less is no other fit


@dataclass(frozen=True, slots=True, kw_only=True)
class RunScatter:
    """How far runs differ in one output: standard deviations of their zeros [its unit] and gains [1]."""

    output: str
    zero_sd: float
    gain_sd: float


@dataclass(frozen=True, slots=True, kw_only=True)
class RunParameter:
    """A parameter with a value of its own in every run: run, value and standard deviation [its unit].

    ``left`` has the mean square that these values leave of each output [its unit squared], ``worth`` the
    independent values of all runs beside them.
    """

    name: str
    values: tuple[tuple[str, float, float], ...]
    left: Mapping[str, float]
    worth: float

    @property
    def ends(self) -> tuple[tuple[str, float, float], tuple[str, float, float]]:
        """The runs of the smallest and of the largest value."""
        ordered = sorted(self.values, key=lambda entry: entry[1])
        return ordered[0], ordered[-1]


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """One run of one output, whitened: products of its columns [of the fit | zero, gain | residual]."""

    fitted: Array  # J'J
    across: Array  # J'X
    inner: Array  # X'X
    answer: Array  # J'y
    outer: Array  # X'y
    rest: float  # y'y


@dataclass(frozen=True, slots=True, eq=False)
class _Output:
    """The runs of one output under a noise, and the likelihood of its values but for their squares.

    What the runs have in ``parts`` stands here over all of them: summed where no scatter weighs it, else one
    behind the other.
    """

    parts: tuple[_Part, ...]
    constant: float
    size: float
    fitted: Array  # J'J
    across: Array  # J'X of every run
    inner: Array  # X'X of every run
    answer: Array  # J'y
    outer: Array  # X'y of every run
    rest: float  # y'y

    @staticmethod
    def of(parts: tuple[_Part, ...], constant: float, size: float) -> _Output:
        return _Output(
            parts, constant, size, np.sum([part.fitted for part in parts], axis=0),
            np.stack([part.across for part in parts]), np.stack([part.inner for part in parts]),
            np.sum([part.answer for part in parts], axis=0), np.stack([part.outer for part in parts]),
            sum(part.rest for part in parts),
        )  # fmt: skip

    def weighed(self, scale: tuple[float, float]) -> tuple[Array, Array]:
        """Return of every run what a scatter makes of its zero and gain (2, 2), and what it takes of J'X."""
        zero_gain = np.array(scale)
        inside = np.eye(2) + zero_gain[:, None] * self.inner * zero_gain
        return inside, self.across @ (zero_gain[:, None] * np.linalg.inv(inside) * zero_gain)


def with_run_scatter(problem: Problem, made: Fit) -> tuple[Fit, tuple[RunScatter, ...]]:
    """Return a fit beside zeros and gains of the runs, and how far these scatter.

    It is the fit itself where they do not. Held-out scores and the fit's noise stay: they are what effects
    were judged by. A run that an effect is bound to has that effect, and no scatter.
    """
    if len(problem.runs) < SCATTER.intervals or not len(Space.of(problem, made.active).sizes):
        return made, ()
    about = _About.of(problem, made)
    alone = sum(
        log_likelihood(
            made.residual[name][problem.layout(name).index], problem.layout(name), made.noise[name]
        )
        for name in about.outputs
    )
    if not any(map(any, about.sizes.values())) or about.likelihood < alone + VERDICT.close:
        return made, ()
    with contextlib.suppress(FitError):  # a step leads where the simulation gives nothing
        for _ in range(_PASSES):
            there = _About.of(problem, about.moved)
            if there.likelihood < about.likelihood + _BETTER:
                break
            about = there
    sizes = about.space.sizes
    covariance = about.covariance * np.outer(sizes, sizes)
    scatter = tuple(
        RunScatter(output=name, zero_sd=zero, gain_sd=gain / about.outputs[name].size)
        for name, (zero, gain) in about.sizes.items()
        if zero or gain
    )
    return replace(about.made, covariance=covariance), scatter


def run_parameter(problem: Problem, made: Fit, *, least: float) -> RunParameter | None:
    """Return the free parameter whose own values fit the runs best, the others as in a fit; None of any.

    Parameters
    ----------
    made : a fit without effects
    least : share of some output's mean square that own values have to take, looked at linearly before any
        run is fitted

    Raises
    ------
    FitError
        the simulation gives nothing at a run's own value
    """
    if len(problem.runs) < 2 or not problem.declared:
        return None
    columns, _ = jacobian(problem, made)
    taken = [_taken_by_own(problem, made, columns, at) for at in range(len(problem.declared))]
    best = int(np.argmax(taken))
    if taken[best] < least:
        return None
    parameter = problem.free[best]
    known = dict(zip((each.name for each in problem.free), made.p, strict=True))
    values, worth = [], 0.0
    squares, rows = dict.fromkeys(problem.names, 0.0), dict.fromkeys(problem.names, 0)
    for run, place in zip(problem.runs, problem.slices, strict=True):
        kept = {name: column[place] for name, column in problem.kept.items()}
        if not any(map(np.any, kept.values())):
            continue
        alone = replace(
            problem, runs=(run,), free=(parameter,), known=problem.known | known, kept=kept,
            observed={name: column[place] for name, column in problem.observed.items()},
            slices=(slice(0, run.rows),),
        )  # fmt: skip
        own = fit(alone, start=(made.p[best],))
        values.append((run.name, own.p[0], math.sqrt(max(float(own.covariance[0, 0]), 0.0))))
        for name, column in kept.items():
            squares[name] += float(np.sum(own.residual[name][column] ** 2))
            rows[name] += int(column.sum())
            worth += int(column.sum()) / own.noise[name].correlation_rows
    left = {name: square / max(rows[name], 1) for name, square in squares.items()}
    return RunParameter(name=parameter.name, values=tuple(values), left=left, worth=worth)


def _taken_by_own(problem: Problem, made: Fit, columns: Mapping[str, Array], at: int) -> float:
    """Return the share of an output's mean square that own values of a parameter take, at most, linearly.

    Parameters
    ----------
    columns : d(output)/d(parameter) of every output, (rows, parameters)
    at : which parameter
    """
    shares = []
    for name, kept in problem.kept.items():
        left = 0.0
        for place in problem.slices:
            slope, rest = columns[name][place, at][kept[place]], made.residual[name][place][kept[place]]
            left += float(rest @ rest) - float(slope @ rest) ** 2 / max(float(slope @ slope), 1e-300)
        rest = made.residual[name][kept]
        shares.append(1 - left / max(float(rest @ rest), 1e-300))
    return max(shares)


def held_out_beside_scatter(problem: Problem, held_out: HeldOut) -> HeldOut:
    """Return unseen rows by fits that have their values as a fit of all rows has: beside zeros and gains.

    A size and the share of the error that it takes are then of one kind of fit. The scores stay.
    """
    simulated = {name: column.copy() for name, column in held_out.simulated.items()}
    for mask, trained in held_out.fits:
        seen = replace(problem, kept={name: kept & ~mask for name, kept in problem.kept.items()})
        with contextlib.suppress(FitError):  # the fit stays what it is
            beside, scatter = with_run_scatter(seen, trained)
            for name, column in simulated.items() if scatter else ():
                column[mask] += (beside.simulated[name] - trained.simulated[name])[mask]
    return replace(held_out, simulated=simulated)


@dataclass(frozen=True, slots=True, eq=False)
class _About:
    """A problem, linear about a fit, beside the scatter that makes the recording likeliest there."""

    problem: Problem
    made: Fit
    space: Space
    outputs: Mapping[str, _Output]
    beneath: tuple[Array, Array]
    sizes: Mapping[str, tuple[float, float]]

    @staticmethod
    def of(problem: Problem, made: Fit) -> _About:
        space = Space.of(problem, made.active)
        columns = space.around(space.at(made.p))[1]
        outputs = {
            name: _output(problem, made, name, columns[name])
            for name in problem.names
            if problem.kept[name].any()
        }
        prior = problem.prior_rows(space.sizes, len(space.sizes))
        beneath = (prior.T @ prior, -prior.T @ problem.off_priors(made.p))
        return _About(problem, made, space, outputs, beneath, _likeliest(outputs, beneath))

    @property
    def likelihood(self) -> float:
        """Log-likelihood, with the priors, where the linear fit is best."""
        own = 0.5 * float(np.sum(self.problem.off_priors(self.made.p) ** 2))
        return _likelihood(self.outputs, self.beneath, self.sizes, restricted=False) - own

    @property
    def moved(self) -> Fit:
        """The fit where the linear one is best."""
        step = _solved(self.outputs, self.beneath, self.sizes)[0]
        p, active = self.space.split(
            np.clip(self.space.at(self.made.p) + step, self.space.low, self.space.high)
        )
        values = iter(active)
        effects = tuple(each if each.effect.from_digits else next(values) for each in self.made.active)
        return resimulated(self.problem, replace(self.made, p=tuple(p)), effects)

    @property
    def covariance(self) -> Array:
        """Covariance of the searched vector, that of the scatter by the quantile of as many runs."""
        none = dict.fromkeys(self.outputs, (0.0, 0.0))
        within, whole = (
            np.linalg.pinv(_solved(self.outputs, self.beneath, sizes)[1]) for sizes in (none, self.sizes)
        )
        return np.asarray(within + _few(len(self.problem.runs)) * (whole - within))


def _few(runs: int) -> float:
    """Return by what a variance of so few runs is larger, for an interval of the normal quantile."""
    from scipy.stats import norm, t

    level = (1 + VERDICT.interval) / 2
    return float((t.ppf(level, runs - 1) / norm.ppf(level)) ** 2)


def _output(problem: Problem, made: Fit, name: str, columns: Array) -> _Output:
    """Return the runs of an output, whitened by what they leave beside zeros and gains of their own."""
    where = problem.layout(name)
    residual, simulated = made.residual[name][where.index], made.simulated[name][where.index]
    size = math.sqrt(float(np.mean(simulated**2))) or 1.0
    own = np.stack([np.ones(where.n), simulated / size], axis=1)
    runs = [
        np.flatnonzero((where.index >= whole.start) & (where.index < whole.stop)) for whole in problem.slices
    ]
    runs = [rows for rows in runs if len(rows)]
    bound = {run for applied in made.active for run in applied.runs or ()}
    for run, whole in zip(problem.runs, problem.slices, strict=True):
        if run.name in bound:
            own[(where.index >= whole.start) & (where.index < whole.stop)] = 0.0
    bare = residual.copy()
    for rows in runs:
        bare[rows] -= own[rows] @ np.linalg.lstsq(own[rows], residual[rows], rcond=1e-9)[0]
    noise: Autoregression = fit_noise(
        bare, where, floor=problem.floor[name], sd=problem.sd_of(name), used=2 * len(runs),
        memory=problem.memory.get(name),
    )  # fmt: skip
    white = whiten(np.hstack([columns[where.index], own, residual[:, None]]), where, noise)
    J, X, y = white[:, :-3], white[:, -3:-1], white[:, -1]
    return _Output.of(
        tuple(
            _Part(
                fitted=J[rows].T @ J[rows], across=J[rows].T @ X[rows], inner=X[rows].T @ X[rows],
                answer=J[rows].T @ y[rows], outer=X[rows].T @ y[rows], rest=float(y[rows] @ y[rows]),
            )
            for rows in runs
        ),
        log_likelihood(residual, where, noise) + 0.5 * float(y @ y),
        size,
    )  # fmt: skip


_Sizes = Mapping[str, tuple[float, float]]
_Beneath = tuple["Array", "Array"]


def _solved(outputs: Mapping[str, _Output], beneath: _Beneath, sizes: _Sizes) -> tuple[Array, Array]:
    """Return by what the fit moves beside a scatter, and its normal matrix."""
    normal, answer = beneath[0].copy(), beneath[1].copy()
    for name, output in outputs.items():
        _, taken = output.weighed(sizes[name])
        normal += output.fitted - np.tensordot(taken, output.across, axes=((0, 2), (0, 2)))
        answer += output.answer - np.tensordot(taken, output.outer, axes=((0, 2), (0, 1)))
    return np.asarray(np.linalg.lstsq(normal, answer, rcond=1e-12)[0]), normal


def _likelihood(
    outputs: Mapping[str, _Output], beneath: _Beneath, sizes: _Sizes, *, restricted: bool
) -> float:
    """Return the log-likelihood with priors where the fit is best beside a scatter."""
    moved, normal = _solved(outputs, beneath, sizes)
    total, answer = 0.0, beneath[1].copy()
    for name, output in outputs.items():
        inside, taken = output.weighed(sizes[name])
        scaled = output.outer * np.array(sizes[name])
        own = float(np.sum(scaled * np.linalg.solve(inside, scaled[:, :, None])[:, :, 0]))
        total += output.constant - 0.5 * (output.rest - own)
        total -= 0.5 * float(np.linalg.slogdet(inside)[1].sum())
        answer += output.answer - np.tensordot(taken, output.outer, axes=((0, 2), (0, 1)))
    total += 0.5 * float(answer @ moved)
    if restricted:
        total -= 0.5 * float(np.linalg.slogdet(normal + 1e-300 * np.eye(len(normal)))[1])
    return total


def _likeliest(outputs: Mapping[str, _Output], beneath: _Beneath) -> dict[str, tuple[float, float]]:
    """Return the scatter of zeros and gains of every output, one output after the other."""
    sizes: dict[str, tuple[float, float]] = dict.fromkeys(outputs, (0.0, 0.0))
    for _, (name, output) in itertools.product(range(2 if len(outputs) > 1 else 1), outputs.items()):

        def likelihood(zero: float, gain: float, name: str = name) -> float:
            return _likelihood(outputs, beneath, {**sizes, name: (zero, gain)}, restricted=True)

        sizes[name] = likeliest_sizes(output.parts, likelihood)
    return sizes
