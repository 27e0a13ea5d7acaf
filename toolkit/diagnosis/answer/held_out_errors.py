"""Errors of every output on rows that no fit has seen, and the noise below them."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.answer.answer import HeldOutChannel
from toolkit.diagnosis.fit.sensor_noise import judged_noise
from toolkit.diagnosis.fit.structure import RUNS, groups
from toolkit.diagnosis.law.trial import bracketed
from toolkit.diagnosis.search.search import Search
from toolkit.diagnosis.simulators.parameter_units import reduced

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.diagnosis.law.learn import Laws
    from toolkit.diagnosis.simulators.simulator import Output


def held_out_errors(search: Search, *, unknown: bool) -> tuple[HeldOutChannel, ...]:
    """Return the errors of every output; of one that only drifts those of its rates.

    Parameters
    ----------
    unknown : effects that were found are not told
    """
    problem = search.problem
    errors = []
    augmented = search.held_refitted if unknown else search.held_augmented
    for output in problem.model.outputs:
        if not problem.kept[output.name].any():
            continue

        def rmse(simulated: Array, name: str = output.name) -> float:
            away = problem.judged(name, problem.observed[name] - simulated)
            return math.sqrt(float(np.mean(away**2)))

        errors.append(
            HeldOutChannel(
                channel=output.name,
                unit=judged_unit(problem, output),
                nominal_rmse=rmse(search.nominal.simulated[output.name]),
                refitted_rmse=rmse(search.held_refitted.simulated[output.name]),
                augmented_rmse=rmse(augmented.simulated[output.name]),
                # No noise is larger than an error that was reached on rows that no fit has seen.
                noise_floor=min(
                    _floor(search, output.name, output.sd),
                    math.inf if output.sd is not None else rmse(augmented.simulated[output.name]),
                ),
                noise=judged_noise(problem, search.augmented, output.name),
                spread=float(np.std(problem.judged(output.name, problem.observed[output.name]))),
            )
        )
    return tuple(errors)


def judged_unit(problem: Problem, output: Output) -> str:
    """Return the unit of what is judged of an output: of one that drifts that of its rate."""
    return reduced(f"{bracketed(output.unit)}/s") if output.name in problem.rates else output.unit


def with_laws(search: Search, laws: Laws, errors: tuple[HeldOutChannel, ...]) -> tuple[HeldOutChannel, ...]:
    """Return held-out errors with those that the laws leave beside them; an event tells nothing there."""
    problem, predicts = search.problem, any(law.predicts for law in laws.listed)
    told = []
    for output in errors:
        name, rmse = output.channel, math.inf
        if predicts:
            away = problem.judged(name, problem.observed[name] - laws.held_out.simulated[name])
            rmse = math.sqrt(float(np.mean(away**2)))
        floor = shown_noise(search, output, is_noise=not predicts)
        if problem.stated_sd(name) is None:
            floor = min(floor, rmse)
        told.append(replace(output, with_laws_rmse=rmse if predicts else None, noise_floor=floor))
    return tuple(told)


def shown_noise(search: Search, output: HeldOutChannel, *, is_noise: bool = True) -> float:
    """Return an output's noise: where what effects leave is not shown to be any, the sensor's own, if less.

    What they leave is no measure of them. Zeros that differ from run to run say nothing of the noise within.

    Parameters
    ----------
    is_noise : nothing else tells that there is more in the rest
    """
    stays = any(part.output == output.channel and part.variables != RUNS for part in search.structure)
    stated = search.problem.stated_sd(output.channel) is not None
    if stated or output.sensor_sd is None or (is_noise and not stays):
        return output.noise_floor
    return min(output.noise_floor, output.sensor_sd)


def _floor(search: Search, name: str, sd: float | None) -> float:
    """Return an output's noise: as stated or as repeats differ, else what is left beside smooth structure."""
    problem, residual = search.problem, search.augmented.residual[name]
    if sd is not None:
        return problem.judged_sd(name, sd)
    known = judged_noise(problem, search.augmented, name)
    if known.how == "repeats":
        return known.sensor_sd
    noise = math.sqrt(float(np.mean(problem.judged(name, residual) ** 2)))
    if name in problem.rates:
        return noise
    counted = problem.kept[name]
    if any(structure.output == name and not structure.rest for structure in search.structure):
        share, _ = structured(search, name)
        refitted = math.sqrt(float(np.mean(search.refitted.residual[name][counted] ** 2)))
        noise = min(noise, refitted * math.sqrt(max(1 - share, 0.0)))
    return noise


def structured(search: Search, name: str) -> tuple[float, Array]:
    """Return share and signal of the smooth structure in an output's refitted residual."""
    problem, counted = search.problem, search.problem.kept[name]
    residual = search.refitted.residual[name]
    best, signal = 0.0, np.zeros(problem.rows)
    # A line, an event or a rest is none of a variable's smooth dependences.
    dependences = {
        () if structure.reason else structure.variables
        for structure in search.structure_before
        if structure.output == name
    }
    for group in groups(problem, search.refitted):
        if group.output != name or (dependences and group.variables not in dependences):
            continue
        fit = np.linalg.lstsq(group.columns[counted], residual[counted], rcond=None)[0]
        smooth = group.columns @ fit
        share = 1 - float(np.sum((residual - smooth)[counted] ** 2)) / max(
            float(np.sum(residual[counted] ** 2)), 1e-300
        )
        if share > best:
            best, signal = share, smooth
    return best, signal
