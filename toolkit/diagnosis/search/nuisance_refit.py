"""What of a found effect matters for its size alone: the zero beneath it, the noise that went through it."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from toolkit.diagnosis.fit.fit import Fit, fit
from toolkit.diagnosis.fit.folds import Folds, HeldOut, hold_out
from toolkit.diagnosis.policy import STEP
from toolkit.effects.dead_band import NOISE
from toolkit.errors import FitError

if TYPE_CHECKING:
    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.diagnosis.search.candidates import CandidateEffect
    from toolkit.diagnosis.simulators.simulator import Active


def refined(
    problem: Problem, folds: Folds, base: Fit, held: HeldOut, listed: Sequence[CandidateEffect]
) -> tuple[Fit, HeldOut]:
    """Return the hypothesis that a search found with what its effects' sizes depend on.

    Under every drift with the temperature a free zero, as a nuisance: the effect counts from the first
    row's temperature, and nobody recorded at which one the channel was zeroed. A dead band whose noise
    comes before it, where the recording is more likely so.

    Parameters
    ----------
    base, held : the hypothesis found, fitted to all rows and by folds
    listed : every candidate of the case
    """
    with_zeros = _better(problem, base, _with_zeros(base, listed), -sys.float_info.max)
    if with_zeros is not base:
        with contextlib.suppress(FitError):
            held = hold_out(problem, folds, with_zeros.active, with_zeros)
            base = with_zeros
    # Rows inside a band have no noise, so that a fold's noise, and its score, hang on which rows it has: the
    # noise before a band is for the band's width alone, and the score stays that of the sharp one.
    for one in base.active:
        base = _better(problem, base, _with_noise(base, one), STEP.band_noise)
    return base, held


def without(active: Sequence[Active], one: Active) -> tuple[Active, ...]:
    """Return effects without one of them; a drift with the temperature goes with its zero."""
    gone = {(one.effect.name, one.channel, one.source, one.runs)}
    if one.effect.name == "thermal_drift":
        gone.add(("zero_offset", one.channel, None, None))
    return tuple(
        each for each in active if (each.effect.name, each.channel, each.source, each.runs) not in gone
    )


def _better(problem: Problem, base: Fit, active: tuple[Active, ...] | None, least: float) -> Fit:
    """Return the fit with other effects where it can be made, and gains so much."""
    if active is None:
        return base
    try:
        made = fit(problem, active, start=base.p)
    except FitError:
        return base
    return made if made.log_posterior >= base.log_posterior + least else base


def _with_zeros(base: Fit, listed: Sequence[CandidateEffect]) -> tuple[Active, ...] | None:
    there = {one.channel for one in base.active if one.effect.name == "zero_offset"}
    wanted = {one.channel for one in base.active if one.effect.name == "thermal_drift"} - there
    zeros = tuple(
        replace(one.active, values=one.starts[0].values | {"offset": 0.0})
        for one in listed
        if one.name == "zero_offset" and one.active.channel in wanted and one.active.runs is None
    )
    return (*base.active, *zeros) if zeros else None


def _with_noise(base: Fit, one: Active) -> tuple[Active, ...] | None:
    noise = base.noise.get(str(one.channel))
    if one.effect.name != "dead_band" or noise is None:
        return None
    return tuple(
        replace(each, values={**each.values, NOISE: noise.marginal_sd})
        if (each.effect.name, each.channel, each.runs) == (one.effect.name, one.channel, one.runs)
        else each
        for each in base.active
    )
