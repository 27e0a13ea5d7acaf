"""Whether a constant, in an equation or beside an output, is more than the mean of a plant that wanders.

What stirs a plant, or takes something from it and gives it back, has a mean over any recording, and a free
simulation takes every row of the way that this led to for evidence of a constant. An equation that is led
along its recording, with the process noise that makes it likeliest, knows a constant only as far as it is
steadier than what wanders.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.diagnosis.fit.sensor_noise import noise_parts
from toolkit.diagnosis.policy import VERDICT
from toolkit.diagnosis.search.proposals import likelihood_along

if TYPE_CHECKING:
    from toolkit.diagnosis.fit.fit import Fit
    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.effects.applied import AppliedEffect


def may_wander(problem: Problem, applied: AppliedEffect) -> bool:
    """Tell whether an effect is a constant, in or beside an equation that can be led along its recording."""
    term, moving = applied.effect.term, problem.model.capability.motion
    constant = term is not None and term.of == "nothing" and term.law is None
    return (constant or applied.effect.is_zero) and moving is not None and moving.followed is not None


def outdoes_wandering(problem: Problem, bare: Fit, made: Fit) -> bool:
    """Tell whether a recording prefers a fit to the one without a constant, each as it wanders likeliest.

    An equation that cannot be followed says nothing against the constant. Nor does one beside which a free
    simulation leaves the sensor's noise alone: what wanders is left in it.
    """
    parts = [noise_parts(problem, made, name) for name in problem.names if problem.kept[name].any()]
    if all(part.process_sd <= part.sensor_sd for part in parts):
        return True
    before, after = (likelihood_along(problem, each) for each in (bare, made))
    return before is None or after is None or after - before > VERDICT.close
