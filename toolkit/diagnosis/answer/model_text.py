"""The answer as a model file: the simulation with what was found in it, for `simulate` and `diagnose`."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolkit.diagnosis.answer.found_laws import with_laws
from toolkit.diagnosis.simulators.built_in import parameter_names
from toolkit.diagnosis.simulators.parameter_units import unit_of
from toolkit.diagnosis.simulators.setting import nominal_load
from toolkit.effects.law import is_law
from toolkit.files import real_path, sha256_file
from toolkit.inputs import is_regular
from toolkit.simulation.model_file import CONTENT, FittedEffect, effect_lines, toml_key, toml_lines
from toolkit.version import __version__

if TYPE_CHECKING:
    from toolkit.diagnosis.answer.answer import Diagnosis
    from toolkit.diagnosis.case.case import Case
    from toolkit.diagnosis.law.learn import Laws
    from toolkit.diagnosis.search.search import Search
    from toolkit.effects.applied import AppliedEffect

MODEL = "model.toml"
_INTERNAL = ("_size_", "_half_")


def model_text(
    case: Case, search: Search, diagnosis: Diagnosis, folder: Path, laws: Laws | None = None
) -> str | None:
    """Return the model file of an answer, None where it names nothing that could go back into use.

    Parameters
    ----------
    folder : where the file will lie; the simulation's own files are named relative to it
    laws : of what has no name, which go into the model as effects do
    """
    if laws is not None and laws.listed:
        search = with_laws(search, laws)
    elif not diagnosis.effects:
        return None
    lines = [
        f"# Written by toolkit diagnose from {case.path.name}; nobody edits it.",
        "schema = 1",
        *toml_lines(
            {"content": CONTENT, "title": case.title, "code_version": __version__, "axes": case.axes}
        ),
    ]
    time = next((channel.name for channel in case.channels if channel.role == "time"), None)
    lines += toml_lines({} if time is None else {"time": time})
    load = search.problem.model.capability.nominal_load_N or nominal_load(case)
    lines += toml_lines({"nominal_load_N": load})
    lines += [
        "",
        "[answer]",
        *toml_lines({
            "verdict": diagnosis.verdict, "remaining": diagnosis.remaining, "complete": diagnosis.complete,
            "case": relative_path(case.path, folder), "case_sha256": case.sha256,
            "recordings": {run.name: run.sha256 for run in case.runs},
        }),
        *_simulation(case, search, folder),
        "",
        "[channels]",
    ]  # fmt: skip
    for channel in case.channels:
        entry: dict[str, Any] = {"unit": channel.unit, "role": channel.role}
        if channel.sd is not None:
            entry["sd"] = channel.sd
        lines += toml_lines({channel.name: entry})
    for before, names in zip(case.effects, parameter_names(case.effects), strict=True):
        if not before.of_machine:  # those stay in the machine's definition
            lines += effect_lines(_carried(case, search, before, names))
    same = {effect.key: effect.equivalent_to for effect in diagnosis.effects}
    steps = {step.active.key for step in search.steps}
    for active in search.augmented.active:
        if not active.effect.nuisance:  # of what is recorded, not of what is simulated
            fitted = _fitted(
                case,
                search,
                active,
                same.get(active.key, ()),
                named=active.key in steps or is_law(active.key.name),
            )
            lines += effect_lines(fitted)
    return "\n".join(lines) + "\n"


def _simulation(case: Case, search: Search, folder: Path) -> list[str]:
    simulation = case.simulation
    entries: dict[str, Any] = {"kind": simulation.kind}
    sums: dict[str, str] = {}
    machine = Path(simulation.machine)
    beside = case.path.parent / simulation.calibration
    files = {
        "machine": machine if simulation.kind == "machine" and simulation.machine.endswith(".toml") else None,
        "calibration": beside if simulation.calibration and is_regular(beside) else None,
        "tire": simulation.tire,
        "path": simulation.path,
    }
    for key, file in files.items():
        if file is not None:
            entries[key], sums[key] = relative_path(file, folder), sha256_file(file)
    if simulation.kind == "machine":
        entries.setdefault("machine", simulation.machine)
        if simulation.calibration:
            entries.setdefault("calibration", simulation.calibration)
    if simulation.kind == "python":
        entries["function"] = simulation.function
    if simulation.states:
        entries["states"] = list(simulation.states)
    if simulation.step_s is not None:
        entries["step_s"] = simulation.step_s
    for key, pairs in (
        ("force_terms", simulation.force_terms), ("simulated", simulation.simulated),
        ("inputs", simulation.fmu_inputs), ("outputs", simulation.fmu_outputs),
    ):  # fmt: skip
        if pairs:
            entries[key] = dict(pairs)
    lines = ["", "[simulation]", *toml_lines(entries)]
    if sums:
        lines += ["", "[simulation.sha256]", *toml_lines(sums)]
    declared = {parameter.name for parameter in case.parameters}
    at = {parameter.name: i for i, parameter in enumerate(search.problem.free)}
    for parameter in search.problem.model.parameters:
        if parameter.name not in declared:
            continue  # an effect's, of the model that the case started from
        value = search.augmented.p[at[parameter.name]] if parameter.name in at else parameter.value
        lines += [
            "",
            f"[simulation.parameters.{toml_key(parameter.name)}]",
            *toml_lines({"value": value, "unit": parameter.unit}),
        ]
        error = _standard_error(search, at[parameter.name]) if parameter.name in at else None
        lines += [] if error is None else toml_lines({"standard_error": error})
        if parameter.bounds is not None:
            lines += toml_lines({"bounds": list(parameter.bounds)})
    return lines


def _carried(case: Case, search: Search, before: FittedEffect, names: Sequence[str]) -> FittedEffect:
    """Return an effect that the simulation had before, with its parameters as they are now."""
    values, errors = dict(before.applied.values), {}
    at = {free.name: i for i, free in enumerate(search.problem.free)}
    for name, parameter in zip(names, before.applied.effect.parameters, strict=True):
        if name in at:
            values[parameter.name] = search.augmented.p[at[name]]
            errors[parameter.name] = _standard_error(search, at[name])
        values[parameter.name] *= parameter.sign_between(before.axes or case.axes, case.axes)
    return replace(
        before,
        applied=replace(before.applied, values=values),
        standard_errors={name: error for name, error in errors.items() if error is not None},
    )


def _fitted(
    case: Case, search: Search, active: AppliedEffect, same: Sequence[str], *, named: bool
) -> FittedEffect:
    effect, problem = active.effect, search.problem
    at = len(problem.free)
    for applied in search.augmented.active:
        if applied.key == active.key:
            break
        at += len(applied.searched)
    values = {
        parameter.name: active.values.get(parameter.name, 0.0) * parameter.sign_in(case.axes)
        for parameter in effect.parameters
    }
    numerics = {name: value for name, value in active.numerics.items() if not name.startswith(_INTERNAL)}
    errors = {parameter.name: _standard_error(search, at + i) for i, parameter in enumerate(active.searched)}
    return FittedEffect(
        applied=replace(
            active,
            values=values | numerics,
            units={name: unit_of(case, problem.model, active, name) for name in effect.names},
            condition=None if active.runs is None else _condition(search, active),
        ),
        standard_errors={name: error for name, error in errors.items() if error is not None},
        equivalent_to=tuple(same),
        nuisance=not named,
    )


def _condition(search: Search, active: AppliedEffect) -> tuple[str, tuple[str, ...]] | None:
    """Return the condition whose values part the effect's runs from all the others, None without one."""
    runs = search.problem.runs
    for key in active.effect.confining(key for run in runs for key in run.conditions):
        inside = {run.conditions.get(key) for run in runs if run.name in (active.runs or ())}
        outside = {run.conditions.get(key) for run in runs if run.name not in (active.runs or ())}
        if inside and None not in inside and not inside & outside:
            return key, tuple(sorted(str(level) for level in inside))
    return None


def _standard_error(search: Search, at: int) -> float | None:
    variance = search.variance(at)
    return math.sqrt(variance) if math.isfinite(variance) and variance > 0 else None


def relative_path(file: Path, folder: Path) -> str:
    """Return a file as a model file in a folder names it."""
    return Path(os.path.relpath(real_path(file), real_path(folder))).as_posix()
