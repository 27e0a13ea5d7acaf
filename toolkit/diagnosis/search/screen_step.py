"""A look from one hypothesis at all that may be added to it: gains, and p-values of the whole search."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from toolkit.diagnosis.fit.fit import Fit
from toolkit.diagnosis.fit.problem import Problem
from toolkit.diagnosis.policy import SCREENING
from toolkit.diagnosis.search.candidates import Candidate
from toolkit.diagnosis.search.forward_step import place
from toolkit.diagnosis.search.null import search_p_values
from toolkit.diagnosis.search.screen import Scored, Screen, best_of


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """What was seen: ``significant`` are candidates by their best start, the best first.

    ``p_of`` has the p-value of every entry of ``scored``, by its identity; ``left`` are the candidates that
    were looked at.
    """

    screen: Screen
    left: tuple[Candidate, ...]
    scored: tuple[Scored, ...]
    significant: tuple[Scored, ...]
    p_of: dict[int, float]


def look(problem: Problem, base: Fit, listed: Sequence[Candidate], *, turn: int, seed: int) -> Look:
    """Look from a fit at the candidates that are not in it.

    Parameters
    ----------
    turn : how many steps were made before
    seed : of the null's draws
    """
    screen = Screen.of(problem, base)
    taken = {place(one) for one in base.active}
    left = [each for each in listed if place(each.active) not in taken and _is_sought(each, turn)]
    screen.prepare(left)
    scored = screen.sharpened([one for each in left for one in screen.score(each)], SCREENING.sharpened)
    p_values = search_p_values(
        screen, [one.block for one in scored], [one.gain * one.trust for one in scored], seed
    )
    p_of = {id(one): p for one, p in zip(scored, p_values, strict=True)}
    significant = tuple(one for one in best_of(scored) if p_of[id(one)] < SCREENING.alpha)
    return Look(screen, tuple(left), tuple(scored), significant, p_of)


def _is_sought(one: Candidate, turn: int) -> bool:
    """Tell whether a candidate is searched for.

    Coarse steps have a test of their own; what is there or not (a sign, a swap, a unit) is so gross that it
    comes first or second.
    """
    return one.name != "quantisation" and not (one.discrete and turn > 1)
