"""A look from one hypothesis at all that may be added to it: gains, p-values, and what a refit has masked."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.fit.fit import Fit, noise_of
from toolkit.diagnosis.fit.noise import log_likelihood
from toolkit.diagnosis.fit.problem import Problem
from toolkit.diagnosis.policy import PRIORS, SCREENING, STEP, VERDICT
from toolkit.diagnosis.search.candidates import CandidateEffect
from toolkit.diagnosis.search.screen import LinearisedFit, Scored, best_of
from toolkit.effects.applied import EffectKey
from toolkit.errors import FitError

if TYPE_CHECKING:
    from toolkit.arrays import Array

# What the best of a whole search is worth: the null distribution of its largest statistic.


def search_p_values(
    screen: LinearisedFit, blocks: Sequence[Array], gains: Sequence[float], seed: int
) -> list[float]:
    """Return for every statistic the chance that a search without an effect finds one as improbable.

    Parameters
    ----------
    blocks : orthonormal whitened responses of every candidate and start, (values, k)
    gains : their gains of twice the log-likelihood, each times its trust
    """
    if not blocks:
        return []
    widths = [block.shape[1] for block in blocks]
    stacked = np.hstack(blocks)
    gram = stacked.T @ stacked
    values, vectors = np.linalg.eigh(gram)
    keep = values > 1e-9 * max(float(values.max()), 1e-300)
    root = vectors[:, keep] * np.sqrt(values[keep])
    n = screen.n
    dof = max(n - screen.sizes.size - int(keep.sum()), 1)
    rng = np.random.default_rng(seed)
    normal = rng.standard_normal((SCREENING.draws, root.shape[1]))
    z = normal @ root.T
    total = (normal**2).sum(axis=1) + rng.chisquare(dof, SCREENING.draws)
    smallest = np.full(SCREENING.draws, math.inf)
    starts = np.cumsum([0, *widths[:-1]])
    for width in sorted(set(widths) - {0}):
        chosen = starts[[i for i, start_width in enumerate(widths) if start_width == width]]
        part = sum(z[:, chosen + k] ** 2 for k in range(width))
        share = np.asarray(part) / total[:, None]
        statistic = -n * np.log1p(-np.minimum(share, 1 - 1e-9))
        smallest = np.minimum(smallest, _log_p(statistic.max(axis=1), width))
    smallest.sort()
    p_values = []
    for gain, width in zip(gains, widths, strict=True):
        p = float(_log_p(np.array([max(gain, 0.0)]), max(width, 1))[0])
        below = int(np.searchsorted(smallest, p, side="right"))
        if below >= SCREENING.fewest_draws:
            p_values.append((below + 1) / (SCREENING.draws + 1))
        else:
            # Beyond what was drawn: Bonferroni on as many independent tests as the drawn tail shows.
            tail = float(smallest[int(SCREENING.tail * SCREENING.draws)])
            p_values.append(min(1.0, math.exp(min(0.0, p - tail)) * SCREENING.tail))
    return p_values


def _log_p(statistic: Array, dof: int) -> Array:
    """Return the logarithm of chi-squared's upper tail; far out by its leading term."""
    from scipy.special import gammaincc, gammaln

    half = 0.5 * statistic
    tail = gammaincc(0.5 * dof, half)
    far = (0.5 * dof - 1) * np.log(np.maximum(half, 1e-300)) - half - gammaln(0.5 * dof)
    return np.where(tail > 1e-290, np.log(np.maximum(tail, 1e-300)), far)


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """What was seen: ``significant`` are candidates by their best start, the best first.

    ``hinted`` are those that a short coloured series neither shows nor rules out, the best first;
    ``p_of`` has the p-value of every entry of ``scored``, by its identity; ``candidates`` are those that
    were looked at.
    """

    screen: LinearisedFit
    candidates: tuple[CandidateEffect, ...]
    scored: tuple[Scored, ...]
    significant: tuple[Scored, ...]
    hinted: tuple[Scored, ...]
    p_of: dict[int, float]


def look(problem: Problem, base: Fit, listed: Sequence[CandidateEffect], *, turn: int, seed: int) -> Look:
    """Look from a fit at the candidates that are not in it.

    Parameters
    ----------
    turn : how many steps were made before
    seed : of the null's draws
    """
    screen = LinearisedFit.of(problem, base)
    present = {applied.key for applied in base.active}
    candidates = [
        candidate for candidate in listed if candidate.key not in present and _is_sought(candidate, turn)
    ]
    screen.prepare(candidates)
    scored = screen.sharpened(
        [score for candidate in candidates for score in screen.score(candidate)], SCREENING.sharpened
    )
    p_values = search_p_values(
        screen, [trial.block for trial in scored], [trial.gain * trial.trust for trial in scored], seed
    )
    p_of = {id(trial): p for trial, p in zip(scored, p_values, strict=True)}
    best = best_of(scored)
    significant = tuple(score for score in best if p_of[id(score)] < SCREENING.alpha)
    hinted = tuple(score for score in best if SCREENING.alpha <= p_of[id(score)] < STEP.hinted)
    return Look(screen, tuple(candidates), tuple(scored), significant, hinted, p_of)


