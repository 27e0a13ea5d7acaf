"""Answers without a search: outputs that do not vary, or a budget that was spent before it began."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.answer.answer import (
    AbsentEffect,
    Diagnosis,
    HeldOutChannel,
    HeldOutFit,
    NominalParameter,
    recorded,
)
from toolkit.diagnosis.policy import ROWS
from toolkit.effects.catalogue import effects

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.case.case import Case
    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.findings import Finding

    Stacked = dict[str, Array]

STEPS = (
    "refit of the nominal parameters",
    "hold-out of the refitted simulation",
    "screening of the effects",
    "structure of the residual",
    "joint fits",
    "power of what was not found",
)


def is_flat(values: Array) -> bool:
    """Tell whether recorded values are too few, or all the same."""
    return len(values) < ROWS.fewest or float(np.ptp(values)) == 0.0


def does_not_vary(problem: Problem) -> bool:
    """Tell whether no output of a case varies."""
    return all(is_flat(problem.observed[name][problem.kept[name]]) for name in problem.names)


def without_search(
    case: Case,
    problem: Problem | None,
    simulated: Stacked | None,
    *,
    why: str,
    next_measurements: tuple[str, ...],
    findings: tuple[Finding, ...],
    skipped: tuple[str, ...] = (),
) -> Diagnosis:
    """Return the answer *untestable* of a case that nothing was fitted to.

    Parameters
    ----------
    problem : None where not even the simulation could be set up in time
    simulated : the simulation as declared; None where not even that was done in time
    why : for every effect, why nothing can be said of it
    skipped : steps that a spent budget left out
    """
    return Diagnosis(
        title=case.title,
        case_sha256=case.sha256,
        verdict="untestable",
        remaining="unknown",
        mismatch=(),
        effects=(),
        nominal_parameters=tuple(
            NominalParameter(
                name=parameter.name,
                before=parameter.value,
                after=parameter.value,
                unit=parameter.unit,
                prior_sd=parameter.sd,
            )
            for parameter in case.parameters
        ),
        fit=HeldOutFit(
            held_out_by="none: no fit was made",
            held_out=() if problem is None or simulated is None else _as_declared(problem, simulated),
        ),
        depends_on=(),
        not_found=tuple(
            AbsentEffect(name=name, minimum_detectable=None, unit="", observable=False, why=why)
            for name in effects()
        ),
        next_measurements=next_measurements,
        findings=findings,
        complete=not skipped,
        skipped=skipped,
        recordings=recorded(case.runs),
    )


def _as_declared(problem: Problem, simulated: Stacked) -> tuple[HeldOutChannel, ...]:
    """Return the error of the simulation as declared, three times; noise that nobody stated is unknown."""
    errors = []
    for output in problem.model.outputs:
        counted = problem.kept[output.name]
        if not counted.any():
            continue
        away = problem.observed[output.name][counted] - simulated[output.name][counted]
        error = math.sqrt(float(np.mean(away**2)))
        errors.append(
            HeldOutChannel(
                channel=output.name, unit=output.unit, nominal_rmse=error, refitted_rmse=error,
                augmented_rmse=error, noise_floor=output.sd or math.nan,
            )
        )  # fmt: skip
    return tuple(errors)
