"""Forces that are locked to a revolution: two harmonics of a shaft's angle, for tire and drum alike."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from toolkit.effects.effect import ChannelHook, EffectParameter
from toolkit.effects.facts import Values
from toolkit.effects.surroundings import of_channel

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.effects.signals import Setting


def harmonics(*angles: str) -> ChannelHook:
    """Return the hook that adds two harmonics of the first of these channels that was recorded [rad]."""

    def ripple(y: Array, values: Values, setting: Setting) -> Array:
        angle = setting.channel(*angles)
        if angle is None:
            return y
        total = y
        for n in (1, 2):
            total = total + values[f"amplitude_{n}"] * np.cos(n * angle + np.deg2rad(values[f"phase_{n}"]))
        return total

    return ripple


def _order(n: int, text: str, typical: tuple[float, float]) -> tuple[EffectParameter, EffectParameter]:
    return (
        EffectParameter(
            name=f"amplitude_{n}",
            unit="{channel}",
            text=text,
            typical=typical,
            scale=of_channel,
            bounds=(0.0, float("inf")),
        ),
        EffectParameter(
            name=f"phase_{n}",
            unit="deg",
            text="of it",
            typical=(-180.0, 180.0),
            off=None,
            phase_of=f"amplitude_{n}",
        ),
    )


PARAMETERS = (
    *_order(1, "at one cycle a revolution", (0.005, 0.05)),
    *_order(2, "at two cycles a revolution", (0.002, 0.02)),
)
