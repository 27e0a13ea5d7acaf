"""Wrong units of inputs and outputs: looked for first, where a simulation as declared is grossly wrong.

A number that was recorded in another unit is off by a ratio that is known beforehand, and no parameter
within its prior makes up for it. The search of small effects would describe it by a law of a factor. Here
every ratio between the units of a channel's dimension, and every power of ten, is simulated from the declared
parameters and from the refitted ones, and what takes nearly all of the error is a candidate like any other.
So is a free factor of each channel: a number may be wrong by what is no ratio of units, and what no factor of
its own channel confirms is no unit (`channel_factors`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.fit.folds import Folds, HeldOut, hold_out
from toolkit.diagnosis.fit.sensor_noise import spread
from toolkit.diagnosis.policy import UNITS, VERDICT
from toolkit.diagnosis.search.bends import only_bends
from toolkit.diagnosis.search.candidates import CandidateEffect, Start
from toolkit.diagnosis.search.channel_factors import (
    factor_of,
    free_factor,
    is_ratio,
    unit_of_factor,
)
from toolkit.diagnosis.search.forward_step import Rival, Step, joint_fit, shows_signal
from toolkit.diagnosis.search.unseen_runs import gains_of, takes_most
from toolkit.diagnosis.simulators.parameter_units import channel_unit
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effects
from toolkit.effects.unit_ratios import near_ratio, unit_ratios
from toolkit.errors import FitError, UnitError

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.fit.fit import Fit
    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.effects.effect import Effect


def wrong_units(problem: Problem, fits: Sequence[Fit]) -> tuple[CandidateEffect, ...]:
    """Return wrong units and factors that take nearly all of a gross error; none where none is gross.

    Units and signs come first, the best before others, and then a free factor of every channel.

    Parameters
    ----------
    fits : the simulation as declared, and refitted
    """
    declared = fits[0]
    wrong = [name for name in problem.names if _is_gross(problem, name, declared.residual[name])]
    if not wrong:
        return ()
    before = min(_error(problem, made.residual, wrong) for made in fits)
    found: list[tuple[float, CandidateEffect]] = []
    for applied in _ratios(problem):
        most = UNITS.left * before
        left = [error for made in fits if (error := _left(problem, made, applied, wrong, most)) is not None]
        if left and min(left) < most:
            start = Start(
                values=dict(applied.values),
                directions=(dict(applied.values),),
                amplitudes=applied.effect.names,
            )
            found.append((min(left), CandidateEffect(active=applied, starts=(start,))))
    found.sort(key=lambda entry: entry[0])
    units = [candidate for _, candidate in found]
    return (*units[: UNITS.most], *_free_factors(problem, fits, wrong, units, UNITS.left * before))


def _free_factors(
    problem: Problem,
    fits: Sequence[Fit],
    wrong: Sequence[str],
    units: Sequence[CandidateEffect],
    most: float,
) -> Iterator[CandidateEffect]:
    """Give every channel's free factor, from where it leaves least, if that is little enough.

    Parameters
    ----------
    units : that leave little, the best first: a factor may be farther off than is looked for without them
    most : of the error that a factor may leave
    """
    from scipy.optimize import minimize_scalar

    ratios = {unit.active.channel: factor_of(unit.active) for unit in units[::-1] if _is_ratio(unit)}
    for place in {each.channel: each for each in _ratios(problem) if is_ratio(each.effect)}.values():

        def left(
            log_factor: float, made: Fit, least: float = math.inf, place: AppliedEffect = place
        ) -> float:
            applied = free_factor(place, math.exp(log_factor))
            error = _left(problem, made, applied, wrong, least)
            return math.inf if error is None else error

        reach, step = math.log(UNITS.farthest), 2 * math.log(UNITS.farthest) / (UNITS.steps - 1)
        logs = [step * i - reach for i in range(UNITS.steps)]
        logs += [math.log(ratios[place.channel])] if place.channel in ratios else []
        best, least, begun = 0.0, math.inf, fits[0]
        for log_factor in sorted(logs, key=abs):  # the farther off, the dearer: one that leaves more is left
            for made in fits:
                error = left(log_factor, made, least)
                best, least, begun = (log_factor, error, made) if error < least else (best, least, begun)
        # A joint fit goes on from there: it asks for no more digits than tell one ratio from another.
        nearer = minimize_scalar(
            partial(left, made=begun), bounds=(best - step, best + step), method="bounded",
            options={"maxiter": UNITS.steps, "xatol": UNITS.told},
        )  # fmt: skip
        if nearer.fun < most:
            applied = free_factor(place, math.exp(nearer.x))
            values = dict(applied.values)
            start = Start(values=values, directions=(values,), amplitudes=applied.effect.names)
            yield CandidateEffect(active=applied, starts=(start,))


def _is_ratio(candidate: CandidateEffect) -> bool:
    return is_ratio(candidate.active.effect)


def is_listed(candidate: CandidateEffect, listed: Sequence[CandidateEffect]) -> bool:
    """Tell whether a candidate is among others with the same values."""
    return any(
        each.key == candidate.key
        and any(_same(start.values, candidate.active.values) for start in each.starts)
        for each in listed
    )


def _same(values: Mapping[str, float], others: Mapping[str, float]) -> bool:
    return all(math.isclose(values.get(name, 0.0), value, rel_tol=1e-6) for name, value in others.items())


def unit_step(
    problem: Problem, folds: Folds, base: Fit, held_base: HeldOut, wrong: Sequence[CandidateEffect]
) -> tuple[Fit, HeldOut, Step] | None:
    """Return the wrong unit that leaves the least of unseen rows, if it takes most; None where none does.

    Unseen rows alone decide, in independent values: a coloured noise that has taken up an error of most of
    the signal finds the small rest of the right unit, which is rougher, the less likely.
    """
    shown: list[tuple[Fit, HeldOut]] = []
    sought = [candidate.active for candidate in wrong if not _is_ratio(candidate)]
    for applied in sought:
        made = joint_fit(problem, base, (applied,), plain=True)
        if made is None or only_bends(problem, made):
            continue
        try:
            held_out = hold_out(problem, folds, made.active, made)
        except FitError:
            continue
        if not (takes_most(problem, held_base, held_out) and shows_signal(problem, held_out, applied)):
            continue
        shown.append((made, held_out))
        exact = unit_of_factor(problem, made, made.active[-1]) if made.active[-1].searched else None
        if exact is not None:
            sought.append(exact)
    if not shown:
        return None
    gains = gains_of(problem, held_base, shown)
    least = max(gains) - VERDICT.close

    def order(i: int) -> tuple[bool, bool, bool, float]:
        applied = shown[i][0].active[-1]
        of_units = _is_of_units(problem, applied)
        return gains[i] <= least, not applied.effect.discrete, not of_units, -gains[i]

    best = min(range(len(shown)), key=order)
    made, held_out = shown[best]
    tests = sum(1 for _ in _ratios(problem))
    step = Step(
        active=made.active[-1],
        p_value=min(1.0, tests * math.exp(-min(gains[best], 700.0))),
        held_out_gain=gains[best],
        gain=gains[best],
        rivals=tuple(
            Rival(active=each.active[-1], difference=gains[i] - gains[best])
            for i, (each, _) in enumerate(shown)
            if each.active[-1].channel != made.active[-1].channel
        ),
    )
    return made, held_out, step


def _is_of_units(problem: Problem, applied: AppliedEffect) -> bool:
    """Tell whether a ratio is one of two units: a likelier mistake than a power of ten that is none."""
    if not applied.effect.discrete or not applied.effect.names:
        return False
    ratio = applied.values[applied.effect.names[0]]
    name = near_ratio(ratio, ratio, channel_unit(problem.case, problem.model, str(applied.channel)))
    return name is not None and " read as " in name


def _is_gross(problem: Problem, name: str, residual: Array) -> bool:
    error = residual[problem.kept[name]]
    return bool(len(error)) and float(np.sqrt(np.mean(error**2))) > UNITS.gross * spread(problem, name)


def _ratios(problem: Problem) -> Iterator[AppliedEffect]:
    """Give every ratio at every channel where an effect of units may act."""
    inputs = {driver.name for driver in problem.case.drivers}
    for effect in effects().values():
        if not effect.discrete or effect.on_channel is None or "input" not in effect.on_channel.where:
            continue
        for channel, source in problem.model.places(effect):
            if channel not in problem.names and channel not in inputs:
                continue
            for values in _values(problem, effect, channel):
                yield AppliedEffect(effect=effect, channel=channel, source=source, values=values)


def _values(problem: Problem, effect: Effect, channel: str) -> list[dict[str, float]]:
    """Return the values that an effect may have at a channel: its ratios of units, or nothing to choose."""
    if not effect.names:
        return [{}]
    try:
        ratios = unit_ratios(channel_unit(problem.case, problem.model, channel))
    except UnitError:
        return []
    return [{effect.names[0]: ratio} for ratio in ratios.values()]


def _left(
    problem: Problem, made: Fit, applied: AppliedEffect, names: Sequence[str], most: float = math.inf
) -> float | None:
    """Return what is left beside a unit; None where it cannot be simulated, or some runs leave ``most``.

    A unit that is none may drive a simulation through thousands of steps from row to row, and one run of it
    says as much as all.
    """
    residual = {name: np.zeros(problem.rows) for name in names}
    try:
        for run, rows in zip(problem.runs, problem.slices, strict=True):
            simulated = problem.simulated_run(run, made.p, (*made.active, applied))
            for name in names:
                residual[name][rows] = problem.observed[name][rows] - simulated[name]
            if (error := _error(problem, residual, names)) >= most:
                return None
    except FitError:  # so large an input is beyond what the simulation can do
        return None
    return error


def _error(problem: Problem, residual: dict[str, Array], names: Sequence[str]) -> float:
    """Return the mean of the outputs' mean squares over those of the recording."""
    shares = [
        np.mean(residual[name][problem.kept[name]] ** 2) / max(spread(problem, name) ** 2, 1e-300)
        for name in names
    ]
    return float(np.mean(shares))
