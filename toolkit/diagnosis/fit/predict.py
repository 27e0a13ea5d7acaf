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

    from numpy.typing import NDArray

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
    made: list[str] = []
    for run in runs:
        parts = [one for one in run.name.replace("\\", "/").split("/") if one not in ("", ".", "..")]
        path = PurePosixPath(*parts) if parts else PurePosixPath("prediction.csv")
        if path.suffix.lower() in (".xlsx", ".xlsm"):
            path = path.with_suffix(".csv")
        at, name = 2, str(path)
        while name in made:
            name, at = str(path.with_stem(f"{path.stem}-{at}")), at + 1
        made.append(name)
    return tuple(made)


def prediction_csv(problem: Problem, run: Run, fits: Sequence[Fit | None]) -> str:
    """Return a run's outputs under the recording's own time.

    Parameters
    ----------
    fits : the simulation as declared, refitted, and augmented; None for the declared parameters
    """
    case = problem.case
    columns: dict[str, NDArray[np.float64]] = {}
    for one in case.channels:
        if one.role == "time":
            columns[one.name] = run.columns[one.name]
    made = [_simulated(problem, run, one) for one in fits]
    for output in problem.model.outputs:
        for variant, values in zip(VARIANTS, made, strict=True):
            columns[f"{output.name}_{variant}"] = values[output.name]
    return csv_of(columns)


def csv_of(columns: Mapping[str, NDArray[np.float64]]) -> str:
    """Return columns (n,) as CSV with full doubles; what is no finite number is an empty cell."""
    lines = [",".join(_cell(name) for name in columns)]
    lines += [",".join(_number(v) for v in row) for row in np.stack(list(columns.values()), axis=1)]
    return "\n".join(lines) + "\n"


def _simulated(problem: Problem, run: Run, made: Fit | None) -> Mapping[str, NDArray[np.float64]]:
    values = dict(problem.known)
    if made is None:
        return problem.model.simulate(run, values, ())
    values.update(zip((one.name for one in problem.free), made.p, strict=True))
    return problem.model.simulate(run, values, tuple(_spread_to(problem, run, one) for one in made.active))


def _spread_to(problem: Problem, run: Run, one: AppliedEffect) -> AppliedEffect:
    """Return an effect that is confined to some runs with the new run in it, where a condition says so.

    The condition is the one whose values part the effect's runs from all the others.
    """
    if one.runs is None:
        return one
    for key in one.effect.confining(run.conditions):
        inside = {each.conditions.get(key) for each in problem.runs if each.name in one.runs}
        outside = {each.conditions.get(key) for each in problem.runs if each.name not in one.runs}
        if not inside & outside and run.conditions[key] in inside:
            return replace(one, runs=one.runs | {run.name})
    return replace(one, runs=one.runs - {run.name})


def _cell(name: str) -> str:
    return '"' + name.replace('"', '""') + '"' if any(mark in name for mark in ',"\r\n') else name


def _number(value: Any) -> str:
    number = float(value)
    return repr(number) if math.isfinite(number) else ""
