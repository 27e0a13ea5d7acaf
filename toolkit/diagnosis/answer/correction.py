"""From an answer to a correction of the machine: the one effect, its size, its uncertainty, its source."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effects
from toolkit.errors import ConfigError
from toolkit.files import sha256_file
from toolkit.machine import load_machine
from toolkit.machine.correction import Correction, correctable
from toolkit.machine.definition import machine_file

if TYPE_CHECKING:
    from toolkit.effects.effect import Effect
    from toolkit.simulation.model_file import FittedEffect, ModelFile


def correction_of(model: ModelFile, effect: str, *, reason: str, by: str, date: str) -> Correction:
    """Return the correction that an answer supports for one effect, in the machine's axes.

    The effect is one that the answer names, or one of the same class whose equation is that of the named one
    in other words (a pseudo slip angle is a steering zero of the other sign, a conicity a share of the load).
    The decision for one of a class is that of ``by``, and the correction keeps the others' names.

    Raises
    ------
    ConfigError
        ``machine-correction``: the answer was cut off, does not name the effect, has it in some runs only or
        without a standard error; the effect cannot be corrected
    """
    for text, what in ((reason, "reason"), (by, "name of who decides it")):
        if not text.strip():
            raise _wrong(f"a correction has no {what}", model, text, f"a {what}", f"write the {what}")
    if not model.complete:
        raise _wrong(
            "an answer that was cut off corrects nothing", model, "complete = false", "a whole search",
            "diagnose the case again with a larger --budget",
        )  # fmt: skip
    listed, catalogued = correctable(), effects().get(effect)
    if effect not in listed:
        instead = "" if catalogued is None else catalogued.not_correctable
        raise _wrong(
            "this effect cannot become a correction of the machine", model,
            f"{effect}: {instead}" if instead else effect, ", ".join(listed),
            "put right what it names, or name an effect of those expected",
        )  # fmt: skip
    for fitted in model.effects:
        same, applied = fitted.equivalent_to, fitted.applied
        if effect != applied.effect.name and effect not in same:
            continue
        if applied.runs is not None or applied.condition is not None:
            raise _wrong(
                "the effect was found in some runs only, and a correction holds in every test", model,
                f"{fitted.label} in {', '.join(sorted(applied.runs or ()))}", "an effect in all runs",
                "find out what was different in those runs",
            )  # fmt: skip
        sized, u = _sized(model, fitted, listed[effect])
        parameter = sized.effect.names[0]
        return Correction(
            effect=effect,
            channel=sized.channel,
            source=sized.source,
            parameter=parameter,
            value=sized.values[parameter],
            unit=sized.units[parameter],
            u=u,
            reason=reason.strip(),
            by=by.strip(),
            date=date,
            answer_sha256=model.sha256,
            case_sha256=model.case_sha256,
            code_version=model.code_version,
            equivalent_to=tuple(name for name in (applied.effect.name, *same) if name != effect),
        )
    names = ", ".join(
        name for effect in model.effects for name in (effect.applied.effect.name, *effect.equivalent_to)
    )
    raise _wrong(
        "the answer does not name this effect", model, effect, names or "none", "name an effect of the answer"
    )


def machine_of(model: ModelFile, name: str) -> str | None:
    """Return the SHA-256 of the definition that a model was fitted with; None without a machine.

    Raises
    ------
    ConfigError
        ``machine-correction``: it was another machine than the one of this ``name``
    """
    if model.kind != "machine":
        return None
    file = model.file("machine")
    machine = str(model.simulation.get("machine", "")) if file is None else str(file)
    fitted = load_machine(machine).name
    if fitted != name:
        raise _wrong(
            "the answer is one of another machine", model, fitted, name,
            f"correct {fitted}, or diagnose recordings of {name}",
        )  # fmt: skip
    return sha256_file(machine_file(machine))


def _sized(model: ModelFile, fitted: FittedEffect, effect: Effect) -> tuple[AppliedEffect, float]:
    """Return the effect as it is corrected, in machine axes, and its standard uncertainty."""
    fitted_effect, way = fitted.applied.effect, effect.correctable
    parameter = fitted_effect.parameters[0]
    u = fitted.standard_errors.get(parameter.name)
    if u is None:
        raise _wrong(
            "the effect has no standard error, so its correction would have no uncertainty", model,
            fitted.label, "an effect whose size the recordings determine", "record what determines it",
        )  # fmt: skip
    value = fitted.applied.values[parameter.name] * parameter.sign_between(model.axes, "machine")
    if effect.name == fitted_effect.name:
        if way is not None and way.channels and model.axes != "machine":
            raise _wrong(
                f"{effect.name} is a machine's own, and this case does not stand in the machine's axes",
                model, f'axes = "{model.axes}"', 'axes = "machine"',
                "give the recordings in the machine's axes",
            )  # fmt: skip
        applied = fitted.applied
        return _applied(effect, applied.channel, applied.source, value, applied.units[parameter.name]), u
    alike, load = fitted_effect.alike, model.nominal_load_N
    size = alike.size if alike is not None and _same_class(fitted_effect, effect) else None
    sizes = None if size is None else (size(value, load), size(u, load))
    if alike is None or sizes is None or sizes[0] is None or sizes[1] is None:
        raise _wrong(
            "the answer has fitted another effect of the class, whose size is not this one's", model,
            f"{fitted.label}, not {effect.name}", "an answer that names the effect itself",
            "measure what tells them apart: the answer says what",
        )  # fmt: skip
    text = alike.size_unit or fitted.applied.units[parameter.name]
    return _applied(effect, *alike.place, sizes[0], text), abs(sizes[1])


def _same_class(effect: Effect, other: Effect) -> bool:
    return effect.alike is not None and other.alike is not None and effect.alike.group == other.alike.group


def _applied(
    effect: Effect, channel: str | None, source: str | None, value: float, text: str
) -> AppliedEffect:
    name = effect.names[0]
    return AppliedEffect(
        effect=effect, channel=channel, source=source, values={name: value}, units={name: text}
    )


def _wrong(what: str, model: ModelFile, got: str, expected: str, next_step: str) -> ConfigError:
    return ConfigError(
        what, where=model.path, got=got, expected=expected, next_step=next_step, rule="machine-correction"
    )
