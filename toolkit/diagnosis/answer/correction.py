"""From an answer to a correction of the machine: the one effect, its size, its uncertainty, its source."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from toolkit.effects.sense import turned
from toolkit.errors import ConfigError
from toolkit.files import sha256_file
from toolkit.machine import load_machine
from toolkit.machine.correction import CORRECTABLE, Correction
from toolkit.machine.definition import machine_file

if TYPE_CHECKING:
    from toolkit.simulation.model_file import ModelEffect, ModelFile

_WHY_NOT = {
    "sensitivity_error": "a cell's sensitivity belongs into a new calibration",
    "zero_offset": "a cell's zero belongs into the tare of each test",
    "zero_drift": "a drift is another one in each test",
    "thermal_drift": "a drift is another one in each test",
    "wrong_calibration": "the right record computes the test: toolkit process --calibration",
    "channel_sign": "the right record computes the test: toolkit process --calibration",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class _Size:
    value: float
    u: float
    unit: str
    channel: str | None = None
    source: str | None = None


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
    if effect not in CORRECTABLE:
        raise _wrong(
            "this effect cannot become a correction of the machine", model,
            f"{effect}: {_WHY_NOT[effect]}" if effect in _WHY_NOT else effect, ", ".join(CORRECTABLE),
            "put right what it names, or name an effect of those expected",
        )  # fmt: skip
    for one in model.effects:
        same = one.equivalent_to
        if effect != one.effect.name and effect not in same:
            continue
        if one.runs is not None or one.condition is not None:
            raise _wrong(
                "the effect was found in some runs only, and a correction holds in every test", model,
                f"{one.label} in {', '.join(one.runs or ())}", "an effect in all runs",
                "find out what was different in those runs",
            )  # fmt: skip
        size = _size(model, one, effect)
        return Correction(
            effect=effect,
            channel=size.channel,
            source=size.source,
            parameter=CORRECTABLE[effect][0],
            value=size.value,
            unit=size.unit,
            u=size.u,
            reason=reason.strip(),
            by=by.strip(),
            date=date,
            answer_sha256=model.sha256,
            case_sha256=model.case_sha256,
            code_version=model.code_version,
            equivalent_to=tuple(name for name in (one.effect.name, *same) if name != effect),
        )
    named = ", ".join(name for one in model.effects for name in (one.effect.name, *one.equivalent_to))
    raise _wrong(
        "the answer does not name this effect", model, effect, named or "none", "name an effect of the answer"
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
    told = str(model.simulation.get("machine", "")) if file is None else str(file)
    fitted = load_machine(told).name
    if fitted != name:
        raise _wrong(
            "the answer is one of another machine", model, fitted, name,
            f"correct {fitted}, or diagnose recordings of {name}",
        )  # fmt: skip
    return sha256_file(machine_file(told))


def _size(model: ModelFile, one: ModelEffect, effect: str) -> _Size:
    (parameter,) = one.parameters[:1]
    if parameter.standard_error is None:
        raise _wrong(
            "the effect has no standard error, so its correction would have no uncertainty", model, one.label,
            "an effect whose size the recordings determine", "record what determines it",
        )  # fmt: skip
    value, u = parameter.value, parameter.standard_error
    sign = turned(one.effect.name, parameter.name, model.axes, "machine")
    if effect == one.effect.name:
        if effect == "crosstalk" and model.axes != "machine":
            raise _wrong(
                "crosstalk is a machine's own, and this case does not stand in the machine's axes", model,
                f'axes = "{model.axes}"', 'axes = "machine"', "give the recordings in the machine's axes",
            )  # fmt: skip
        return _Size(value=sign * value, u=u, unit=parameter.unit, channel=one.channel, source=one.source)
    if (one.effect.name, effect) == ("plysteer", "steer_offset"):
        # alpha = SA + pseudo_slip_angle is alpha = SA - offset with the other sign.
        return _Size(value=-sign * value, u=u, unit=parameter.unit)
    if (one.effect.name, effect) == ("conicity", "crosstalk") and model.nominal_load_N:
        # FY + force FZ/FZ0 is FY + coefficient FZ, the tire mounted one way.
        load = model.nominal_load_N
        return _Size(value=sign * value / load, u=u / load, unit="(N)/(N)", channel="FY", source="FZ")
    raise _wrong(
        "the answer has fitted another effect of the class, whose size is not this one's", model,
        f"{one.label}, not {effect}", "an answer that names the effect itself",
        "measure what tells them apart: the answer says what",
    )  # fmt: skip


def _wrong(what: str, model: ModelFile, got: str, expected: str, next_step: str) -> ConfigError:
    return ConfigError(
        what, where=model.path, got=got, expected=expected, next_step=next_step, rule="machine-correction"
    )
