"""Outputs that only drift: an integrating plant that is driven open loop is judged by its rates.

Where nothing leads an output back, every small force moves it further for as long as it acts. What a position
is off by at the end of such a run is the sum of all that happened before, and says of no single force whether
it is right; how fast it moves meanwhile does.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.fit.sensor_noise import noise_parts, robust_sd
from toolkit.diagnosis.policy import DRIFT
from toolkit.diagnosis.simulators.simulator import TermPattern
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effects
from toolkit.errors import FitError

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.fit.fit import Fit
    from toolkit.diagnosis.fit.problem import Problem


def judged_by_rates(problem: Problem, base: Fit) -> Problem:
    """Return a problem whose drifting outputs are judged by their rates.

    Parameters
    ----------
    base : fit about which small forces are looked at
    """
    motion = problem.model.capability.motion
    driven = bool(problem.case.drivers) and problem.case.has_time
    if motion is None or not motion.integrates or not driven:
        return problem
    drifting = {
        name
        for name in _led_nowhere(problem, base)
        if problem.kept[name].any() and _wanders(problem, base.residual[name], name)
    }
    return replace(problem, rates={name: _rows_apart(problem, base, name) for name in sorted(drifting)})


def _led_nowhere(problem: Problem, base: Fit) -> set[str]:
    """Return the outputs that a small steady force moves as far in each half of every run."""
    steady = next(effect for effect in effects().values() if effect.term and effect.term.of == "nothing")
    pattern = TermPattern(((steady, (dict.fromkeys(steady.names, 1.0),)),))
    drifting: set[str] = set()
    for channel, _ in problem.model.places(steady):
        applied = AppliedEffect(effect=steady, channel=channel, values={})
        try:
            moved = problem.pushed(base.p, base.active, applied, pattern, 1)
        except FitError:
            continue
        for name, response in moved.items():
            ends = [
                (abs(float(response[(at.start + at.stop) // 2, 0])), abs(float(response[at.stop - 1, 0])))
                for at in problem.slices
                if at.stop - at.start >= DRIFT.fewest
            ]
            if ends and all(0 < DRIFT.grows * half < end for half, end in ends):
                drifting.add(name)
    return drifting


def _rows_apart(problem: Problem, base: Fit, name: str) -> int:
    """Return the fewest rows over which most moves of the error are more than the sensor's noise."""
    noise = math.sqrt(2) * noise_parts(problem, base, name).sensor_sd
    longest, apart = _part(problem, name), 1
    while (
        apart < longest and robust_sd(_moves(problem, base.residual[name], name, apart)) < DRIFT.clear * noise
    ):
        apart *= 2
    return min(apart, longest)


def _wanders(problem: Problem, residual: Array, name: str) -> bool:
    """Tell whether most of an error is the sum of what came before, and not what happens there."""
    parts = [residual[at][problem.kept[name][at]] for at in problem.slices]
    variance = float(np.mean([part.var() for part in parts if len(part)]))
    moves = float(np.mean(_moves(problem, residual, name, _part(problem, name)) ** 2))
    return bool(moves < DRIFT.wanders * 2 * variance)


def _part(problem: Problem, name: str) -> int:
    """Return the rows of the longest part of a run over which a rate is taken."""
    counts = [int(problem.kept[name][at].sum()) for at in problem.slices]
    return max(min(count for count in counts if count) // DRIFT.parts, 1)


def _moves(problem: Problem, residual: Array, name: str, apart: int) -> Array:
    parts = [residual[at][problem.kept[name][at]] for at in problem.slices]
    return np.concatenate([part[apart:] - part[:-apart] for part in parts])
