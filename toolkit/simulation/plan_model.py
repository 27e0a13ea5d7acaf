"""A model file as the tire of a plan: refitted coefficients, and the effects that were found."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from toolkit.errors import ConfigError
from toolkit.simulation.file_tire import FileTire, read_file_tire
from toolkit.simulation.model_file import FittedEffect, ModelFile, read_model
from toolkit.tires.tir import TirFile, TirLine

_NEW = "SCALING_COEFFICIENTS"  # where a coefficient goes that the file leaves to its default


def model_tire(path: Path, *, where: str) -> tuple[FileTire, tuple[str, ...]]:
    """Return the tire of a model file with its refitted coefficients, and its effects as a plan writes them.

    Raises
    ------
    ConfigError
        as `read_model`; the model is of another kind than ``machine``, frees a number of the machine, or has
        an effect that is tied to single recordings
    """
    model = read_model(path)
    tire = model.file("tire")
    if model.kind != "machine" or tire is None:
        raise _wrong("the model has no tire", where, f"a model of kind {model.kind}", "one of kind machine")
    numbers = {one.name: one.value for one in model.parameters}
    ours = [name for name in numbers if "." in name]
    if ours:
        raise _wrong(
            "the model has a number of the machine refitted", where, ", ".join(ours),
            "coefficients and scale factors of the tire alone",
        )  # fmt: skip
    file = read_file_tire(tire)
    changed = dataclasses.replace(file, tir=with_numbers(file.tir, numbers))
    return changed, tuple(effect_text(one, model, where=where) for one in model.effects)


def with_numbers(tir: TirFile, numbers: dict[str, float]) -> TirFile:
    """Return a tire file with other values of coefficients; one that it leaves out is added.

    >>> from toolkit.tires.tir import parse_tir
    >>> tir = parse_tir("[MODEL]\\nFITTYP = 61\\n[LATERAL_COEFFICIENTS]\\nPCY1 = 1.3\\n")
    >>> with_numbers(tir, {"PCY1": 1.4, "LKY": 0.9}).coefficients()
    {'PCY1': 1.4, 'LKY': 0.9}
    """
    known = {line.key for line in tir.lines if line.section.endswith("COEFFICIENTS")}
    lines = [
        dataclasses.replace(line, value=numbers[line.key])
        if line.key in numbers and line.section.endswith("COEFFICIENTS")
        else line
        for line in tir.lines
    ]
    missing = [name for name in numbers if name not in known]
    if missing:
        lines += [TirLine(section=_NEW, text=f"[{_NEW}]")]
        lines += [TirLine(section=_NEW, key=name, value=numbers[name]) for name in missing]
    return dataclasses.replace(tir, lines=tuple(lines))


def effect_text(one: FittedEffect, model: ModelFile, *, where: str) -> str:
    """Return an effect of a model as a plan writes it: ``steer_offset=offset:0.3deg``, machine axes.

    Raises
    ------
    ConfigError
        ``model-file``: the effect is in some runs only, by their names
    """
    applied, effect = one.applied, one.applied.effect
    if effect.replaces_record:
        return f"{effect.name}={applied.source}"
    head = applied.key.dotted
    if applied.condition is not None:
        key, values = applied.condition
        head += f"@{key}:{'+'.join(values)}"
    elif applied.runs is not None:
        raise _wrong(
            "an effect of the model is tied to single recordings", where,
            f"{one.label} in {', '.join(sorted(applied.runs))}",
            "an effect in all runs, or by a condition of runs",
        )  # fmt: skip
    written = [
        f"{parameter.name}:"
        f"{applied.values[parameter.name] * parameter.sign_between(model.axes, 'machine')!r}"
        f"{applied.units[parameter.name]}"
        for parameter in effect.parameters
    ]
    return head + (f"={','.join(written)}" if written else "")


def _wrong(what: str, where: str, got: str, expected: str) -> ConfigError:
    return ConfigError(
        what, where=where, got=got, expected=expected,
        next_step="run the model on inputs instead: toolkit simulate MODEL.toml --inputs FILE.csv",
        rule="model-file",
    )  # fmt: skip
