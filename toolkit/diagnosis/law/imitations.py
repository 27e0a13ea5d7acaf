"""Effects that only imitate a law: beside it nothing is left for them to explain."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.fit.folds import hold_out
from toolkit.diagnosis.policy import STEP
from toolkit.diagnosis.search.search import without
from toolkit.diagnosis.search.time_budget import BudgetSpentError, TimeBudget
from toolkit.errors import FitError

if TYPE_CHECKING:
    from toolkit.diagnosis.law.learn import Laws
    from toolkit.diagnosis.search.forward_step import Step
    from toolkit.diagnosis.search.search import Search
    from toolkit.effects.applied import AppliedEffect


def without_imitations(search: Search, laws: Laws, budget: TimeBudget) -> tuple[Search, Laws]:
    """Return a search and its laws without the effects that the laws made superfluous.

    Part of a law's answer looks like this effect or that one, and the search has only effects to name. One is
    dropped where the held-out score of the laws beside refitted parameters is as good without it.
    """
    if not any(law.predicts for law in laws.listed):
        return search, laws
    try:
        for dropped in _choices(search.steps):
            budget.check(f"laws without {', '.join(step.active.effect.name for step in dropped)}")
            made = _dropped(search, laws, dropped)
            if made is not None:
                return without_imitations(*made, budget)
    except BudgetSpentError:
        laws = replace(laws, complete=False)
    return search, laws


def _choices(steps: tuple[Step, ...]) -> Iterator[tuple[Step, ...]]:
    """Give all effects together, then every one alone: two may hold each other up."""
    for count in sorted({len(steps), 1} - {0}, reverse=True):
        yield from itertools.combinations(steps, count)


def _dropped(search: Search, laws: Laws, dropped: tuple[Step, ...]) -> tuple[Search, Laws] | None:
    """Return both without some effects, None where they are needed."""
    problem = search.problem

    def remaining(active: tuple[AppliedEffect, ...]) -> tuple[AppliedEffect, ...]:
        for step in dropped:
            active = without(active, step.active)
        return active

    listed = remaining(laws.fit.active)
    if len(listed) == len(laws.fit.active):  # the laws began without them
        return None
    try:
        bare = fit(problem, listed, start=laws.fit.p)
        scores = hold_out(problem, search.folds, bare.active, bare)
        if laws.held_out.total - scores.total >= STEP.least_gain:
            return None
        steps = tuple(step for step in search.steps if step not in dropped)
        if steps:
            augmented = fit(problem, remaining(search.augmented.active), start=search.augmented.p)
            held_out = hold_out(problem, search.folds, augmented.active, augmented)
        else:
            augmented, held_out = search.refitted, search.held_refitted
    except FitError:
        return None
    values = {applied.key: applied for applied in (*bare.active, *augmented.active)}
    searched = replace(
        search,
        steps=tuple(replace(step, active=values[step.active.key]) for step in steps),
        augmented=augmented,
        held_augmented=held_out,
        structure=search.structure if steps else search.structure_before,
    )
    told = tuple(replace(law, applied=values.get(law.applied.key, law.applied)) for law in laws.listed)
    return searched, replace(laws, listed=told, fit=bare, held_out=scores)
