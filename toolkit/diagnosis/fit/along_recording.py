"""A fit's equation led along its recording, and where that starts each run.

``initial`` puts the states at a run's first row where a case says, and what it says is often read off one
noisy row, or off a difference of rows that is half a row late. A free simulation carries that error through
the whole run: a body that swings keeps the wrong swing. Led along its recording, an equation starts where the
recording goes on from, whatever it lacks later. A run that starts elsewhere by more than either can tell, and
shows it, has starts of its own from then on: nuisances, which name no physics. A start that a case states is
one of its statements: where every run starts by as much beside it, a gauge's zero is as likely.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.fit.fit import resimulated
from toolkit.diagnosis.fit.sensor_noise import noise_parts
from toolkit.diagnosis.policy import NOISE, SCREENING
from toolkit.diagnosis.simulators.following import PARAMETER_STEP
from toolkit.diagnosis.simulators.run_starts import RunStart
from toolkit.diagnosis.simulators.simulator import Following
from toolkit.errors import FitError

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.fit.fit import Fit
    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.diagnosis.simulators.following import Followed


def followed_along(problem: Problem, base: Fit, steadier: float = 1.0) -> tuple[Followed, Array] | None:
    """Return a fit's equation along its recording; None where it cannot be followed.

    And how its prediction errors answer to a prior sd of every free parameter, (rows, outputs, parameters).

    Parameters
    ----------
    steadier : by what the process noise is less than the likeliest
    """
    moving = problem.model.capability.motion
    if moving is None or moving.followed is None:
        return None
    p = dict(problem.known) | {
        parameter.name: value for parameter, value in zip(problem.free, base.p, strict=True)
    }
    asked = Following(
        steps={parameter.name: PARAMETER_STEP * (parameter.sd or 1.0) for parameter in problem.free},
        sensor={name: noise_parts(problem, base, name).sensor_sd or 1.0 for name in problem.names},
        unread={
            name: tuple(np.flatnonzero(~kept & np.isfinite(problem.observed[name])).tolist())
            for name, kept in problem.kept.items()
        },
        steadier=steadier,
    )
    try:
        followed, answers = moving.followed(problem.runs, p, base.active, asked)
    except FitError:
        return None
    return followed, answers / PARAMETER_STEP


def with_run_starts(problem: Problem, base: Fit) -> Problem:
    """Return a problem with starts of its own for every run that does not start where ``initial`` puts it.

    Parameters
    ----------
    base : a fit, with effects or without; the more it explains, the surer its starts are
    """
    from scipy.stats import norm

    if problem.starts:
        problem = replace(problem, free=problem.declared)
        base = resimulated(problem, replace(base, p=base.p[: len(problem.free)]), base.active)
    made, moving = followed_along(problem, base), problem.model.capability.motion
    if made is None or moving is None:
        return problem
    (followed, _), own = made, len(moving.states)
    off, sd = followed.starts[:own], np.maximum(followed.starts_sd[:own], 1e-9 * followed.spread[:own, None])
    read = np.array([state.begins_read for state in moving.states], dtype=bool)
    far = read[:, None] & (np.abs(off / sd) > norm.isf(SCREENING.alpha / (2 * off.size)))
    starts = {
        k: [
            RunStart(
                state=state.name, at=i, run=k, run_name=run.name, unit=state.unit,
                value=float(off[i, k]), sd=float(sd[i, k]),
            )
            for i, state in enumerate(moving.states)
            if read[i]
        ]
        for k, run in enumerate(problem.runs)
        if far[:, k].any()
    }  # fmt: skip
    listed = [start for of_run in starts.values() for start in of_run]
    if not listed:
        return problem
    freed = replace(problem, free=(*problem.free, *listed))
    try:
        moved = freed.simulate(freed.begun(base.p), base.active)
    except FitError:
        return problem
    shown = {k for k in starts if any(_is_seen(problem, base, moved, name, k) for name in problem.names)}
    return replace(problem, free=(*problem.free, *(start for start in listed if start.run in shown)))


def _is_seen(problem: Problem, base: Fit, moved: Mapping[str, Array], name: str, run: int) -> bool:
    """Tell whether an output of a run moves by more than its sensor's noise can."""
    rows = problem.slices[run]
    change = (moved[name] - base.simulated[name])[rows][problem.kept[name][rows]]
    least = NOISE.mismatch * noise_parts(problem, base, name).sensor_sd
    return len(change) > 0 and float(np.sqrt(np.mean(change**2))) > least
