"""The answer as a model file: the simulation with what was found in it, for `simulate` and `diagnose`."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolkit.diagnosis.simulators.built_in import parameter_names
from toolkit.diagnosis.simulators.parameter_units import unit_of
from toolkit.diagnosis.simulators.setting import nominal_load
from toolkit.files import sha256_file
from toolkit.simulation.model_file import CONTENT, FittedEffect, effect_lines, toml_key, toml_lines
from toolkit.version import __version__

if TYPE_CHECKING:
    from toolkit.diagnosis.answer.answer import Diagnosis
    from toolkit.diagnosis.case.case import Case
    from toolkit.diagnosis.search.search import Search
    from toolkit.effects.applied import AppliedEffect

MODEL = "model.toml"
_INTERNAL = ("_size_", "_half_")


def model_text(case: Case, found: Search, made: Diagnosis, folder: Path) -> str | None:
    """Return the model file of an answer, None where it names nothing that could go back into use.

    Parameters
    ----------
    folder : where the file will lie; the simulation's own files are named relative to it
    """
    if not made.effects:
        return None
    lines = [
        f"# Written by toolkit diagnose from {case.path.name}; nobody edits it.",
        "schema = 1",
        *toml_lines(
            {"content": CONTENT, "title": case.title, "code_version": __version__, "axes": case.axes}
        ),
    ]
    time = next((one.name for one in case.channels if one.role == "time"), None)
    lines += toml_lines({} if time is None else {"time": time})
    load = found.problem.model.capability.nominal_load_N or nominal_load(case)
    lines += toml_lines({"nominal_load_N": load})
    lines += [
        "",
        "[answer]",
        *toml_lines({
            "verdict": made.verdict, "remaining": made.remaining, "complete": made.complete,
            "case": _relative(case.path, folder), "case_sha256": case.sha256,
            "recordings": {run.name: run.sha256 for run in case.runs},
        }),
        *_simulation(case, found, folder),
        "",
        "[channels]",
    ]  # fmt: skip
    for one in case.channels:
        entry: dict[str, Any] = {"unit": one.unit, "role": one.role}
        if one.sd is not None:
            entry["sd"] = one.sd
        lines += toml_lines({one.name: entry})
    for before, names in zip(case.effects, parameter_names(case.effects), strict=True):
        if not before.of_machine:  # those stay in the machine's definition
            lines += effect_lines(_carried(case, found, before, names))
    same = {one.key: one.equivalent_to for one in made.effects}
    steps = {one.active.key for one in found.steps}
    for active in found.augmented.active:
        if not active.effect.nuisance:  # of what is recorded, not of what is simulated
            fitted = _fitted(case, found, active, same.get(active.key, ()), named=active.key in steps)
            lines += effect_lines(fitted)
    return "\n".join(lines) + "\n"


def _simulation(case: Case, found: Search, folder: Path) -> list[str]:
    told = case.simulation
    entries: dict[str, Any] = {"kind": told.kind}
    sums: dict[str, str] = {}
    machine = Path(told.machine)
    beside = case.path.parent / told.calibration
    files = {
        "machine": machine if told.kind == "machine" and told.machine.endswith(".toml") else None,
        "calibration": beside if told.calibration and beside.is_file() else None,
        "tire": told.tire,
        "path": told.path,
    }
    for key, file in files.items():
        if file is not None:
            entries[key], sums[key] = _relative(file, folder), sha256_file(file)
    if told.kind == "machine":
        entries.setdefault("machine", told.machine)
        if told.calibration:
            entries.setdefault("calibration", told.calibration)
    if told.kind == "python":
        entries["function"] = told.function
    if told.states:
        entries["states"] = list(told.states)
    for key, pairs in (("force_terms", told.force_terms), ("simulated", told.simulated)):
        if pairs:
            entries[key] = dict(pairs)
    lines = ["", "[simulation]", *toml_lines(entries)]
    if sums:
        lines += ["", "[simulation.sha256]", *toml_lines(sums)]
    own = {one.name for one in case.parameters}
    at = {one.name: i for i, one in enumerate(found.problem.free)}
    for one in found.problem.model.parameters:
        if one.name not in own:
            continue  # an effect's, of the model that the case started from
        value = found.augmented.p[at[one.name]] if one.name in at else one.value
        lines += [
            "",
            f"[simulation.parameters.{toml_key(one.name)}]",
            *toml_lines({"value": value, "unit": one.unit}),
        ]
        error = _standard_error(found, at[one.name]) if one.name in at else None
        lines += [] if error is None else toml_lines({"standard_error": error})
        if one.bounds is not None:
            lines += toml_lines({"bounds": list(one.bounds)})
    return lines


def _carried(case: Case, found: Search, before: FittedEffect, names: Sequence[str]) -> FittedEffect:
    """Return an effect that the simulation had before, with its parameters as they are now."""
    values, errors = dict(before.applied.values), {}
    at = {free.name: i for i, free in enumerate(found.problem.free)}
    for name, parameter in zip(names, before.applied.effect.parameters, strict=True):
        if name in at:
            values[parameter.name] = found.augmented.p[at[name]]
            errors[parameter.name] = _standard_error(found, at[name])
        values[parameter.name] *= parameter.sign_between(before.axes or case.axes, case.axes)
    return replace(
        before,
        applied=replace(before.applied, values=values),
        standard_errors={name: error for name, error in errors.items() if error is not None},
    )


def _fitted(
    case: Case, found: Search, active: AppliedEffect, same: Sequence[str], *, named: bool
) -> FittedEffect:
    effect, problem = active.effect, found.problem
    at = len(problem.free)
    for other in found.augmented.active:
        if other.key == active.key:
            break
        at += len(other.searched)
    values = {
        one.name: active.values.get(one.name, 0.0) * one.sign_in(case.axes) for one in effect.parameters
    }
    numerics = {name: value for name, value in active.numerics.items() if not name.startswith(_INTERNAL)}
    errors = {one.name: _standard_error(found, at + i) for i, one in enumerate(active.searched)}
    return FittedEffect(
        applied=replace(
            active,
            values=values | numerics,
            units={name: unit_of(case, problem.model, active, name) for name in effect.names},
            condition=None if active.runs is None else _condition(found, active),
        ),
        standard_errors={name: error for name, error in errors.items() if error is not None},
        equivalent_to=tuple(same),
        nuisance=not named,
    )


def _condition(found: Search, active: AppliedEffect) -> tuple[str, tuple[str, ...]] | None:
    """Return the condition whose values part the effect's runs from all the others, None without one."""
    runs = found.problem.runs
    for key in active.effect.confining(key for run in runs for key in run.conditions):
        inside = {run.conditions.get(key) for run in runs if run.name in (active.runs or ())}
        outside = {run.conditions.get(key) for run in runs if run.name not in (active.runs or ())}
        if inside and None not in inside and not inside & outside:
            return key, tuple(sorted(str(one) for one in inside))
    return None


def _standard_error(found: Search, at: int) -> float | None:
    variance = found.variance(at)
    return math.sqrt(variance) if math.isfinite(variance) and variance > 0 else None


def _relative(file: Path, folder: Path) -> str:
    return Path(os.path.relpath(file.resolve(), folder.resolve())).as_posix()
