"""Effects through their hooks, at their own stage only: what drives the tire, and single signals."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from toolkit.effects.signals import Drive, Setting, Tire
from toolkit.machine import Machine
from toolkit.simulation.places import unit_of
from toolkit.simulation.switched import Switched
from toolkit.units import from_si, to_si

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Signals = dict[str, NDArray[np.float64]]


def driven(start: Drive, effects: Iterable[Switched], setting: Setting, tire: Tire) -> Drive:
    """Return what drives the tire when effects have acted on it, one after another."""
    for one in effects:
        if one.effect.drive is not None:
            start = one.effect.drive(start, one.parameters, setting, tire)
    return start


def through(
    signals: Mapping[str, NDArray[np.float64]],
    effects: Iterable[Switched],
    setting: Setting,
    machine: Machine,
) -> Signals:
    """Return signals [SI] by name when effects have acted on them; those of other signals do nothing.

    Each acts in the signal's own unit, in which its parameters are given.
    """
    made = dict(signals)
    for one in effects:
        hook, name, source = one.effect.channel, one.channel, one.source
        if hook is None or name is None or name not in made:
            continue
        if one.effect.name == "channel_swap":
            other = str(source)
            made[name], made[other] = (
                to_si(_shown(made, other, machine), unit_of(machine, name)),
                to_si(_shown(made, name, machine), unit_of(machine, other)),
            )
            continue
        seen = setting
        if source is not None:
            seen = dataclasses.replace(
                setting, channels={**setting.channels, "from": _shown(made, source, machine)}
            )
        changed = hook(_shown(made, name, machine), one.parameters, seen)
        made[name] = to_si(changed, unit_of(machine, name))
    return made


def _shown(signals: Signals, name: str, machine: Machine) -> NDArray[np.float64]:
    return from_si(signals[name], unit_of(machine, name))
