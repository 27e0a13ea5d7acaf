"""A channel that cannot read beyond its range."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import ChannelFacts, Values
from toolkit.effects.surroundings import of_channel

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.effects.signals import Setting


def _clipped(y: Array, values: Values, setting: Setting) -> Array:
    return np.clip(y, -abs(values["level"]), abs(values["level"]))


EFFECT = Effect(
    name="saturation",
    stage="acquisition",
    rank=7,
    in_time=False,
    statement="The channel saturates: beyond a level it reads that level.",
    equation="y = clip(y_model, -level, level)",
    reference="Widrow and Kollar, Quantization Noise, 2008, ch. 1",
    signature="flat tops",
    separates="the same loads at a lower gain",
    parameters=(
        EffectParameter(
            name="level",
            unit="{channel}",
            text="largest magnitude that is read",
            typical=(0.5, 0.98),
            off=float("inf"),
            scale=of_channel,
            bounds=(0.0, float("inf")),
            starts=(0.4, 0.55, 0.7, 0.85, 0.95),
        ),
    ),
    channel=_clipped,
    on_channel=ChannelFacts(where=("output", "cell"), tare="own", by_value=False, about_zero=True),
    reshapes=True,
)
