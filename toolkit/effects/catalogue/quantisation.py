"""A channel in coarse steps."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import ChannelFacts, Values
from toolkit.effects.surroundings import of_channel

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.effects.signals import Setting


def _stepped(y: Array, values: Values, setting: Setting) -> Array:
    step = abs(values["step"])
    return y if step == 0 else step * np.round(y / step)


EFFECT = Effect(
    name="quantisation",
    stage="acquisition",
    rank=8,
    in_time=False,
    statement="The channel is digitised in coarse steps.",
    equation="y = step * round(y_model/step)",
    reference="Widrow and Kollar, Quantization Noise, 2008",
    signature="values on a lattice",
    separates="a finer range of the digitiser",
    parameters=(
        EffectParameter(
            name="step",
            unit="{channel}",
            text="of the digitiser",
            typical=(0.005, 0.1),
            scale=of_channel,
            bounds=(0.0, float("inf")),
            starts=(0.02, 0.05, 0.1),
        ),
    ),
    channel=_stepped,
    on_channel=ChannelFacts(where=("output", "cell"), tare="own", by_value=False, about_zero=True),
    from_digits=True,
)
