"""A model sized by hand: effects switched off or given other sizes, beside the recordings of its case.

Nothing is fitted here. What somebody sized is no finding of a diagnosis, and a model file that keeps it says
so: its verdict is `BY_HAND`, and no correction of a machine rests on it.
"""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.declared import toml_text
from toolkit.diagnosis.answer.model_text import relative_path
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.diagnosis.simulators.built_in import parameter_names
from toolkit.diagnosis.simulators.case_code import running
from toolkit.errors import ConfigError, FitError
from toolkit.files import parse_toml
from toolkit.inputs import SETTINGS_FILE, read_input
from toolkit.worker.worker import LateError

if TYPE_CHECKING:
    from pathlib import Path

    from toolkit.arrays import Array
    from toolkit.diagnosis.case.case import Case, Run
    from toolkit.diagnosis.simulators.simulator import Model
    from toolkit.simulation.model_file import FittedEffect, ModelFile
    from toolkit.worker.posix import Limits

BY_HAND = "by hand"


@dataclass(frozen=True, slots=True, kw_only=True)
class Sized:
    """One effect of a model as somebody set it: ``values`` by parameter, in the units of the model file."""

    on: bool = True
    values: Mapping[str, float]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Beside:
    """One output of one run: what was recorded, NaN where a sample is missing, and what the simulation says.

    ``x`` is the time [s], or the row's number without a time; all of shape (n,), in the output's unit.
    """

    run: str
    output: str
    unit: str
    x: Array
    recorded: Array
    simulated: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trial:
    """What a model says of the runs of its case; ``rmse`` by output, over every recorded row of all runs."""

    has_time: bool
    beside: tuple[Beside, ...]
    rmse: Mapping[str, float]


def as_fitted(model: ModelFile) -> tuple[Sized, ...]:
    """Return the effects of a model as the file has them."""
    return tuple(
        Sized(values={name: effect.applied.values[name] for name in effect.applied.effect.names})
        for effect in model.effects
    )


def tried(
    model: ModelFile,
    case_file: Path,
    sized: Sequence[Sized],
    calibrations: Path | None,
    *,
    budget_s: float,
    limits: Limits | None,
) -> Trial:
    """Return what a model with sized effects says beside the recordings of its case.

    Parameters
    ----------
    sized : one for each effect of the model, in its order
    calibrations : folder of the registry where the simulation is the machine
    budget_s : seconds that the case's own code may take
    limits : of the worker in which that code runs; None runs it in this process

    Raises
    ------
    ConfigError
        ``model-changed``: a recording is not the one that was fitted; ``wrong-value``: a size is no number,
        or outside what the effect can have; what `read_case` raises
    FitError
        the simulation gives no usable output at these sizes, or not in time
    """
    case = read_case(case_file, model=model.path)
    _same_recordings(case, model)
    # Behind the model's own stand the corrections of its machine, which nobody sizes here.
    corrections = case.effects[len(model.effects) :]
    case = replace(case, effects=(*_applied(model, sized), *corrections))

    def check(simulator: Model) -> None:
        _check_sizes(simulator, case.effects, model.path)

    return as_declared(case, calibrations, budget_s=budget_s, limits=limits, check=check)


def as_declared(
    case: Case,
    calibrations: Path | None,
    *,
    budget_s: float,
    limits: Limits | None,
    check: Callable[[Model], None] = lambda _: None,
) -> Trial:
    """Return what the simulation of a case says beside its recordings, with its parameters as declared.

    Parameters
    ----------
    calibrations, budget_s, limits : as in `tried`
    check : judges the simulator before it runs

    Raises
    ------
    ConfigError
        the simulator cannot be built; what ``check`` raises
    FitError
        the simulation gives no usable output, or not in time
    """
    with running(case, limits) as code:
        if code is not None:
            code.until = time.monotonic() + budget_s
        try:
            simulator = model_of(case, calibrations, code)
            check(simulator)
            p = {parameter.name: parameter.value for parameter in simulator.parameters}
            pairs = [(run, simulator.simulate(run, p, ())) for run in case.runs]
        except LateError:
            raise FitError(
                "the simulation gives no usable output", where=case.file(), rule="simulator",
                got=f"no answer within {budget_s:g} s", expected="outputs of every run of the case",
                next_step="try other sizes, or the command 'toolkit simulate' with a larger --budget",
            ) from None  # fmt: skip
    beside = tuple(
        Beside(
            run=run.name, output=output.name, unit=output.unit, x=run.t,
            recorded=np.asarray(recorded[output.name], dtype=float),
            simulated=np.asarray(outputs[output.name], dtype=float),
        )
        for run, outputs in pairs
        for recorded in (simulator.observed(run),)
        for output in simulator.outputs
    )  # fmt: skip
    names = dict.fromkeys(row.output for row in beside)
    return Trial(
        has_time=case.has_time,
        beside=beside,
        rmse={name: _rmse([row for row in beside if row.output == name]) for name in names},
    )


