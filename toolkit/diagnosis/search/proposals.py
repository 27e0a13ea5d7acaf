"""Terms that an equation lacks, proposed along the recording itself.

The screen of free simulations asks what a candidate would change where the simulation is. Where something
large is missing, the simulation is elsewhere than the plant, its refit has driven the parameters off, and the
true term may look small from there, or not show at all. Led along the recording (`simulators.following`) the
equation is where the plant was: the prediction errors answer to every term, and to every parameter with its
prior, in proportion. What takes most of them is fitted first, from the values that it has there.

A proposal names nothing: joint fits of free simulations and unseen runs decide, as of every candidate.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.policy import FOLLOWING, SCREENING
from toolkit.diagnosis.search.prediction_errors import PredictionErrors, errors_along
from toolkit.diagnosis.search.screen import Scored
from toolkit.diagnosis.search.unexplained import StructureFound

if TYPE_CHECKING:
    from collections.abc import Sequence

    from toolkit.diagnosis.fit.fit import Fit
    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.diagnosis.search.candidates import CandidateEffect
    from toolkit.effects.applied import EffectKey


@dataclass(frozen=True, slots=True, eq=False)
class Proposals:
    """Terms that take a good part of the prediction errors, the best first, and those that take next to none.

    ``together`` are terms of which each takes a good part of what those before it leave, with their sizes
    beside each other; one alone is none. ``p_of`` has the p-value of every term, by its identity.
    ``hopeless`` take next to nothing beside the best, or no more than chance where none takes a good part.
    """

    scored: tuple[Scored, ...]
    together: tuple[Scored, ...]
    p_of: dict[int, float]
    hopeless: frozenset[EffectKey]

    def is_worth(self, candidate: CandidateEffect) -> bool:
        """Tell whether a candidate is worth a free simulation.

        One that turns or runs against a limit costs many times another: a hopeless one is left out.
        """
        term = candidate.active.effect.term
        abrupt = term is not None and (term.limit is not None or term.bristle is not None)
        return candidate.key not in self.hopeless or not abrupt

    def unconfirmed(self, problem: Problem) -> tuple[StructureFound, ...]:
        """Return what prediction errors show and no free simulation confirms: no name, and not nothing."""
        if not self.scored:
            return ()
        best = self.scored[0]
        place = (str(best.candidate.active.channel),)
        return tuple(
            StructureFound(
                output=name,
                variables=place,
                reason="from row to row",
                gain=best.gain,
                p_value=self.p_of[id(best)],
                rest=True,
            )
            for name in problem.names
            if problem.kept[name].any()
        )


NONE = Proposals((), (), {}, frozenset())


def proposals(problem: Problem, base: Fit) -> Proposals:
    """Return what the prediction errors of a fit propose; nothing where its equation cannot be followed."""
    if not problem.names:
        return NONE

    def along(steadier: float) -> PredictionErrors | None:
        return errors_along(problem, base, steadier)

    usual = along(1.0)
    if usual is None:
        return NONE
    found = _shown(usual)
    if found.scored:
        return found
    likeliest, plain = -np.inf, usual.likelihood
    steadiest = found
    for steadier in FOLLOWING.steadier:
        errors = along(steadier)
        if errors is None:
            break
        plain = max(plain, errors.likelihood)
        made = _shown(errors)
        if made.scored:
            likelihood = errors.beside(made.together or made.scored[:1]).likelihood
            if likelihood > likeliest:
                steadiest, likeliest = made, likelihood
    return steadiest if likeliest > plain else found


def likelihood_along(problem: Problem, base: Fit) -> float | None:
    """Return how likely a recording is to a fit's equation that wanders as is likeliest, but for a constant.

    The logarithm, with the priors in it and the parameters at their best; None where no equation can be led
    along its recording.
    """
    errors = errors_along(problem, base, 1.0)
    return None if errors is None else errors.likelihood


def _shown(errors: PredictionErrors) -> Proposals:
    """Return the terms that take a good part of prediction errors."""
    listed = errors.listed()
    tests = sum(len(candidate.starts) for candidate in listed)
    seen = errors.ranked(listed)
    p_of = {id(scored): errors.p_value(scored, tests) for scored in seen}
    shown = [
        scored
        for scored in seen
        if errors.share(scored.gain) > FOLLOWING.least
        and p_of[id(scored)] < SCREENING.alpha
        and scored.gain > FOLLOWING.near * seen[0].gain
    ]
    best = {scored.candidate.key: scored for scored in seen}
    if not shown:
        idle = (key for key, scored in best.items() if errors.p_value(scored, 1) > FOLLOWING.idle)
        unseen = (candidate.key for candidate in listed if candidate.key not in best)
        return replace(NONE, hopeless=frozenset((*idle, *unseen)))
    hopeless = frozenset(
        candidate.key
        for candidate in listed
        if candidate.key not in best or best[candidate.key].gain < FOLLOWING.hopeless * seen[0].gain
    )
    together = _pursued(errors, shown[0], listed, tests)
    p_of |= {id(scored): p_value for scored, p_value in together}
    return Proposals(tuple(shown), tuple(scored for scored, _ in together), p_of, hopeless)


def _pursued(
    errors: PredictionErrors, first: Scored, listed: Sequence[CandidateEffect], tests: int
) -> list[tuple[Scored, float]]:
    """Return terms with their p-values, each the best beside those before it (orthogonal matching pursuit).

    An offset beside dry friction moves a body as far as the friction does: no simulation comes near without
    both.
    """
    chosen, p_values = [first], [errors.p_value(first, tests)]
    while len(chosen) < FOLLOWING.together:
        beside = errors.beside(chosen)
        keys = {scored.candidate.key for scored in chosen}
        ranked = beside.ranked([candidate for candidate in listed if candidate.key not in keys])
        if not ranked or beside.share(ranked[0].gain) < FOLLOWING.later:
            break
        p_value = beside.p_value(ranked[0], tests)
        if p_value >= SCREENING.alpha:
            break
        chosen, p_values = [*chosen, ranked[0]], [*p_values, p_value]
    if len(chosen) < 2:
        return []
    sized = errors.sized(chosen)
    return [] if sized is None else list(zip(sized, p_values, strict=True))