def _is_sought(candidate: CandidateEffect, turn: int) -> bool:
    """Tell whether a candidate is searched for.

    What is read off the digits has a test of its own; what is there or not (a sign, a swap, a unit) is so
    gross that it comes first or second.
    """
    return not candidate.active.effect.from_digits and not (candidate.discrete and turn > 1)


def from_declared(problem: Problem, base: Fit, view: Look, *, of_all: bool = False) -> Look:
    """Return a look with the effects in it that are significant from the declared parameters alone.

    An effect that changes the shape of an answer (a lost sign, a stop, friction at rest) drives a refit
    without it far off, and from there it may not help at all. Seen from the declared values it has to explain
    more than the refit does, by as much as the search asks of every candidate.

    ``of_all`` effects it is asked where the refit does harm: nothing is to be read off from there.
    """
    from scipy.stats import chi2

    ranked = {scored.candidate.key for scored in view.significant}
    reshaping = [
        candidate
        for candidate in view.candidates
        if (of_all or candidate.active.effect.misleads) and candidate.key not in ranked
    ]
    if not reshaping or np.abs(problem.off_priors(base.p)).max(initial=0.0) < PRIORS.moved:
        return view
    screen = about_declared(problem, base)
    if screen is None:
        return view
    trials = screen.sharpened(
        [score for candidate in reshaping for score in screen.score(candidate)], SCREENING.sharpened
    )
    significant, p_of = [], dict(view.p_of)
    for trial in best_of(trials):
        gain = trial.gain + 2 * (screen.log_likelihood - base.log_posterior)
        p = float(chi2.sf(max(gain, 0.0) * trial.trust, trial.dof)) * (len(view.scored) + len(trials))
        if p < SCREENING.alpha:
            # What misleads begins at the refit as well: any other is seen from here alone.
            begin = None if trial.candidate.active.effect.misleads else screen.base.p
            significant.append(replace(trial, gain=gain, p=begin))
            p_of[id(significant[-1])] = p
    together = sorted((*view.significant, *significant), key=lambda trial: -trial.gain)
    return replace(view, significant=tuple(together), p_of=p_of)


def about_declared(problem: Problem, base: Fit) -> LinearisedFit | None:
    """Return the screen about the declared parameters; None where the effects so far cannot be run there."""
    declared = tuple(parameter.value for parameter in problem.free)
    try:
        simulated = problem.simulate(declared, base.active)
    except FitError:
        return None
    residual = {name: problem.observed[name] - values for name, values in simulated.items()}
    layouts = {name: problem.layout(name) for name in problem.names}
    there = replace(base, p=declared, simulated=simulated, residual=residual)
    noise = noise_of(problem, residual, layouts)
    likelihood = sum(log_likelihood(residual[n][at.index], at, noise[n]) for n, at in layouts.items())
    return LinearisedFit.of(problem, replace(there, noise=noise, log_posterior=likelihood))


def masked(problem: Problem, base: Fit, candidates: Sequence[CandidateEffect]) -> frozenset[EffectKey]:
    """Return the candidates that explain most from the declared parameters; none where they hold.

    Where a parameter left its prior far behind, it stands in for something that was left out. Seen from there
    the true effect looks small, because what it explains is explained already, and another that only mends
    what the parameter could not do looks large. From the declared values the true effect is large; joint
    fits, with the priors in their score, decide between the two.

    Parameters
    ----------
    base : the fit so far, its effects with their values
    candidates : those that may be added to it
    """
    moved = [
        abs(value - parameter.value) / parameter.sd
        for value, parameter in zip(base.p, problem.free, strict=True)
        if parameter.sd is not None
    ]
    if not moved or max(moved) < PRIORS.far:
        return frozenset()
    declared = tuple(parameter.value for parameter in problem.free)
    try:
        simulated = problem.simulate(declared, base.active)
    except FitError:  # from there, an effect that was found already is beyond what can be simulated
        return frozenset()
    residual = {name: problem.observed[name] - values for name, values in simulated.items()}
    screen = LinearisedFit.of(problem, replace(base, p=declared, simulated=simulated, residual=residual))
    screen.prepare(candidates)
    ranked = best_of([score for candidate in candidates for score in screen.score(candidate)])
    if not ranked:
        return frozenset()
    # The last of them takes along what says the same: none is left out by its place among equals.
    least = ranked[: PRIORS.masked][-1].gain - VERDICT.close
    return frozenset(trial.candidate.key for trial in ranked if trial.gain >= least)