def kept_model(model: ModelFile, sized: Sequence[Sized], folder: Path) -> str:
    """Return the model file of sized effects, to lie in ``folder``; unchanged, it is the diagnosis's own.

    A parameter with another size has no standard error, and an effect that is off is left out.
    """
    table = parse_toml(read_input(model.path, SETTINGS_FILE), where=model.path)
    for key, file in model.files:
        table["simulation"][key] = relative_path(file, folder)
    if model.case is not None:
        table["answer"]["case"] = relative_path(model.case, folder)
    before = as_fitted(model)
    if tuple(sized) != before:
        table["answer"] |= {"verdict": BY_HAND, "complete": False}
    table["effect"] = [
        _entry(entry, effect, effect_before)
        for entry, effect, effect_before in zip(table.get("effect", []), sized, before, strict=True)
        if effect.on
    ]
    return f"# Kept from {model.path.name} of a diagnosis; nobody edits it.\n{toml_text(table)}"


def _entry(entry: Mapping[str, Any], sized: Sized, before: Sized) -> dict[str, Any]:
    table = copy.deepcopy(dict(entry))
    for name, value in sized.values.items():
        if value != before.values[name]:
            parameter = table.setdefault("parameters", {}).setdefault(name, {})
            parameter["value"] = value
            parameter.pop("standard_error", None)
    return table


def _applied(model: ModelFile, sized: Sequence[Sized]) -> tuple[FittedEffect, ...]:
    return tuple(
        replace(effect, applied=replace(effect.applied, values={**effect.applied.values, **own.values}))
        for effect, own in zip(model.effects, sized, strict=True)
        if own.on
    )


def _check_sizes(simulator: Model, effects: Sequence[FittedEffect], path: Path) -> None:
    bounds = {parameter.name: parameter.bounds for parameter in simulator.parameters}
    for effect, names in zip(effects, parameter_names(effects), strict=True):
        for name, parameter in zip(names, effect.applied.effect.names, strict=True):
            value = effect.applied.values[parameter]
            low, high = bounds[name] or (-math.inf, math.inf)
            if not (math.isfinite(value) and low <= value <= high):
                raise ConfigError(
                    "a size lies outside what the effect can have", where=f"{path.name}: {name}", got=value,
                    expected=f"{low:g} to {high:g} {effect.applied.units[parameter]}",
                    next_step="choose a size in that range", rule="wrong-value",
                )  # fmt: skip


def _same_recordings(case: Case, model: ModelFile) -> None:
    fitted = dict(model.recordings)
    changed: list[Run] = [run for run in case.runs if fitted.get(run.name) != run.sha256]
    if changed or len(case.runs) != len(fitted):
        raise ConfigError(
            "the recordings are not those that the model was fitted to", where=case.path,
            got=", ".join(run.name for run in changed) or f"{len(case.runs)} runs",
            expected=f"{', '.join(fitted)}, unchanged", next_step="diagnose the case again",
            rule="model-changed",
        )  # fmt: skip


def _rmse(rows: Sequence[Beside]) -> float:
    off = np.concatenate([row.simulated - row.recorded for row in rows])
    off = off[np.isfinite(off)]
    return math.sqrt(float(np.mean(off**2))) if len(off) else math.nan
