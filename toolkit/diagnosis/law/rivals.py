"""Laws as the rivals of effects: simpler, and no worse on rows that no fit has seen."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.fit.sensor_noise import noise_parts
from toolkit.diagnosis.law.learn import Laws, learned
from toolkit.diagnosis.policy import LAWS, STEP

if TYPE_CHECKING:
    from toolkit.diagnosis.fit.fit import Fit
    from toolkit.diagnosis.fit.folds import HeldOut
    from toolkit.diagnosis.search.search import Search
    from toolkit.diagnosis.search.time_budget import TimeBudget


def judged_by_laws(search: Search, laws: Laws, budget: TimeBudget) -> tuple[Search, Laws]:
    """Return a search and its laws, or laws alone where these have fewer parameters and foretell as well.

    Effects imitate much that they are not, and a law beside one then mends what is left. Asked where laws
    stand beside effects, and in an equation where these leave more than the sensor's noise: what is missing
    there rings, coloured noise takes it up, and no structure shows. What has a name keeps it against a
    formula that says the same.
    """
    predicting = any(law.predicts for law in laws.listed)
    asked = predicting or _leaves_process_noise(search)
    beside = any(step.active.key == applied.key for step in search.steps for applied in laws.fit.active)
    if not beside or not asked or not laws.complete:
        return search, laws
    alone = learned(search, withdrawn=True, budget=budget)
    if not any(law.predicts for law in alone.listed) or _parameters(alone.fit) >= _parameters(laws.fit):
        return search, laws
    beside_laws = laws.held_out if predicting else search.held_augmented
    if alone.held_out.total - beside_laws.total < -STEP.least_gain:
        return search, laws
    if _same(search, alone):
        return search, laws
    bare = replace(
        search, steps=(), augmented=search.refitted, held_augmented=search.held_refitted,
        structure=search.structure_before,
    )  # fmt: skip
    return bare, alone


def _leaves_process_noise(search: Search) -> bool:
    """Tell whether an equation with the effects found leaves more than its sensors' noise."""
    motion = search.problem.model.capability.motion
    if motion is None or not motion.integrates:
        return False
    parts = [noise_parts(search.problem, search.augmented, name) for name in search.problem.names]
    return any(each.process_sd > each.sensor_sd for each in parts)


def _same(search: Search, alone: Laws) -> bool:
    """Tell whether the effects take nearly all that the laws take: these are then their own formulas."""
    problem = search.problem

    def error(held_out: HeldOut, name: str) -> float:
        counted = problem.kept[name]
        return float(np.mean((problem.observed[name] - held_out.simulated[name])[counted] ** 2))

    outputs = [name for name in problem.names if problem.kept[name].any()]
    taken = [
        (error(search.held_refitted, name) - error(search.held_augmented, name),
         error(search.held_refitted, name) - error(alone.held_out, name))
        for name in outputs
    ]  # fmt: skip
    return all(by_effects >= LAWS.same * by_laws for by_effects, by_laws in taken)


def _parameters(fit: Fit) -> int:
    return sum(len(applied.searched) for applied in fit.active)
