"""Effects of a sensor that only bend an output onto a recording, and are no physics that was left out.

Sizes of a sensor's laws are known from data sheets. One that is far larger, that ends at the bound of what is
possible, or that another one of the same channel takes back again is a free curve through the recording.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.policy import PRIORS, STEP
from toolkit.diagnosis.search.case_view import CaseView
from toolkit.errors import FitError
from toolkit.units import unit

if TYPE_CHECKING:
    from toolkit.diagnosis.fit.fit import Fit
    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.effects.applied import AppliedEffect


def only_bends(problem: Problem, fit: Fit) -> bool:
    """Tell whether one of a fit's effects only imitates another, or two of them are one flexible curve.

    One that a later effect drives to its bound is no better than one that starts there.
    """
    return (
        any(at_bound(applied) for applied in fit.active)
        or any(_is_beyond_sensors(problem, applied) for applied in fit.active)
        or any(_is_undone(problem, fit, *pair) for pair in _curves(fit))
    )


def at_bound(effect: AppliedEffect) -> bool:
    """Tell whether a parameter ends at a bound other than zero: then the effect only imitates another."""
    for parameter in effect.searched:
        if parameter.ends_count:
            continue
        value = effect.values[parameter.name]
        for bound in parameter.bounds:
            if math.isfinite(bound) and bound != 0 and abs(value - bound) < STEP.bound * abs(bound):
                return True
    return False


_OF_CELLS = ("force", "moment", "pressure", "bridge_ratio", "voltage", "count", "ratio")
"""Dimensions of what strain gauges read; of a unit that is not known it may be one."""


def is_outsized(problem: Problem, applied: AppliedEffect) -> bool:
    """Tell whether a law of a cell has a size that no cell has: something else bends the answer.

    Asked of what acts by the value that a cell carries, on what a cell can read: an iron's loop is no cell's.
    A zero may be any, where nobody tared, and a factor that was found as units are, as far from one.
    """
    by_value = applied.effect.on_channel is not None and applied.effect.on_channel.by_value
    if applied.effect.stage != "load_cells" or not by_value or applied.effect.needs_signal:
        return False
    view = CaseView(problem, applied.channel, applied.source)
    text = view.unit()
    of_cells = text is None or unit(text).dimension in _OF_CELLS
    return of_cells and applied.is_unusual(view, log_density=PRIORS.within**2 / 2)


def _is_beyond_sensors(problem: Problem, applied: AppliedEffect) -> bool:
    """Tell whether a sensor on a scale without a zero of its own has a law of a size that no sensor has.

    Its zero counts as well: a load cell is tared and may show anything before, a thermometer is not.
    """
    facts = applied.effect.on_channel
    if (
        facts is None
        or applied.effect.stage != "load_cells"
        or not (facts.by_value or applied.effect.is_zero)
    ):
        return False
    view = CaseView(problem, applied.channel, applied.source)
    if view.origin(applied.channel) is None:
        return False
    # A thermometer is off by degrees; a cell's gain may be any that somebody entered.
    return applied.is_unusual(view, log_density=PRIORS.far**2 / 2)


def _curves(fit: Fit) -> Iterator[tuple[AppliedEffect, AppliedEffect]]:
    """Give every two effects of one sensor that depend on its own value alone."""
    bending = [
        applied
        for applied in fit.active
        if applied.effect.stage == "load_cells"
        and applied.effect.on_channel is not None
        and (applied.effect.is_zero or (applied.effect.on_channel.by_value and not applied.effect.in_time))
    ]
    for one, other in combinations(bending, 2):
        if one.channel == other.channel and not (one.effect.is_zero and other.effect.is_zero):
            yield one, other


def _is_undone(problem: Problem, fit: Fit, one: AppliedEffect, other: AppliedEffect) -> bool:
    """Tell whether two effects of a channel take most of each other back, row by row."""
    name = str(one.channel)
    if name not in problem.names:
        return False

    def shown(*left_out: AppliedEffect) -> np.ndarray:
        keys = {applied.key for applied in left_out}
        active = tuple(applied for applied in fit.active if applied.key not in keys)
        return problem.simulate(fit.p, active)[name][problem.kept[name]]

    try:
        neither, first, second, both = shown(one, other), shown(other), shown(one), shown()
    except FitError:  # the simulation runs with both of them alone
        return False
    alone = np.minimum(np.abs(first - neither), np.abs(second - neither))
    together = np.abs(both - neither)
    least = STEP.visible * fit.noise[name].marginal_sd
    return float(np.mean((together < STEP.undone * alone) & (alone > least))) > STEP.undone_rows
