"""A channel that reads nothing of small loads."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import ChannelFacts, Values
from toolkit.effects.surroundings import of_channel

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.effects.signals import Setting

NOISE = "_noise"
"""Among the values: sd of noise that comes before the band, in the channel's unit; without it none does."""


def _dead(y: Array, values: Values, setting: Setting) -> Array:
    half = 0.5 * abs(values["width"])
    noise = values.get(NOISE, 0.0)
    if not noise > 0:
        return np.sign(y) * np.maximum(np.abs(y) - half, 0.0)
    return _above(y - half, noise) - _above(-y - half, noise)


def _above(y: Array, sd: float) -> Array:
    """Return the mean of max(y + noise, 0) for normal noise."""
    from scipy.special import ndtr

    return np.asarray(y * ndtr(y / sd) + sd / math.sqrt(2 * math.pi) * np.exp(-0.5 * (y / sd) ** 2))


EFFECT = Effect(
    name="dead_band",
    stage="acquisition",
    rank=9,
    in_time=False,
    statement="The channel reads nothing of small loads.",
    equation="y = sign(y_model) * max(|y_model| - width/2, 0)",
    reference="Tao and Kokotovic, 1996",
    signature="flat about zero, shifted outside",
    separates="small loads of both signs",
    parameters=(
        EffectParameter(
            name="width",
            unit="{channel}",
            text="full width of the band",
            typical=(0.02, 0.3),
            scale=of_channel,
            bounds=(0.0, float("inf")),
            starts=(0.05, 0.2),
        ),
    ),
    channel=_dead,
    on_channel=ChannelFacts(where=("output", "cell"), tare="own", by_value=True, about_zero=True),
    noise_key=NOISE,
)
