"""What of a found effect matters for its size alone: the zero beneath it, the noise that went through it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from toolkit.diagnosis.fit import Fit, fit
from toolkit.effects.dead_band import NOISE
from toolkit.errors import FitError

if TYPE_CHECKING:
    from toolkit.diagnosis.candidates import Candidate
    from toolkit.diagnosis.model import Active
    from toolkit.diagnosis.problem import Problem

_BETTER = 2.0  # of the log posterior: noise that goes through a band is taken for more likely


def refined(problem: Problem, base: Fit, listed: Sequence[Candidate]) -> Fit:
    """Return the hypothesis that a search found with what its effects' sizes depend on.

    Under every drift with the temperature a free zero, as a nuisance: the effect counts from the first
    row's temperature, and nobody recorded at which one the channel was zeroed. A dead band whose noise
    comes before it, where the recording is more likely so.

    Parameters
    ----------
    base : the hypothesis found
    listed : every candidate of the case
    """
    for active, least in [*_with_zeros(base, listed), *_with_noise(base)]:
        try:
            made = fit(problem, active, start=base.p)
        except FitError:
            continue
        if made.log_posterior >= base.log_posterior + least:
            base = made
    return base


def _with_zeros(base: Fit, listed: Sequence[Candidate]) -> Iterator[tuple[tuple[Active, ...], float]]:
    there = {one.channel for one in base.active if one.effect.name == "zero_offset"}
    wanted = {one.channel for one in base.active if one.effect.name == "thermal_drift"} - there
    zeros = tuple(
        replace(one.active, values=one.starts[0].values | {"offset": 0.0})
        for one in listed
        if one.name == "zero_offset" and one.active.channel in wanted and one.active.runs is None
    )
    if zeros:
        yield (*base.active, *zeros), -float("inf")


def _with_noise(base: Fit) -> Iterator[tuple[tuple[Active, ...], float]]:
    for one in base.active:
        noise = base.noise.get(str(one.channel))
        if one.effect.name == "dead_band" and noise is not None:
            through = replace(one, values={**one.values, NOISE: noise.marginal_sd})
            yield tuple(through if each is one else each for each in base.active), _BETTER
