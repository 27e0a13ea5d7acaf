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
from toolkit.errors import FitError

if TYPE_CHECKING:
    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.diagnosis.search.candidates import CandidateEffect
    from toolkit.effects.applied import AppliedEffect


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


def without(active: Sequence[AppliedEffect], one: AppliedEffect) -> tuple[AppliedEffect, ...]:
    """Return effects without one of them; a drift with the temperature goes with its zero."""
    zero = (one.channel, None, None)

    def belongs(each: AppliedEffect) -> bool:
        return one.effect.frees_zero and each.effect.is_zero and each.key[1:] == zero

    return tuple(each for each in active if each.key != one.key and not belongs(each))


def _better(problem: Problem, base: Fit, active: tuple[AppliedEffect, ...] | None, least: float) -> Fit:
    """Return the fit with other effects where it can be made, and gains so much."""
    if active is None:
        return base
    try:
        made = fit(problem, active, start=base.p)
    except FitError:
        return base
    return made if made.log_posterior >= base.log_posterior + least else base


def _with_zeros(base: Fit, listed: Sequence[CandidateEffect]) -> tuple[AppliedEffect, ...] | None:
    there = {one.channel for one in base.active if one.effect.is_zero}
    wanted = {one.channel for one in base.active if one.effect.frees_zero} - there
    zeros = tuple(
        replace(one.active, values=one.starts[0].values | {one.active.effect.names[0]: 0.0})
        for one in listed
        if one.active.effect.is_zero and one.active.channel in wanted and one.active.runs is None
    )
    return (*base.active, *zeros) if zeros else None


def _with_noise(base: Fit, one: AppliedEffect) -> tuple[AppliedEffect, ...] | None:
    noise, key = base.noise.get(str(one.channel)), one.effect.noise_key
    if key is None or noise is None:
        return None
    return tuple(
        replace(each, values={**each.values, key: noise.marginal_sd}) if each.key == one.key else each
        for each in base.active
    )
