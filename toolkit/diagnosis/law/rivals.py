"""A law as the rival of several effects: simpler, and better on rows that no fit has seen."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from toolkit.diagnosis.fit.sensor_noise import noise_parts
from toolkit.diagnosis.law.learn import Laws, learned
from toolkit.diagnosis.policy import STEP

if TYPE_CHECKING:
    from toolkit.diagnosis.search.search import Search
    from toolkit.diagnosis.search.time_budget import TimeBudget


def judged_by_laws(search: Search, laws: Laws, budget: TimeBudget) -> tuple[Search, Laws]:
    """Return a search and its laws, or the laws alone where they foretell better than its several effects.

    Two effects together imitate much that neither is. Asked where what they leave is more than the sensor's
    noise: coloured noise takes up the rest, and no structure shows.
    """
    parts = [noise_parts(search.problem, search.augmented, name) for name in search.problem.names]
    if len(search.steps) < 2 or laws.listed or not any(each.process_sd > each.sensor_sd for each in parts):
        return search, laws
    alone = learned(search, withdrawn=True, budget=budget)
    better = alone.held_out.total - search.held_augmented.total
    if not any(law.predicts for law in alone.listed) or better < STEP.least_gain:
        return search, laws
    bare = replace(
        search, steps=(), augmented=search.refitted, held_augmented=search.held_refitted,
        structure=search.structure_before,
    )  # fmt: skip
    return bare, alone
