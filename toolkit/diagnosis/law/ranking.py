"""Laws ranked by linearised fits: their responses, their gains, the best shape nearby."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, cast

import numpy as np

from toolkit.diagnosis.law.trial import Trial, amplitudes
from toolkit.diagnosis.policy import LAWS
from toolkit.diagnosis.search.screen import LinearisedFit
from toolkit.diagnosis.simulators.simulator import TermPattern
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.law import ITSELF, parts_of
from toolkit.errors import FitError

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.fit.fit import Fit
    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.effects.formula import Formula

    Stacked = dict[str, Array]


_LARGEST = 1e100  # of a response: the squares of larger ones are no numbers any more


def all_responses(problem: Problem, base: Fit, trials: Sequence[Trial]) -> Iterator[Stacked | None]:
    """Give the responses to several laws, one after the other: of long recordings all are too much to hold.

    Those in the equation of one state are propagated together, as many as may be held.
    """
    waiting: dict[object, list[int]] = {}
    for i in reversed(range(len(trials))):
        if trials[i].acts == "enters":
            waiting.setdefault(_entry(trials[i]), []).append(i)
    pushed: dict[int, Stacked] = {}
    for i, trial in enumerate(trials):
        if trial.acts == "enters":
            if i not in pushed:
                part = _part(waiting[_entry(trial)], trials, LAWS.columns // max(problem.rows, 1))
                pushed |= zip(part, _pushed(problem, base, [trials[k] for k in part]), strict=True)
            yield _usable(problem, pushed.pop(i))
            continue
        columns = _evaluated(problem, base, trial)
        if trial.swayed:
            answered = {name: sway[:, None] * columns for name, sway in trial.swayed.items()}
        else:
            answered = {str(trial.applied.channel): columns}
        none = np.zeros_like(columns)
        yield _usable(problem, {name: answered.get(name, none) for name in problem.names})


def _entry(trial: Trial) -> tuple[object, ...]:
    """Return where and in which runs a law enters an equation."""
    return trial.applied.channel, trial.applied.runs


def _part(waiting: list[int], trials: Sequence[Trial], limit: int) -> list[int]:
    """Take the next laws from the end of those that wait, with so many columns, one law at the least."""
    part, columns = [waiting.pop()], 0
    while waiting and columns < limit:
        part.append(waiting.pop())
        columns += len(amplitudes(trials[part[-1]].applied))
    return part


def _usable(problem: Problem, directions: Stacked) -> Stacked | None:
    counted = np.concatenate([directions[name][problem.kept[name]] for name in problem.names])
    largest = float(np.abs(counted).max(initial=0.0))
    if not 0 < largest < _LARGEST:  # nor what is no number
        return None
    return {name: np.nan_to_num(columns) for name, columns in directions.items()}


def at_coefficients(trial: Trial, coefficients: Sequence[float]) -> Trial:
    """Return a law with its amplitudes as a linearised fit has them."""
    reached = dict(zip(amplitudes(trial.applied), coefficients, strict=True))
    return replace(trial, applied=replace(trial.applied, values={**trial.applied.values, **reached}))


def ranked(
    problem: Problem, base: Fit, screen: LinearisedFit, listed: Sequence[Trial], weight: float
) -> list[Trial]:
    """Return laws with their exact gains and amplitudes, the best first: of each the best start.

    Parameters
    ----------
    weight : what a parameter costs of the log-likelihood
    """
    best = likely(problem, base, screen, listed, weight)
    exact = []
    for trial, directions in zip(best, all_responses(problem, base, best), strict=True):
        if directions is not None:
            gain, coefficients, trust = screen.gain(directions)
            exact.append(replace(at_coefficients(trial, coefficients), gain=gain * trust))
    return sorted(exact, key=lambda trial: -(trial.gain - 2 * weight * trial.cost))


def ranked_in_place(
    problem: Problem, refit: Fit, law: Trial, trials: Sequence[Trial], weight: float
) -> list[Trial]:
    """Return laws of an equation that would take the place of one that was fitted, the best first.

    A refit without any is far from where the plant was, and a ranking there knows little of shapes. Beside
    the first good law the simulation is where it should be, and what that does there another has to do.

    Parameters
    ----------
    refit : with the law, at its end
    trials : laws at their starts; those that have no memory and enter an equation are asked
    """
    asked = [trial for trial in trials if trial.acts == "enters" and trial.form == "static"]
    if law.acts != "enters" or law.form != "static" or law.partner is not None or not asked:
        return []
    applied = refit.active[-1]
    (does,) = all_responses(problem, refit, [replace(law, applied=applied)])
    if does is None:
        return []
    sizes = [applied.values[name] for name in amplitudes(applied)]
    moved = {name: columns @ sizes for name, columns in does.items()}
    held = replace(applied, effect=replace(applied.effect, discrete=True))
    without = replace(
        refit,
        active=(*refit.active[:-1], held),
        residual={name: refit.residual[name] + change for name, change in moved.items()},
        simulated={name: refit.simulated[name] - change for name, change in moved.items()},
    )
    return ranked(problem, without, LinearisedFit.of(problem, without), asked, weight)


def likely(
    problem: Problem, base: Fit, screen: LinearisedFit, listed: Sequence[Trial], weight: float
) -> list[Trial]:
    """Return the laws that explain most at a fixed noise, of each the best start, the best ones refined."""
    quick: dict[object, Trial] = {}
    for trial, directions in zip(listed, all_responses(problem, base, listed), strict=True):
        if directions is None:
            continue
        gain = screen.quick(directions)[0] - 2 * weight * trial.cost
        if trial.place not in quick or gain > quick[trial.place].gain:
            quick[trial.place] = replace(trial, gain=gain)
    best = sorted(quick.values(), key=lambda trial: -trial.gain)[: LAWS.sharpened]
    best[: LAWS.refined] = _refined(problem, base, screen, best[: LAWS.refined])
    return best


def _refined(problem: Problem, base: Fit, screen: LinearisedFit, trials: Sequence[Trial]) -> list[Trial]:
    """Return laws with what shapes them where their quick gain is largest nearby: a grid is coarse.

    All laws move together, each to the best of its neighbours; where none is better, its steps are halved.
    """
    best = list(trials)
    gains = [-math.inf] * len(best)
    steps = [_steps(trial) for trial in best]
    for turn in range(LAWS.rounds):
        neighbours = [
            (i, _moved(trial, offset))
            for i, trial in enumerate(best)
            for offset in _offsets(steps[i], centre=not turn)
        ]
        neighbours = [(i, trial) for i, trial in neighbours if _within(trial)]
        moved = set()
        for (i, trial), directions in zip(
            neighbours, all_responses(problem, base, [trial for _, trial in neighbours]), strict=True
        ):
            gain = -math.inf if directions is None else screen.quick(directions)[0]
            if gain > gains[i]:
                best[i], gains[i] = trial, gain
                moved.add(i)
        steps = [
            step if i in moved else {name: 0.5 * size for name, size in step.items()}
            for i, step in enumerate(steps)
        ]
    return best


def _steps(trial: Trial) -> dict[str, float]:
    """Return steps of what shapes a law: a share of a width or a time, of a place a share of the range."""
    values = trial.applied.values
    spread = float(np.ptp(trial.signals[0].values)) if trial.signals else 1.0
    return {
        parameter.name: 0.05 * spread if parameter.bounds[0] < 0 else 0.25 * abs(values[parameter.name])
        for parameter in trial.applied.effect.parameters
        if parameter.off is None
    }


def _offsets(steps: Mapping[str, float], *, centre: bool) -> Iterator[dict[str, float]]:
    for signs in itertools.product((0, 1, -1), repeat=len(steps)):
        if any(signs) or centre:
            yield {name: sign * step for sign, (name, step) in zip(signs, steps.items(), strict=True)}


def _moved(trial: Trial, offset: Mapping[str, float]) -> Trial:
    values = {**trial.applied.values}
    for name, by in offset.items():
        values[name] += by
    return replace(trial, applied=replace(trial.applied, values=values))


def _within(trial: Trial) -> bool:
    """Tell whether what shapes a law lies inside its bounds."""
    values = trial.applied.values
    return all(values[parameter.name] > parameter.bounds[0] for parameter in trial.applied.effect.parameters)


def p_value(trial: Trial, looked: int) -> float:
    """Return the chance of so large a gain among as many laws as were looked at."""
    from scipy.stats import chi2

    log_p = float(chi2.logsf(max(trial.gain, 0.0), trial.cost)) + math.log(max(looked, 1) * trial.looked)
    return min(1.0, max(math.exp(max(log_p, -690.0)), 1e-300))


def _formula(applied: AppliedEffect) -> Formula:
    return parts_of(applied.effect.name)[1]


def pattern_of(trials: Sequence[Trial]) -> TermPattern:
    """Return laws as terms of the equation of one state, a column for each amplitude, of one."""
    return TermPattern(
        tuple(
            (
                trial.applied.effect,
                tuple(_unit(trial.applied, name).values for name in amplitudes(trial.applied)),
            )
            for trial in trials
        )
    )


def _pushed(problem: Problem, base: Fit, trials: Sequence[Trial]) -> list[Stacked]:
    """Return the linear responses to laws in the equation of one state, a column for each amplitude."""
    pattern = pattern_of(trials)
    widths = [len(starts) for _, starts in pattern.terms]
    nothing = [{name: np.zeros((problem.rows, width)) for name in problem.names} for width in widths]
    try:
        pushes = problem.pushed(base.p, base.active, trials[0].applied, pattern, sum(widths))
    except FitError:
        return nothing
    ends = np.cumsum(widths).tolist()
    # A law is taken from the rate, a push is added to it.
    return [
        {name: -columns[:, end - width : end] for name, columns in pushes.items()}
        for width, end in zip(widths, ends, strict=True)
    ]


def _unit(applied: AppliedEffect, name: str) -> AppliedEffect:
    """Return a law with one of its amplitudes alone, of one."""
    none = dict.fromkeys(amplitudes(applied), 0.0)
    return replace(applied, values={**applied.values, **none, name: 1.0})


def _evaluated(problem: Problem, base: Fit, trial: Trial) -> Array:
    """Return what a law adds to its output, or the factor by which it scales a tire, for each amplitude."""
    applied, law = trial.applied, _formula(trial.applied)
    names = amplitudes(applied)
    columns, changes = (np.zeros((problem.rows, len(names))) for _ in range(2))
    for run, rows in zip(problem.runs, problem.slices, strict=True):
        if not applied.acts_in(run):
            continue
        # What scales a tire does not read an output.
        simulated = 1.0 if trial.swayed else base.simulated[str(applied.channel)][rows]
        signals = {ITSELF: simulated, "time": run.t}
        signals |= {name: run.columns[name] for name in law.signals if name in run.columns}
        for k, name in enumerate(names):
            values = _unit(applied, name).values
            with np.errstate(all="ignore"):
                change = np.broadcast_to(cast("Array", law(signals, values, run.t)), run.rows)
                columns[rows, k] = simulated * change if trial.acts == "multiplies" else change
                changes[rows, k] = change
    # A zero or a gain is an effect, and no law of a signal that never changes its sign.
    alike = applied.runs is None and is_one_number(changes)
    return np.zeros_like(columns) if alike else columns


def is_one_number(columns: Array) -> bool:
    """Tell whether every column (n, k) has one value in all its rows."""
    sizes = np.abs(columns).max(axis=0, initial=0.0)
    return bool((np.ptp(columns, axis=0) <= LAWS.apart**0.5 * sizes).all())


def at_unit_size(trial: Trial, values: Array) -> Array:
    """Return a law of one signal without memory at values of it, (n,) to (n, amplitudes), each size one."""
    law = _formula(trial.applied)
    (signal,) = law.signals
    sizes = [_unit(trial.applied, name).values for name in amplitudes(trial.applied)]
    with np.errstate(all="ignore"):
        return np.column_stack(
            [np.broadcast_to(cast("Array", law({signal: values}, size)), len(values)) for size in sizes]
        )
