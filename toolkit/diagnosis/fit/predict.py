"""Predictions: the outputs of further inputs as declared, refitted and augmented, as CSV."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from toolkit.arrays import Array
    from toolkit.diagnosis.case.case import Run
    from toolkit.diagnosis.fit.fit import Fit
    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.effects.applied import AppliedEffect

VARIANTS = ("nominal", "refitted", "augmented")


def prediction_names(runs: Sequence[Run]) -> tuple[str, ...]:
    """Return the file name of every prediction below ``predictions/``: that of the inputs.

    The path of the case is kept without what would lead out of the folder, a workbook becomes a CSV; where
    two would then be one, a number tells them apart.
    """
    names: list[str] = []
    for run in runs:
        parts = [part for part in run.name.replace("\\", "/").split("/") if part not in ("", ".", "..")]
        path = PurePosixPath(*parts) if parts else PurePosixPath("prediction.csv")
        if path.suffix.lower() in (".xlsx", ".xlsm"):
            path = path.with_suffix(".csv")
        at, name = 2, str(path)
        while name in names:
            name, at = str(path.with_stem(f"{path.stem}-{at}")), at + 1
        names.append(name)
    return tuple(names)


def prediction_csv(problem: Problem, run: Run, fits: Sequence[Fit | None]) -> str:
    """Return a run's outputs under the recording's own time.

    Parameters
    ----------
    fits : the simulation as declared, refitted, and augmented; None for the declared parameters
    """
    case = problem.case
    columns: dict[str, Array] = {}
    for channel in case.channels:
        if channel.role == "time":
            columns[channel.name] = run.columns[channel.name]
    variants = [_simulated(problem, run, fit) for fit in fits]
    for output in problem.model.outputs:
        for variant, values in zip(VARIANTS, variants, strict=True):
            columns[f"{output.name}_{variant}"] = values[output.name]
    return csv_of(columns)


def csv_of(columns: Mapping[str, Array]) -> str:
    """Return columns (n,) as CSV with full doubles; what is no finite number is an empty cell."""
    lines = [",".join(_cell(name) for name in columns)]
    lines += [",".join(_number(v) for v in row) for row in np.stack(list(columns.values()), axis=1)]
    return "\n".join(lines) + "\n"


def _simulated(problem: Problem, run: Run, fit: Fit | None) -> Mapping[str, Array]:
    values = dict(problem.known)
    if fit is None:
        return problem.model.simulate(run, values, ())
    values.update(zip((parameter.name for parameter in problem.free), fit.p, strict=True))
    return problem.model.simulate(
        run, values, tuple(_spread_to(problem, run, applied) for applied in fit.active)
    )


def _spread_to(problem: Problem, run: Run, applied: AppliedEffect) -> AppliedEffect:
    """Return an effect that is confined to some runs with the new run in it, where a condition says so.

    The condition is the one whose values part the effect's runs from all the others.
    """
    if applied.runs is None:
        return applied
    for key in applied.effect.confining(run.conditions):
        inside = {run.conditions.get(key) for run in problem.runs if run.name in applied.runs}
        outside = {run.conditions.get(key) for run in problem.runs if run.name not in applied.runs}
        if not inside & outside and run.conditions[key] in inside:
            return replace(applied, runs=applied.runs | {run.name})
    return replace(applied, runs=applied.runs - {run.name})


def _cell(name: str) -> str:
    return '"' + name.replace('"', '""') + '"' if any(mark in name for mark in ',"\r\n') else name


def _number(value: Any) -> str:
    number = float(value)
    return repr(number) if math.isfinite(number) else ""
