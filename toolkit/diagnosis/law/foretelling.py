"""What is asked before nothing is said: whether the rest is one noise, and whether no law foretells it.

A coloured noise that is fitted to a rest has taken up whatever that rest is. Where the rest is more than what
the quickest differences show as the sensor's, every law of the grammar is fitted to some runs by ordinary
least squares, beside the nominal parameters, and simulated on the others. One that takes more of unseen runs
than it leaves there is compared with what the same laws take of noise of the rest's own colour.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.fit.fit import fit, jacobian
from toolkit.diagnosis.fit.folds import hold_out
from toolkit.diagnosis.fit.noise import draws, fit_noise
from toolkit.diagnosis.fit.sensor_noise import noise_parts
from toolkit.diagnosis.law.ranking import all_responses
from toolkit.diagnosis.law.terms import terms_of
from toolkit.diagnosis.law.trial import trials_of
from toolkit.diagnosis.policy import EVEN, LAWS, STRUCTURE
from toolkit.diagnosis.search.homogeneity import about_own, uneven
from toolkit.diagnosis.search.unexplained import StructureFound

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.arrays import Array
    from toolkit.diagnosis.fit.fit import Fit
    from toolkit.diagnosis.fit.folds import Folds
    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.diagnosis.law.trial import Trial
    from toolkit.diagnosis.search.search import Search
    from toolkit.diagnosis.search.time_budget import TimeBudget

    Stacked = dict[str, Array]


def before_nothing(search: Search, *, seed: int, budget: TimeBudget) -> Search:
    """Return a search with what it has taken for noise and is none; as it was where there is none.

    The noise that the recording shows is known from then on, as one that a certificate states.

    Parameters
    ----------
    seed : of the draws of noise
    """
    if search.steps or search.skipped or any(part.is_lawful for part in search.structure):
        return search
    budget.check("whether what is left is noise")
    found = taken_for_noise(search.problem, search.folds, search.refitted, seed)
    if not found:
        return search
    problem = replace(
        search.problem, shown_sd={part.output: part.noise_sd for part in found if part.noise_sd is not None}
    )
    refitted = fit(problem, start=search.refitted.p)
    held_out = hold_out(problem, search.folds, (), refitted)
    structure = (*search.structure, *found)
    return replace(
        search, problem=problem, refitted=refitted, augmented=refitted, held_refitted=held_out,
        held_augmented=held_out, structure=structure, structure_before=structure,
    )  # fmt: skip


def taken_for_noise(problem: Problem, folds: Folds, base: Fit, seed: int) -> tuple[StructureFound, ...]:
    """Return for every output whose rest is more than its sensor's noise how it shows that it is none."""
    parts = {name: noise_parts(problem, base, name) for name in problem.names if problem.kept[name].any()}
    asked = [name for name, part in parts.items() if part.process_sd > part.sensor_sd and not part.is_sensor]
    listed = {name: uneven(problem, base, name) for name in asked}
    if folds.by_run:
        columns, _ = jacobian(problem, base)
        open_to_laws = [name for name, part in listed.items() if part is None]
        trials = [*trials_of(problem, base, open_to_laws), *terms_of(problem)] if open_to_laws else []
        for at, name in enumerate(open_to_laws):
            listed[name] = _foretold(
                problem, folds, base, name, columns[name], trials, parts[name].sensor_sd, seed + at
            )
    return tuple(part for part in listed.values() if part is not None)


def _foretold(
    problem: Problem, folds: Folds, base: Fit, name: str, nominal: Array, trials: Sequence[Trial],
    sensor_sd: float, seed: int,
) -> StructureFound | None:  # fmt: skip
    """Return what the law that foretells an output's rest best depends on, None where noise would do.

    Parameters
    ----------
    nominal : d(output)/d(what the simulation's fit has searched), (rows, parameters)
    """
    where = problem.layout(name)
    noise = fit_noise(base.residual[name][where.index], where, floor=problem.floor[name])
    drawn = draws(noise, where, STRUCTURE.foretold_draws, np.random.default_rng(seed))

    def within(columns: Array) -> Array:
        """Return what columns are within the runs: their zeros and gains are as few values as runs."""
        return about_own(problem, base, name, columns)[where.index]

    # What was met once foretells nothing, and what acts on another output is nothing here.
    asked = [
        trial
        for trial in trials
        if trial.form != "event" and (trial.acts == "enters" or name in trial.outputs)
    ]

    def laws() -> Iterator[tuple[Trial, Array]]:
        for trial, directions in zip(asked, all_responses(problem, base, asked), strict=True):
            if directions is not None and np.any(directions[name]):
                yield trial, within(directions[name])

    held = [mask[where.index] for mask in folds.held]
    nominal = within(nominal)
    left = _left_of(within(base.residual[name][:, None]), held)
    before = left(nominal)
    short = len(asked) * where.n < LAWS.columns  # all may be held for the second look
    listed = list(laws()) if short else None
    shares = [
        (float((1 - left(np.column_stack([nominal, columns])) / before)[0]), trial)
        for trial, columns in listed or laws()
    ]
    share, best = max(shares, key=lambda pair: pair[0], default=(0.0, None))
    if best is None or share < EVEN.foretold:
        return None
    none = np.zeros((problem.rows, drawn.shape[1]))
    none[where.index] = drawn
    left_of_noise = _left_of(within(none), held)
    of_none = left_of_noise(nominal)
    if any(
        1 - share > EVEN.clear * (left_of_noise(np.column_stack([nominal, columns])) / of_none).min()
        for _, columns in listed or laws()
    ):
        return None
    variables = tuple(dict.fromkeys(signal.name for signal in best.signals))
    gain = -where.n * math.log(max(1 - share, 1e-300)) / noise.correlation_rows
    p = 1 / (drawn.shape[1] + 1)
    return StructureFound(output=name, variables=variables, gain=gain, p_value=p, noise_sd=sensor_sd)


def _left_of(series: Array, held: Sequence[NDArray[np.bool_]]) -> Callable[[Array], Array]:
    """Return what is left of the square of every series by columns that were fitted to other runs.

    A function of the columns, (n, m), to (k,). Never more than the series have: nobody keeps a law that adds
    to them.

    Parameters
    ----------
    series : (n, k)
    held : rows of every fold, which are all rows together
    """
    there = np.maximum(np.sum(series**2, axis=0), 1e-300)
    parts = [series[mask] for mask in held]

    def left(columns: Array) -> Array:
        if not columns.shape[1]:
            return np.asarray(there)
        size = np.sqrt(np.sum(columns**2, axis=0))
        scaled = columns / np.where(size > 0, size, 1.0)
        apart = [scaled[mask] for mask in held]
        own = np.stack([rows.T @ rows for rows in apart])
        products = np.stack([rows.T @ part for rows, part in zip(apart, parts, strict=True)])
        others = np.linalg.pinv(own.sum(axis=0) - own, rcond=1e-10, hermitian=True)
        slopes = others @ (products.sum(axis=0) - products)
        change = np.sum(slopes * (own @ slopes - 2 * products), axis=(0, 1))
        return np.asarray(np.minimum(there + change, there))

    return left
