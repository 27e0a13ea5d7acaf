"""Effects as they are written: ``NAME[.CHANNEL][@CONDITION:VALUE][=VALUE]``.

    relaxation=0.5m                             one parameter; its unit, or another of the same dimension
    relaxation.relaxation_length=0.5m           the same
    creep.D51=fraction:0.01,time_constant:20s   several parameters, on one cell
    zero_offset.D51=0.002mV/V                   on one signal; without a name on every cell
    crosstalk.FZ.FY=0.01                        from FZ to FY
    channel_swap.D51.D52   channel_sign.E5      there or not: no value
    wrong_calibration=rig-r1                    the record that was used instead
    load_lag@order:1+2=1.5s                     only in runs with the condition order = 1 or 2

A number without a unit is in the parameter's own. A parameter that is not given is off, or has its usual
value where it cannot be off.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from toolkit.effects.applied import AppliedEffect, Condition
from toolkit.effects.catalogue import effect as find_effect
from toolkit.effects.effect import Effect, EffectParameter
from toolkit.errors import ConfigError, UnitError
from toolkit.files import number_of
from toolkit.machine import Machine
from toolkit.simulation.places import (
    can_join,
    channels_of,
    default_channels,
    is_paired,
    sources_of,
    unit_of,
)
from toolkit.spelling import nearest
from toolkit.units import unit

_QUANTITY = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*", re.ASCII | re.DOTALL)


def parse_effect(text: str, machine: Machine) -> tuple[AppliedEffect, ...]:
    """Return the effect that a text switches on, once for each signal that it acts on.

    Raises
    ------
    ConfigError
        an unknown effect, signal or parameter, a value that is no number, a unit of another dimension, a
        value outside the effect's bounds, a value where there is none to give, or none where one is needed
    """
    where = f"--effect {text}"
    head, equals, value_text = text.partition("=")
    head, at, confined = head.partition("@")
    name, *parts = [part.strip() for part in head.split(".")]
    effect = find_effect(name, where=where)
    if effect.stage == "dynamics":
        raise _wrong(
            f"{name} is a term of an equation of motion, not of the tire test machine", where, name,
            "an effect of road, carriage, tire, load_cells or acquisition",
            "write it into the simulator of a case of kind ode or python",
        )  # fmt: skip
    parameter = None
    if parts and parts[-1] in effect.names:
        parameter = parts.pop()
    source, channels = _signals(effect, parts, where)
    condition = _condition(confined, where) if at else None
    if effect.replaces_record:
        if not value_text.strip():
            raise _wrong(
                "the record that was used is not named", where, "nothing", "a registry id, such as rig-r1",
                f"write --effect {effect.name}=ID",
            )  # fmt: skip
        return (AppliedEffect(effect=effect, source=value_text.strip(), condition=condition),)
    effects_read = []
    for channel in channels or (None,):
        units = {
            parameter.name: _unit(parameter, machine, channel, source) for parameter in effect.parameters
        }
        values = _values(effect, parameter, value_text if equals else None, units, where)
        effects_read.append(
            AppliedEffect(
                effect=effect,
                channel=channel,
                source=source,
                values=values,
                units=units,
                condition=condition,
            )
        )
    return tuple(effects_read)


def _signals(
    effect: Effect, parts: Sequence[str], where: str
) -> tuple[str | None, tuple[str, ...]]:  # source, channels
    channels = channels_of(effect)
    if is_paired(effect):
        if len(parts) != 2 or parts[0] == parts[1]:
            raise _wrong(
                f"effect {effect.name!r} is between two signals", where, ".".join(parts) or "none",
                f"two of {', '.join(dict.fromkeys((*sources_of(effect), *channels)))}",
                f"write {effect.name}.{'D51.D52' if effect.exchanges else 'FZ.FY=0.01'}",
            )  # fmt: skip
        # A swap names two signals, crosstalk says from which to which.
        source = _one_of(parts[0], sources_of(effect), effect, where)
        channel = _one_of(parts[1], channels, effect, where)
        if not can_join(effect, source, channel):
            raise _wrong(
                f"effect {effect.name!r} cannot join {source} and {channel}", where, ".".join(parts),
                "two cells, or two loads", "name two signals of one kind",
            )  # fmt: skip
        return source, (channel,)
    if not channels and parts:
        expected = f"the effect's name alone{', or .' + ', .'.join(effect.names) if effect.names else ''}"
        near = nearest(parts[0], effect.names)
        raise _wrong(
            f"effect {effect.name!r} acts on the whole machine", where, parts[0], expected,
            f"did you mean {near!r}?" if near else "correct the part after the dot",
        )  # fmt: skip
    if len(parts) > 1:
        raise _wrong(
            f"effect {effect.name!r} acts on one signal", where, ".".join(parts), ", ".join(channels),
            "name one; give the option again for another",
        )  # fmt: skip
    return None, (_one_of(parts[0], channels, effect, where),) if parts else default_channels(effect)


def _one_of(part: str, choices: Sequence[str], effect: Effect, where: str) -> str:
    if part in choices:
        return part
    names = [*choices, *effect.names]
    near = nearest(part, names)
    raise _wrong(
        f"effect {effect.name!r} knows no part {part!r}", where, part, ", ".join(names),
        f"did you mean {near!r}?" if near else "correct the part after the dot",
    )  # fmt: skip


def _condition(text: str, where: str) -> Condition:
    key, colon, values = text.partition(":")
    levels = tuple(level.strip() for level in values.split("+"))
    if not key.strip() or not colon or not all(levels):
        raise _wrong(
            "a condition is not whole", where, f"@{text}", "@KEY:VALUE or @KEY:VALUE+VALUE",
            "write for example @order:1+2",
        )  # fmt: skip
    return key.strip(), levels


def _unit(parameter: EffectParameter, machine: Machine, channel: str | None, source: str | None) -> str:
    if "{" not in parameter.unit:
        return parameter.unit
    names = {"channel": channel, "from": source}
    texts = {key: "1" if name is None else unit_of(machine, name) for key, name in names.items()}
    if parameter.unit != "{channel}":  # "1/N*m" would be read from left to right
        texts = {key: f"({text})" if set("/*") & set(text) else text for key, text in texts.items()}
    return re.sub(r"\((\w+)\)", r"\1", parameter.unit.format_map(texts))  # no brackets around one name


def _values(
    effect: Effect, parameter: str | None, value_text: str | None, units: dict[str, str], where: str
) -> dict[str, float]:
    if not effect.parameters:
        if value_text is not None:
            raise _wrong(
                f"effect {effect.name!r} has no size: it is present or absent", where,
                value_text or "nothing", "no value",
                "leave out the = and what follows",
            )  # fmt: skip
        return {}
    declared = {parameter.name: parameter for parameter in effect.parameters}
    values: dict[str, float] = {}
    for item in (value_text or "").split(","):
        name, colon, text = item.rpartition(":")
        name = name.strip() if colon else (parameter or effect.parameters[0].name)
        if name not in declared:
            near = nearest(name, list(declared))
            raise _wrong(
                f"effect {effect.name!r} has no parameter {name!r}", where, name, ", ".join(declared),
                f"did you mean {near!r}?" if near else "use one of those expected",
            )  # fmt: skip
        if name in values:
            raise _wrong(
                f"the parameter {name!r} is given twice", where, value_text, f"{name} once", "remove one",
            )  # fmt: skip
        values[name] = _number(effect, declared[name], text, units[name], where)
    return {parameter.name: values.get(parameter.name, _usual(parameter)) for parameter in effect.parameters}


def _number(effect: Effect, parameter: EffectParameter, text: str, stated: str, where: str) -> float:
    words = {} if parameter.words is None else parameter.words()
    if text.strip() in words:
        return words[text.strip()]
    match = _QUANTITY.fullmatch(text)
    value = number_of(match[1]) if match else None
    if match is None or value is None:
        raise _wrong(
            f"effect {effect.name!r} has no number", where, text.strip() or "nothing",
            f"a number in {stated} ({parameter.name}: {parameter.text})",
            f"write --effect {effect.name}=VALUE",
        )  # fmt: skip
    if match[2]:
        value *= _factor(match[2], stated, parameter, where)
    if not parameter.bounds[0] <= value <= parameter.bounds[1]:
        raise _wrong(
            f"the parameter {parameter.name!r} of {effect.name!r} cannot have that value", where,
            text.strip(),
            f"from {parameter.bounds[0]:g} to {parameter.bounds[1]:g} {stated}", "give another value",
        )  # fmt: skip
    return value


def _factor(text: str, stated: str, parameter: EffectParameter, where: str) -> float:
    try:
        written_unit, expected = unit(text, where=where), unit(stated)
    except UnitError as error:
        raise _wrong(
            f"the unit of {parameter.name!r} is not known", where, text, stated,
            f"write it in {stated}", error,
        ) from error  # fmt: skip
    if written_unit.dimension != expected.dimension or written_unit.offset != expected.offset:
        raise _wrong(
            f"the parameter {parameter.name!r} is in a unit of another dimension", where,
            f"{text} ({written_unit.dimension})", f"{stated} ({expected.dimension})", f"write it in {stated}",
        )  # fmt: skip
    return written_unit.factor / expected.factor


def _usual(parameter: EffectParameter) -> float:
    if parameter.off is not None:
        return parameter.off
    return parameter.starts[0] if parameter.starts else 0.5 * (parameter.typical[0] + parameter.typical[1])


def _wrong(
    problem: str, where: str, actual: object, expected: str, next_step: str, cause: UnitError | None = None
) -> ConfigError:
    return ConfigError(
        problem, where=where, got=actual, expected=expected, next_step=next_step,
        rule=(cause.rule if cause else None) or "effect-value",
    )  # fmt: skip
