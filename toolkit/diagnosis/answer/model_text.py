"""The answer as a model file: the simulation with what was found in it, for `simulate` and `diagnose`."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolkit.diagnosis.fit.nuisance import INPUT_NOISE
from toolkit.diagnosis.simulators.built_in import parameter_names
from toolkit.diagnosis.simulators.parameter_units import sense, unit_of
from toolkit.diagnosis.simulators.setting import nominal_load
from toolkit.effects.sense import turned
from toolkit.files import sha256_file
from toolkit.simulation.model_file import CONTENT
from toolkit.version import __version__

if TYPE_CHECKING:
    from toolkit.diagnosis.answer.answer import Diagnosis
    from toolkit.diagnosis.case.case import Case
    from toolkit.diagnosis.search.search import Search
    from toolkit.diagnosis.simulators.simulator import Active
    from toolkit.effects.effect import Effect
    from toolkit.simulation.model_file import ModelEffect

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
        *_entries({"content": CONTENT, "title": case.title, "code_version": __version__, "axes": case.axes}),
    ]
    time = next((one.name for one in case.channels if one.role == "time"), None)
    lines += _entries({} if time is None else {"time": time})
    load = found.problem.model.capability.nominal_load_N or nominal_load(case)
    lines += _entries({"nominal_load_N": load})
    lines += [
        "",
        "[answer]",
        *_entries({
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
        lines += _entries({one.name: entry})
    for had, names in zip(case.effects, parameter_names(case.effects), strict=True):
        if not had.of_machine:  # those stay in the machine's definition
            lines += _carried(case, found, had, names)
    same = {(one.name, one.channel): one.equivalent_to for one in made.effects}
    steps = [one.active for one in found.steps]
    for active in found.augmented.active:
        if active.effect is INPUT_NOISE:
            continue  # of the recorded slip angle, not of what is simulated
        named = any(_place(active) == _place(one) for one in steps)
        lines += _effect(case, found, active, same.get((active.effect.name, active.channel), ()), named=named)
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
    lines = ["", "[simulation]", *_entries(entries)]
    if sums:
        lines += ["", "[simulation.sha256]", *_entries(sums)]
    own = {one.name for one in case.parameters}
    at = {one.name: i for i, one in enumerate(found.problem.free)}
    for one in found.problem.model.parameters:
        if one.name not in own:
            continue  # an effect's, of the model that the case started from
        value = found.augmented.p[at[one.name]] if one.name in at else one.value
        lines += [
            "",
            f"[simulation.parameters.{_key(one.name)}]",
            *_entries({"value": value, "unit": one.unit}),
        ]
        if one.name in at:
            lines += _standard_error(found, at[one.name])
        if one.bounds is not None:
            lines += _entries({"bounds": list(one.bounds)})
    return lines


def _carried(case: Case, found: Search, one: ModelEffect, names: Sequence[str]) -> list[str]:
    """Return an effect that the simulation had before, with its parameters as they are now."""
    entries = _head(one.effect, one.channel, one.source)
    if one.runs is not None:
        entries["runs"] = list(one.runs)
    if one.condition is not None:
        entries["condition"] = {one.condition[0]: list(one.condition[1])}
    if one.equivalent_to:
        entries["equivalent_to"] = list(one.equivalent_to)
    if one.nuisance:
        entries["nuisance"] = True
    lines = ["", "[[effect]]", *_entries(entries)]
    at = {each.name: i for i, each in enumerate(found.problem.free)}
    for name, parameter in zip(names, one.parameters, strict=True):
        value = found.augmented.p[at[name]] if name in at else parameter.value
        value *= turned(one.effect.name, parameter.name, one.axes or case.axes, case.axes)
        lines += ["", f"[effect.parameters.{_key(parameter.name)}]"]
        lines += _entries({"value": value, "unit": parameter.unit})
        lines += _standard_error(found, at[name]) if name in at else []
    return [*lines, "", "[effect.numerics]", *_entries(dict(one.numerics))] if one.numerics else lines


def _head(effect: Effect, channel: str | None, source: str | None) -> dict[str, Any]:
    entries: dict[str, Any] = {
        "name": effect.name, "stage": effect.stage, "statement": effect.statement,
        "equation": effect.equation,
    }  # fmt: skip
    return entries | {key: one for key, one in (("channel", channel), ("source", source)) if one}


def _effect(case: Case, found: Search, active: Active, same: Sequence[str], *, named: bool) -> list[str]:
    effect, problem = active.effect, found.problem
    entries = _head(effect, active.channel, active.source)
    if active.runs is not None:
        entries["runs"] = [run.name for run in problem.runs if run.name in active.runs]
        condition = _condition(found, active)
        if condition is not None:
            entries["condition"] = {condition[0]: list(condition[1])}
    if same:
        entries["equivalent_to"] = list(same)
    if not named:
        entries["nuisance"] = True
    lines = ["", "[[effect]]", *_entries(entries)]
    at = len(problem.free)
    for other in found.augmented.active:
        if _place(other) == _place(active):
            break
        at += len(other.searched)
    for i, one in enumerate(effect.parameters):
        told = active.values.get(one.name, 0.0) * sense(active, one.name, case.axes)
        unit = unit_of(case, problem.model, active, one.name)
        lines += ["", f"[effect.parameters.{_key(one.name)}]", *_entries({"value": told, "unit": unit})]
        lines += _standard_error(found, at + i) if active.searched else []
    numerics = {
        name: value
        for name, value in active.values.items()
        if name not in effect.names and not name.startswith(_INTERNAL)
    }
    return [*lines, "", "[effect.numerics]", *_entries(numerics)] if numerics else lines


def _condition(found: Search, active: Active) -> tuple[str, tuple[str, ...]] | None:
    """Return the condition whose values part the effect's runs from all the others, None without one."""
    runs = found.problem.runs
    for key in active.effect.confining(key for run in runs for key in run.conditions):
        inside = {run.conditions.get(key) for run in runs if run.name in (active.runs or ())}
        outside = {run.conditions.get(key) for run in runs if run.name not in (active.runs or ())}
        if inside and None not in inside and not inside & outside:
            return key, tuple(sorted(str(one) for one in inside))
    return None


def _standard_error(found: Search, at: int) -> list[str]:
    variance = found.variance(at)
    if not math.isfinite(variance) or variance <= 0:
        return []
    return _entries({"standard_error": math.sqrt(variance)})


def _place(one: Active) -> tuple[object, ...]:
    return (one.effect.name, one.channel, one.source, one.runs)


def _relative(file: Path, folder: Path) -> str:
    return Path(os.path.relpath(file.resolve(), folder.resolve())).as_posix()


def _entries(table: Mapping[str, Any]) -> list[str]:
    return [f"{_key(name)} = {_value(one)}" for name, one in table.items()]


def _key(name: str) -> str:
    plain = name.isascii() and name.replace("_", "").replace("-", "").isalnum()
    return name if plain else _value(name)


def _value(one: Any) -> str:
    if isinstance(one, bool):
        return "true" if one else "false"
    if isinstance(one, float):
        return repr(float(one))
    if isinstance(one, list):
        return f"[{', '.join(_value(each) for each in one)}]"
    if isinstance(one, dict):
        return "{ " + ", ".join(f"{_key(name)} = {_value(each)}" for name, each in one.items()) + " }"
    # JSON's escapes are TOML's, the one of DEL excepted.
    return json.dumps(str(one), ensure_ascii=False).replace("\x7f", "\\u007F")
