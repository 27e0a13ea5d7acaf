"""Held-out rows: whole runs; with one run contiguous blocks of it. Never random rows.

Rows that no fit has seen are judged by their log score. Two recordings of the same thing never agree to their
noise: a zero moves, a gain does, and what a simulation leaves on an unseen run is larger than on those it was
fitted to. A score that takes its noise from the training rows alone throws away an effect that is right in
every run but a little off in one.

Here a held-out run's residual has a zero and a gain of its own beside its noise, both normal over the runs.
How much they scatter, and how much larger the noise is than on the training rows, is what makes all held-out
runs together most likely (empirical Bayes). Each hypothesis has its own scatter: one that leaves the same
zero in every run pays for it. Runs may be louder than others too: by the noise of quiet ones a loud run is
all but impossible, the more so the better the simulation of the quiet ones.

Sources: Laird and Ware, Biometrics 38 (1982) 963, random effects with a variance of their own; Lange, Little
and Taylor, J. Am. Stat. Assoc. 84 (1989) 881, Student's distribution for rows of unequal variance.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.fit.descent import Derivatives, Space
from toolkit.diagnosis.fit.fit import Fit, fit, jacobian
from toolkit.diagnosis.fit.noise import Autoregression, Layout, log_likelihood, whiten
from toolkit.diagnosis.fit.row_order import dealt
from toolkit.diagnosis.fit.scatter_sizes import likeliest_sizes
from toolkit.diagnosis.fit.unknown_past import past_responses, taken_by_past
from toolkit.diagnosis.policy import PAST, ROWS, SCATTER
from toolkit.effects.applied import AppliedEffect

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.arrays import Array
    from toolkit.diagnosis.fit.problem import Problem


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Folds:
    """Rows that each fold holds out, and whether they are whole runs."""

    held: tuple[NDArray[np.bool_], ...]
    by_run: bool

    def told(self, runs: int) -> str:
        """Return what is held out, in words."""
        if self.by_run:
            return "run"
        return "contiguous blocks of one run" if runs == 1 else "contiguous blocks of the runs"


def folds_of(problem: Problem, fit: Fit) -> Folds:
    """Return the folds of a problem, at most five, runs dealt out in turn.

    Where a free parameter belongs to one run alone (its own initial state), a run that is held out whole
    would leave it at its prior: then blocks of every run are held out in its place.
    """
    runs = [rows for rows in problem.slices if rows.stop > rows.start]
    if len(runs) >= 2 and not _own_parameters(problem, fit):
        count = min(ROWS.folds, len(runs))
        masks = []
        for k in range(count):
            mask = np.zeros(problem.rows, dtype=bool)
            for position in runs[k::count]:
                mask[position] = True
            masks.append(mask)
        return Folds(held=tuple(masks), by_run=True)
    if problem.case.has_order:
        blocks = [np.array_split(np.arange(run.start, run.stop), ROWS.folds) for run in runs]
    else:
        blocks = [dealt(run, problem.drivers, ROWS.folds) for run in runs]
    masks = []
    for k in range(ROWS.folds):
        mask = np.zeros(problem.rows, dtype=bool)
        for parts in blocks:
            mask[parts[k]] = True
        if mask.any():
            masks.append(mask)
    return Folds(held=tuple(masks), by_run=False)


def _own_parameters(problem: Problem, fit: Fit) -> bool:
    columns, _ = jacobian(problem, fit)
    for i in range(len(problem.declared)):
        moved = [
            any(float(np.abs(columns[name][rows, i]).max()) > 0 for name in problem.names)
            for rows in problem.slices
            if rows.stop > rows.start
        ]
        if sum(moved) == 1:
            return True
    return False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HeldOut:
    """A hypothesis on rows that it has not seen: log score of each fold, and its simulation of those rows.

    ``fits`` are rows and the fit that has not seen them, one for a fold, or for each part of it.
    """

    scores: tuple[float, ...]
    simulated: dict[str, Array]
    fits: tuple[tuple[NDArray[np.bool_], Fit], ...]

    @property
    def total(self) -> float:
        """Log score over all folds."""
        return sum(self.scores)


def hold_out(problem: Problem, folds: Folds, active: Sequence[AppliedEffect], start: Fit) -> HeldOut:
    """Fit a hypothesis without each fold and score it there; the simulation is free over whole runs."""
    fits: list[tuple[NDArray[np.bool_], Fit]] = []
    of_folds = []
    # Every fold starts where all rows led: the simulation's derivatives there are the same for all of them.
    around = Derivatives(Space.of(problem, tuple(active)))
    around.anew(around.space.begin(start.p))
    simulated = {name: np.full(problem.rows, np.nan) for name in problem.names}
    for mask in folds.held:
        # An effect of runs that are all held out would keep there what it has learned of them.
        parts = _halves(problem, active, mask)
        of_parts = [
            fit(
                problem, active, start=start.p, rows=~part, noise=start.noise, rounds=2, plain=start.plain,
                derivatives=around.kept(),
            )
            for part in parts
        ]  # fmt: skip
        trained = _joined(of_parts, parts)
        fits += zip(parts, of_parts, strict=True)
        of_folds.append(trained)
        for name in problem.names:
            simulated[name][mask] = trained.simulated[name][mask]
    scores = np.zeros(len(of_folds))
    pasts = [past_responses(problem, trained) for trained in of_folds]
    for name in problem.names:
        unseen = [
            (k, run)
            for k, (mask, trained) in enumerate(zip(folds.held, of_folds, strict=True))
            for run in _unseen(problem, name, mask, trained, pasts[k])
        ]
        of_runs = scattered_scores([run for _, run in unseen], by_run=folds.by_run)
        for (k, _), score in zip(unseen, of_runs, strict=True):
            scores[k] += score
    return HeldOut(scores=tuple(scores.tolist()), simulated=simulated, fits=tuple(fits))


def _halves(
    problem: Problem, active: Sequence[AppliedEffect], mask: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], ...]:
    """Return the parts in which a fold is held out: two where an effect acts in no run outside of it.

    In the first are all other rows of the fold and the first half of those runs, in the second their rest.
    """
    seen = ~mask & np.any(list(problem.kept.values()), axis=0)
    later = np.zeros_like(mask)
    for applied in active:
        own = [rows for run, rows in zip(problem.runs, problem.slices, strict=True) if applied.acts_in(run)]
        if applied.runs is None or not applied.searched or any(seen[rows].any() for rows in own):
            continue
        for rows in own:
            later[(rows.start + rows.stop) // 2 : rows.stop] = True
    later &= mask
    return (mask & ~later, later) if later.any() and (mask & ~later).any() else (mask,)


def _joined(fits: Sequence[Fit], parts: Sequence[NDArray[np.bool_]]) -> Fit:
    """Return the fit of a fold: of each of its parts the simulation by what has not seen it."""
    first, *others = fits
    for trained, part in zip(others, parts[1:], strict=True):
        simulated, residual = (
            {name: np.where(part, after[name], before[name]) for name in before}
            for before, after in ((first.simulated, trained.simulated), (first.residual, trained.residual))
        )
        first = replace(first, simulated=simulated, residual=residual)
    return first


def _unseen(
    problem: Problem, name: str, mask: NDArray[np.bool_], trained: Fit, past: Mapping[str, Array]
) -> list[UnseenRun]:
    """Return the rows of one output that a fold holds out, run by run, each with an unknown past."""
    runs = []
    for rows in problem.slices:
        within = np.zeros_like(mask)
        within[rows] = mask[rows]
        where = problem.layout(name, within)
        if where.n:
            at = where.index
            before = past[name][at] if name in past else np.zeros((where.n, 0))
            runs.append(
                UnseenRun.of(
                    trained.residual[name][at],
                    trained.simulated[name][at],
                    where,
                    trained.noise[name],
                    before[:, before.any(axis=0)],
                )
            )
    return runs


def matters(problem: Problem, before: HeldOut, after: HeldOut, least: float) -> bool:
    """Tell whether some output's held-out error falls by a share that a user would notice.

    By its mean square or by its variance: where a drift starts is found in a later step.
    """
    for name, observed in problem.observed.items():
        error_before, error_after = (
            problem.judged(name, observed - held_out.simulated[name]) for held_out in (before, after)
        )
        if np.mean(error_after**2) < np.mean(error_before**2) * (1 - least) or np.var(error_after) < np.var(
            error_before
        ) * (1 - least):
            return True
    return False


def unseen_error(problem: Problem, held_out: HeldOut) -> float:
    """Return the logarithm of the mean square error of unseen rows, summed over the outputs."""
    errors = (
        problem.judged(name, observed - held_out.simulated[name])
        for name, observed in problem.observed.items()
    )
    return sum(math.log(max(float(np.mean(error**2)), sys.float_info.min)) for error in errors)


def beyond_form(problem: Problem, refitted: HeldOut, before: HeldOut, after: HeldOut, form: float) -> bool:
    """Tell whether some output's error falls by more than the form of what was found before may leave.

    Parameters
    ----------
    refitted, before : without any effect, and with those that were found
    form : how far an effect's form is off, as a share of what the effect is
    """
    for name, observed in problem.observed.items():
        square_refitted, square_before, square_after = (
            float(np.mean(problem.judged(name, observed - held_out.simulated[name]) ** 2))
            for held_out in (refitted, before, after)
        )
        if square_before - square_after > form**2 * max(square_refitted - square_before, 0.0):
            return True
    return False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class UnseenRun:
    """One output of one run that a fit has not seen, in units of the noise of its training rows.

    Attributes
    ----------
    n : independent values
    constant : logarithm of the density of values without any residual, that of the noise's scale in it
    rest : sum of squares of the innovations
    inner : products of the whitened constant and simulated output with themselves, (2, 2)
    outer : their products with the innovations, (2,)
    """

    n: float
    constant: float
    rest: float
    inner: Array
    outer: Array

    @staticmethod
    def of(
        residual: Array, simulated: Array, where: Layout, noise: Autoregression, before: Array | None = None
    ) -> UnseenRun:
        """Return a run from its kept values (n,) and their layout.

        Parameters
        ----------
        before : how they answer to states of effects at the run's first row, (n, states), which are what
            suits them best where that is worth its cost
        """
        size = math.sqrt(float(np.mean(simulated**2))) or 1.0
        white = whiten(np.stack([residual, np.ones(where.n), simulated / size], axis=1), where, noise)
        constant = log_likelihood(residual, where, noise) + 0.5 * float(white[:, 0] @ white[:, 0])
        left, cost = white, 0.0 if before is None else PAST.cost * before.shape[1]
        if before is not None and cost:
            taken = taken_by_past(whiten(before, where, noise), white)
            if 0.5 * float(white[:, 0] @ taken[:, 0]) > cost:
                left, constant = white - taken, constant - cost
        product = white.T @ left
        return UnseenRun(
            n=where.n if noise.memory is None else noise.memory.independent(where),
            constant=constant,
            rest=float(product[0, 0]),
            inner=product[1:, 1:],
            outer=product[1:, 0],
        )


def scattered_scores(runs: Sequence[UnseenRun], *, by_run: bool) -> tuple[float, ...]:
    """Return the log score of every unseen run of one output, under the scatter that makes them most likely.

    Parameters
    ----------
    by_run : whole runs were held out; of blocks of a run nothing says that they have zeros of their own
    """
    if not runs:
        return ()
    even = math.inf
    if not by_run or len(runs) < SCATTER.fewest:
        return _scores(runs, 0.0, 0.0, even)

    def likeliest(freedom: float) -> tuple[float, float]:
        return likeliest_sizes(runs, lambda zero, gain: sum(_scores(runs, zero, gain, freedom)))

    sizes = likeliest(even)
    scores = _scores(runs, *sizes, even)
    freedom = max(SCATTER.loudness, key=lambda each: sum(_scores(runs, *sizes, each)))
    # Each of the degrees is as likely before: what is chosen among so many has to be worth the choice.
    choice = math.log(len(SCATTER.loudness)) / len(runs)
    uneven = tuple(score - choice for score in _scores(runs, *likeliest(freedom), freedom))
    return max(scores, uneven, key=sum)


def _scores(
    runs: Sequence[UnseenRun], zero: float, gain: float, freedom: float = math.inf
) -> tuple[float, ...]:
    """Return the score of every run under a scatter, the noise as large as it then is most likely.

    The scatter is in units of that noise: then its likeliest size has a closed form. Where runs are not
    equally loud, the square of each run's noise is drawn from a scaled inverse chi-squared distribution of
    some degrees of ``freedom``, beside which a run's values are of Student's multivariate distribution.
    """
    scale = np.array([zero, gain])
    n, squares, halves = np.array([run.n for run in runs], dtype=float), [], []
    for run in runs:
        # Woodbury: of the covariance 1 + X S X' only a matrix of two rows is left.
        middle = np.eye(2) + scale[:, None] * run.inner * scale[None, :]
        scaled = scale * run.outer
        squares.append(max(run.rest - float(scaled @ np.linalg.solve(middle, scaled)), 0.0))
        halves.append(0.5 * math.log(max(float(np.linalg.det(middle)), 1.0)))
    before = np.array([run.constant for run in runs]) - halves
    return tuple((before + _densities(n, np.array(squares), freedom)).tolist())


def _densities(n: Array, squares: Array, freedom: float) -> Array:
    """Return the log density of runs of (n,) values by their sums of squares, but for its constant.

    The noise's own square is the likeliest, at least that of the training rows: no rows are quieter for not
    having been seen.
    """
    from scipy.optimize import brentq
    from scipy.special import gammaln

    if freedom == math.inf:
        square = max(float(squares.sum() / n.sum()), 1.0)
        return np.asarray(-0.5 * n * math.log(square) - 0.5 * squares / square)

    def slope(square: float) -> float:
        return float(np.sum((freedom + n) * squares / (freedom * square + squares)) - n.sum())

    square = brentq(slope, 1.0, float((squares / n).max())) if slope(1.0) > 0 else 1.0
    spread = freedom * square
    return np.asarray(
        gammaln((freedom + n) / 2)
        - gammaln(freedom / 2)
        - 0.5 * n * math.log(spread / 2)
        - 0.5 * (freedom + n) * np.log1p(squares / spread)
    )
