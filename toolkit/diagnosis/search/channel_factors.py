"""A channel that is off by one factor: whether it is a ratio of two units, or a number of its own.

Ratios of all pairs of units lie so densely that some lies near any factor. One is named, with its exact
value, where a free factor that is fitted jointly with all else says so: the ratio is nearer to it than ratios
are by chance, and beside it no more is left than noise. Else the channel has a factor, with its interval.

How many ratios are as near by chance is the density of the factor's own likelihood, over their density on a
logarithmic scale: the evidence of a factor that may be any against that of the ratio (Bayes factor).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.fit.folds import hold_out
from toolkit.diagnosis.fit.sensor_noise import noise_parts
from toolkit.diagnosis.policy import UNITS, VERDICT
from toolkit.diagnosis.simulators.parameter_units import channel_unit
from toolkit.effects.applied import ORIGIN, AppliedEffect
from toolkit.effects.catalogue import effects
from toolkit.effects.unit_ratios import unit_ratios
from toolkit.errors import FitError
from toolkit.units import is_unit

if TYPE_CHECKING:
    from toolkit.diagnosis.fit.fit import Fit
    from toolkit.diagnosis.fit.folds import Folds, HeldOut
    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.diagnosis.search.forward_step import Step
    from toolkit.effects.effect import Effect


def is_ratio(effect: Effect) -> bool:
    """Tell whether an effect is one factor out of a list of ratios."""
    return effect.discrete and _is_factor(effect)


def factor_of(applied: AppliedEffect) -> float:
    """Return the factor of a channel by an effect that is one."""
    facts = applied.effect.on_channel
    assert facts is not None  # noqa: S101  asked of factors alone
    return (facts.proportion or 0.0) + applied.values[applied.effect.names[0]]


def free_factor(like: AppliedEffect, factor: float) -> AppliedEffect:
    """Return the effect of a free factor at the place of another effect.

    It is bounded as factors between units are, and has to leave the signal in its outputs as those do.
    """
    effect = next(each for each in effects().values() if _is_factor(each) and not each.discrete)
    facts, (parameter,) = effect.on_channel, effect.parameters
    off = 0.0 if facts is None else facts.proportion or 0.0
    most = UNITS.farthest**2
    wide = replace(parameter, bounds=(1 / most - off, most - off))
    origin = {ORIGIN: like.values[ORIGIN]} if ORIGIN in like.values else {}
    return replace(
        like,
        effect=replace(effect, parameters=(wide,), needs_signal=True),
        values={parameter.name: factor - off} | origin,
    )


def ratio_of(like: AppliedEffect, ratio: float, half: float) -> AppliedEffect:
    """Return the effect of an exact ratio of units at the place of another effect.

    Parameters
    ----------
    half : of an interval around it that holds that of the free factor
    """
    effect = next(each for each in effects().values() if is_ratio(each))
    name = effect.names[0]
    origin = {ORIGIN: like.values[ORIGIN]} if ORIGIN in like.values else {}
    return replace(like, effect=effect, values={name: ratio, f"_half_{name}": half} | origin)


def unit_of_factor(problem: Problem, made: Fit, applied: AppliedEffect) -> AppliedEffect | None:
    """Return the unit that a fitted free factor is, with what is left open of it; None where it may be any.

    Parameters
    ----------
    made : a fit with the free factor among its effects
    """
    text = channel_unit(problem.case, problem.model, applied.channel)
    at = len(problem.free)
    for each in made.active:
        if each.key == applied.key:
            applied = each
            break
        at += len(each.searched)
    factor, variance = factor_of(applied), float(made.covariance[at, at])
    if not (factor > 0 and variance > 0 and is_unit(text)) or 1 / UNITS.least < factor < UNITS.least:
        return None
    sd = math.sqrt(variance)
    ratios = list(unit_ratios(text).values())
    near = min(ratios, key=lambda ratio: abs(math.log(ratio / factor)), default=1.0)
    if not _by_chance(near, factor, sd / factor, ratios) < UNITS.chance:
        return None
    return ratio_of(applied, near, _reach() * sd + abs(factor - near))


def _reach() -> float:
    from scipy.stats import norm

    return float(norm.ppf((1 + VERDICT.interval) / 2))


def _by_chance(ratio: float, factor: float, sd: float, ratios: Sequence[float]) -> float:
    """Return how many ratios are as near to a factor by chance; ``sd`` is the factor's relative one."""
    within = sum(1 / UNITS.farthest < each / factor < UNITS.farthest for each in ratios)
    density = within / (2 * math.log(UNITS.farthest))
    off = math.log(factor / ratio) / sd
    return density * sd * math.sqrt(2 * math.pi) * math.exp(min(off**2 / 2, 700.0))


def with_units_judged(
    problem: Problem, folds: Folds, base: Fit, held_base: HeldOut, steps: list[Step], *, structured: bool
) -> tuple[Fit, HeldOut, list[Step]]:
    """Return a hypothesis whose units are units, and whose other factors are free.

    Parameters
    ----------
    structured : structure is left beside the effects
    """
    judged: list[Step] = []
    for step in steps:
        applied = next((each for each in base.active if each.key == step.active.key), step.active)
        judged.append(step)
        if not _is_factor(applied.effect):
            continue
        free = applied if not applied.effect.discrete else free_factor(applied, factor_of(applied))
        if free is not applied and any(each.key == free.key for each in base.active):
            continue
        try:
            fitted = base if free is applied else fit(problem, _replaced(base, applied, free), start=base.p)
            exact = (
                unit_of_factor(problem, fitted, free) if _may_be_exact(problem, fitted, structured) else None
            )
            if exact is None and free is applied:
                continue
            chosen = free if exact is None else exact
            made = fitted if exact is None else fit(problem, _replaced(base, applied, exact), start=base.p)
            changed = exact is None or exact.values[exact.effect.names[0]] != factor_of(applied)
            held_base = hold_out(problem, folds, made.active, made) if changed else held_base
        except FitError:  # it does not run with another number: what was shown stays
            continue
        base = made
        active = next(each for each in base.active if each.key == chosen.key)
        judged[-1] = replace(step, active=active)
    return base, held_base, judged


def _may_be_exact(problem: Problem, made: Fit, structured: bool) -> bool:
    """Tell whether so little is left beside a factor that it may be known to all its digits."""
    return not structured or leaves_noise(problem, made)


def leaves_noise(problem: Problem, made: Fit) -> bool:
    """Tell whether a fit leaves little more than the sensors' own noise in every output."""
    parts = [noise_parts(problem, made, name) for name in problem.names if problem.kept[name].any()]
    return all(each.total_sd <= UNITS.near * each.sensor_sd for each in parts)


def _is_factor(effect: Effect) -> bool:
    return effect.on_channel is not None and effect.on_channel.proportion is not None


def _replaced(base: Fit, applied: AppliedEffect, chosen: AppliedEffect) -> tuple[AppliedEffect, ...]:
    return tuple(chosen if each.key == applied.key else each for each in base.active)
