"""Units of an effect's parameters in a case: the placeholders of the catalogue filled in."""

from __future__ import annotations

import re
from collections.abc import Iterator

from toolkit.diagnosis.case.case import Case
from toolkit.diagnosis.simulators.simulator import Model
from toolkit.effects.applied import AppliedEffect


def unit_of(case: Case, model: Model, active: AppliedEffect, name: str) -> str:
    """Return the unit of one parameter of an effect at its place."""
    text = active.effect.parameter(name).unit or active.units.get(name, "1")
    if "{" not in text:
        return text
    if active.effect.stage == "dynamics":
        motion = model.capability.motion
        output_unit = channel_unit(case, model, active.channel)
        force, velocity, position = (
            (output_unit, "1", "1") if motion is None else motion.units(active.channel)
        )
        return reduced(text.format(force=force, velocity=velocity, position=position))
    output_unit, source_unit = (
        channel_unit(case, model, active.channel),
        channel_unit(case, model, active.source),
    )
    return reduced(
        text.format_map({"channel": _bracketed(output_unit, text), "from": _bracketed(source_unit, text)})
    )


def _bracketed(unit: str, text: str) -> str:
    """Return a unit in brackets where what stands around it would take it apart."""
    return f"({unit})" if ("*" in unit or "/" in unit) and ("/" in text or "^" in text) else unit


def channel_unit(case: Case, model: Model, name: str | None) -> str:
    """Return the stated unit of an output or a channel, "1" of none."""
    for output in model.outputs:
        if output.name == name:
            return output.unit
    for channel in case.channels:
        if channel.name == name:
            return channel.unit
    return "1"


_PARTS = re.compile(r"[()*/]|\^\d|[^\W\d]+|°|%|1")


def reduced(text: str) -> str:
    """Return a unit without what cancels in it; as it stands where nothing does, or it cannot be taken apart.

    >>> reduced("m/s^2/(m/s^2*s)"), reduced("N/((N*m))"), reduced("1/1^2"), reduced("N/(m/s)^2")
    ('1/s', '1/m', '1', 'N/(m/s)^2')
    """
    parts = _PARTS.findall(text)
    if "".join(parts) != text:
        return text
    factors = _product(iter(parts), 1)
    names = [name for name, _ in factors]
    plain_ones = names.count("1") - (len(names) > 1 and text.startswith("1/"))
    if len(set(names)) == len(names) and (plain_ones <= 0 or text == "1"):
        return text
    powers: dict[str, int] = {}
    for name, power in factors:
        powers[name] = powers.get(name, 0) + power
    remaining = {name: power for name, power in powers.items() if power and name != "1"}
    over = [_raised(name, power) for name, power in remaining.items() if power > 0]
    under = [_raised(name, -power) for name, power in remaining.items() if power < 0]
    below = under[0] if len(under) == 1 else f"({'*'.join(under)})"
    return ("*".join(over) or "1") + (f"/{below}" if under else "")


def _product(parts: Iterator[str], sign: int) -> list[tuple[str, int]]:
    """Return names and powers up to the closing bracket, from left to right."""
    powers: list[tuple[str, int]] = []
    last: list[tuple[str, int]] = []
    power = sign
    for part in parts:
        if part == ")":
            break
        if part.startswith("^"):
            last = [(name, exponent * int(part[1:])) for name, exponent in last]
        elif part in "*/":
            powers, power = powers + last, sign if part == "*" else -sign
        else:
            last = _product(parts, power) if part == "(" else [(part, power)]
    return powers + last


def _raised(name: str, power: int) -> str:
    return name if power == 1 else f"{name}^{power}"
