"""A look from one hypothesis at all that may be added to it: gains, p-values, and what a refit has masked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from toolkit.diagnosis.fit.fit import Fit
from toolkit.diagnosis.fit.problem import Problem
from toolkit.diagnosis.policy import PRIORS, SCREENING
from toolkit.diagnosis.search.candidates import CandidateEffect
from toolkit.diagnosis.search.null import search_p_values
from toolkit.diagnosis.search.screen import LinearisedFit, Scored, best_of
from toolkit.effects.applied import EffectKey
from toolkit.errors import FitError


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """What was seen: ``significant`` are candidates by their best start, the best first.

    ``p_of`` has the p-value of every entry of ``scored``, by its identity; ``candidates`` are those that
    were looked at.
    """

    screen: LinearisedFit
    candidates: tuple[CandidateEffect, ...]
    scored: tuple[Scored, ...]
    significant: tuple[Scored, ...]
    p_of: dict[int, float]


def look(problem: Problem, base: Fit, listed: Sequence[CandidateEffect], *, turn: int, seed: int) -> Look:
    """Look from a fit at the candidates that are not in it.

    Parameters
    ----------
    turn : how many steps were made before
    seed : of the null's draws
    """
    screen = LinearisedFit.of(problem, base)
    taken = {applied.key for applied in base.active}
    candidates = [
        candidate for candidate in listed if candidate.key not in taken and _is_sought(candidate, turn)
    ]
    screen.prepare(candidates)
    scored = screen.sharpened(
        [one for candidate in candidates for one in screen.score(candidate)], SCREENING.sharpened
    )
    p_values = search_p_values(
        screen, [trial.block for trial in scored], [trial.gain * trial.trust for trial in scored], seed
    )
    p_of = {id(trial): p for trial, p in zip(scored, p_values, strict=True)}
    significant = tuple(one for one in best_of(scored) if p_of[id(one)] < SCREENING.alpha)
    return Look(screen, tuple(candidates), tuple(scored), significant, p_of)


def _is_sought(candidate: CandidateEffect, turn: int) -> bool:
    """Tell whether a candidate is searched for.

    What is read off the digits has a test of its own; what is there or not (a sign, a swap, a unit) is so
    gross that it comes first or second.
    """
    return not candidate.active.effect.from_digits and not (candidate.discrete and turn > 1)


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
    ranked = best_of([one for candidate in candidates for one in screen.score(candidate)])
    return frozenset(trial.candidate.key for trial in ranked[: PRIORS.masked])
