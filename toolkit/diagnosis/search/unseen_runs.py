"""Naming by unseen runs alone, where what is left is beyond all noise.

A smooth mismatch foretells itself from its own past. Taken for coloured noise it makes a long recording worth
a handful of values, among which nothing is significant, and its log score is one of the next row and not
of the run. But a rest above a tenth of the output is known not to be noise: then the question is which effect
simulates whole runs that no fit has seen, freely, without most of that rest. Fits are ordinary least squares.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.fit.fit import Fit
from toolkit.diagnosis.fit.folds import Folds, HeldOut, hold_out
from toolkit.diagnosis.policy import PRIORS, SCREENING, UNSEEN, VERDICT
from toolkit.diagnosis.search.bends import only_bends
from toolkit.diagnosis.search.case_view import CaseView
from toolkit.diagnosis.search.forward_step import Rival, Step, joint_fit
from toolkit.diagnosis.search.noise_floor import is_beyond_noise
from toolkit.diagnosis.search.screen import LinearisedFit, Scored, best_of
from toolkit.diagnosis.search.screen_step import Look, about_declared
from toolkit.errors import FitError

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.fit.problem import Problem


@dataclass(frozen=True, slots=True, eq=False)
class _Shown:
    """A candidate that stands: its fit, and its unseen rows."""

    scored: Scored
    fit: Fit
    held_out: HeldOut


def shown_on_unseen_runs(
    problem: Problem,
    folds: Folds,
    base: Fit,
    held_base: HeldOut,
    view: Look,
) -> tuple[Fit, HeldOut, Step] | None:
    """Return the first effect if it takes most of the rest of whole unseen runs, None where none does.

    Of several that do, those whose errors the runs do not tell apart are one class, the likeliest first.
    """
    if base.active or not asked_of_unseen_runs(problem, folds, base, view.screen):
        return None
    shown = []
    for trial, made in _fitted(problem, base, view)[: UNSEEN.judged]:
        try:
            held_out = hold_out(problem, folds, made.active, made)
        except FitError:
            continue
        if takes_most(problem, held_base, held_out):
            shown.append(_Shown(trial, made, held_out))
    if not shown:
        return None
    of_shown = gains_of(problem, held_base, [(each.fit, each.held_out) for each in shown])
    gains = {id(each): gain for each, gain in zip(shown, of_shown, strict=True)}
    best = max(gains.values())

    def order(each: _Shown) -> tuple[bool, float]:
        active, gain = each.fit.active[-1], gains[id(each)]
        prior = active.log_prior(CaseView(problem, active.channel, active.source))
        return gain <= best - VERDICT.close, -gain - prior

    chosen, *others = sorted(shown, key=order)
    gain = gains[id(chosen)]
    step = Step(
        active=chosen.fit.active[-1],
        p_value=min(view.p_of.get(id(chosen.scored), 1.0), math.exp(-min(gain, 700.0))),
        held_out_gain=gain,
        gain=gain,
        rivals=tuple(Rival(active=each.fit.active[-1], difference=gains[id(each)] - gain) for each in others),
    )
    return chosen.fit, chosen.held_out, step


def _fitted(problem: Problem, base: Fit, view: Look) -> list[tuple[Scored, Fit]]:
    """Return the likely candidates with their plain joint fits, one each, those that leave the least first.

    A refit without what is missing may have gone where it no longer helps (a wheel that stands too soon):
    they are looked at from the declared parameters as well.
    """
    starts = [(base, trial) for trial in _likely(view.scored)]
    moved = np.abs(problem.off_priors(base.p)).max(initial=0.0) > PRIORS.moved
    screen = about_declared(problem, base) if moved else None
    if screen is not None:
        screen.prepare(view.candidates)
        trials = [score for candidate in view.candidates for score in screen.score(candidate)]
        likely = _likely(screen.sharpened(trials, SCREENING.sharpened))
        starts += [(screen.base, trial) for trial in likely]
    best: dict[object, tuple[Scored, Fit]] = {}
    for begin, trial in starts:
        zero = trial.candidate.zero_beside(begin.active)
        made = joint_fit(problem, begin, (*zero, trial.active), plain=True)
        if made is None or only_bends(problem, made):
            continue
        before = best.get(trial.candidate.key)
        if before is None or _left(problem, made.simulated) < _left(problem, before[1].simulated):
            best[trial.candidate.key] = (trial, made)
    return sorted(best.values(), key=lambda entry: _left(problem, entry[1].simulated))


def _likely(scored: Sequence[Scored]) -> list[Scored]:
    """Return the candidates that explain anything, by their best start; none that is there or not."""
    return [
        trial
        for trial in best_of(scored)
        if trial.gain > 0 and not trial.candidate.discrete and not trial.active.effect.nuisance
    ][: UNSEEN.fitted]


def _runs(problem: Problem, simulated: Mapping[str, Array]) -> Array:
    """Return the mean square of every run, each output over its own spread, (runs,)."""
    squares = np.zeros(len(problem.slices))
    for name, kept in problem.kept.items():
        spread = float(np.std(problem.observed[name][kept])) or 1.0
        away = np.where(kept, (problem.observed[name] - simulated[name]) / spread, 0.0)
        squares += [float(np.sum(away[rows] ** 2)) / max(int(kept[rows].sum()), 1) for rows in problem.slices]
    return squares


def _left(problem: Problem, simulated: Mapping[str, Array]) -> float:
    return float(np.mean(_runs(problem, simulated)))


def asked_of_unseen_runs(
    problem: Problem, folds: Folds, base: Fit, screen: LinearisedFit, least: int = UNSEEN.runs
) -> bool:
    """Tell whether whole runs that no fit has seen have to say what is right, as no noise can.

    Parameters
    ----------
    least : runs, of which fewer agree by chance
    """
    enough = folds.by_run and len(problem.runs) >= least
    few = screen.trust(base.noise) <= SCREENING.least_trust
    return enough and few and is_beyond_noise(problem, base)


def takes_most(
    problem: Problem, before: HeldOut | Fit, after: HeldOut | Fit, usual: float = UNSEEN.usual
) -> bool:
    """Tell whether most of the error is gone, and half of it in every run.

    Parameters
    ----------
    usual : share of the median run's mean square; nearly all where it is to be a name
    """
    shares = 1 - _runs(problem, after.simulated) / np.maximum(_runs(problem, before.simulated), 1e-300)
    return bool(np.median(shares) > usual and shares.min() > UNSEEN.every)


def gains_of(problem: Problem, before: HeldOut, shown: Sequence[tuple[Fit, HeldOut]]) -> list[float]:
    """Return the gains of the log-likelihood of independent values, of fits on rows that they have not seen.

    There are as many as the rows are worth beside the longest memory that any of the fits leaves: each is
    judged by the same rows.
    """
    gains = [0.0] * len(shown)
    for name, kept in problem.kept.items():
        observed = problem.observed[name][kept]
        worth = int(kept.sum()) / max(fit.noise[name].correlation_rows for fit, _ in shown)
        left = float(np.mean((observed - before.simulated[name][kept]) ** 2))
        for i, (_, held_out) in enumerate(shown):
            after = float(np.mean((observed - held_out.simulated[name][kept]) ** 2))
            gains[i] += 0.5 * worth * math.log(max(left, 1e-300) / max(after, 1e-300))
    return gains


def unseen_errors(
    problem: Problem, name: str, declared: Mapping[str, Array], refitted: HeldOut
) -> tuple[float, float, float]:
    """Return the errors of a refit on rows that it has not seen, of the declared simulation, and of a mean.

    They are root mean squares of an output; the third is of an output that stands still at its own mean.

    Parameters
    ----------
    declared : the simulation as declared, of every output (rows,)
    """
    observed, kept = problem.observed[name], problem.kept[name]
    mean = np.full(len(observed), float(np.mean(observed[kept])))
    refit, plain, still = (
        float(np.sqrt(np.mean((observed - simulated)[kept] ** 2)))
        for simulated in (refitted.simulated[name], declared[name], mean)
    )
    return refit, plain, still


def does_harm(problem: Problem, declared: Mapping[str, Array], refitted: HeldOut) -> bool:
    """Tell whether a refit is worse, on rows that it has not seen, than no refit or than standing still."""
    for name, kept in problem.kept.items():
        if kept.any():
            refit, *others = unseen_errors(problem, name, declared, refitted)
            if refit**2 > VERDICT.shown * min(others) ** 2:
                return True
    return False
