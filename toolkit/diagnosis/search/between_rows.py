"""Effects that read a simulation between its rows: how far a recording tells them apart.

A delay and a lag of less than a row show the same rows late, and differ by what the output did between them.
A simulation that is no equation does not know that: a smooth curve is assumed. Where straight lines change
the likelihood by more than two such effects differ, the assumption has parted them and not the recording.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.policy import VERDICT
from toolkit.diagnosis.search.superfluous import without
from toolkit.diagnosis.search.time_budget import BudgetSpentError
from toolkit.effects.filters import STRAIGHT
from toolkit.errors import FitError

K = TypeVar("K")

if TYPE_CHECKING:
    from collections.abc import Mapping

    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.diagnosis.search.forward_step import Step
    from toolkit.diagnosis.search.search import Search
    from toolkit.effects.applied import AppliedEffect


def with_readings_between_rows(search: Search) -> Search:
    """Return a search whose rivals are behind by no more than what is assumed between the rows leaves."""
    return replace(search, steps=tuple(_read_otherwise(search, step) for step in search.steps))


def _read_otherwise(search: Search, step: Step) -> Step:
    behind = {
        rival.active.key: rival.active
        for rival in step.rivals
        if rival.difference <= -VERDICT.close and rival.active.effect.reads_between_rows
    }
    beside = without(search.augmented.active, step.active)
    shown = differences(search.problem, beside, step.active, behind, search.augmented.p)
    rivals = (
        replace(rival, difference=max(rival.difference, shown.get(rival.active.key, rival.difference)))
        for rival in step.rivals
    )
    return replace(step, rivals=tuple(rivals))


def differences(
    problem: Problem,
    beside: tuple[AppliedEffect, ...],
    chosen: AppliedEffect,
    behind: Mapping[K, AppliedEffect],
    start: tuple[float, ...],
) -> dict[K, float]:
    """Return how far effects are behind a chosen one whatever is assumed between the rows, 0 at most.

    Of none where an equation is solved between the rows, or where the chosen one reads nothing there.
    """
    motion = problem.model.capability.motion
    if not behind or not chosen.effect.reads_between_rows or (motion is not None and motion.integrates):
        return {}
    try:
        readings = _readings(problem, beside, chosen, start)
        assumed, best = abs(readings[0] - readings[1]), max(readings)
        return {
            key: min(0.0, max(_readings(problem, beside, rival, start)) - best + assumed)
            for key, rival in behind.items()
        }
    except (FitError, BudgetSpentError):  # it does not run with straight lines, or no time is left to look
        return {}


def _readings(
    problem: Problem, beside: tuple[AppliedEffect, ...], applied: AppliedEffect, start: tuple[float, ...]
) -> tuple[float, float]:
    """Return the log-posteriors of a fit with a smooth curve and with straight lines between the rows."""
    curved, straight = (
        fit(problem, (*beside, replace(applied, values=values)), start=start).log_posterior
        for values in (applied.values, {**applied.values, STRAIGHT: 1.0})
    )
    return curved, straight
