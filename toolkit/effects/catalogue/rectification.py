"""A channel that has lost its sign."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from toolkit.effects.effect import Effect
from toolkit.effects.facts import ChannelFacts, Values

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.effects.signals import Setting


def _folded(y: Array, values: Values, setting: Setting) -> Array:
    return np.abs(y)


EFFECT = Effect(
    name="rectification",
    stage="acquisition",
    rank=10,
    in_time=False,
    statement="The channel shows magnitudes: its sign was lost.",
    equation="y = |y_model|",
    reference="the acquisition program's own abs()",
    signature="folded at zero",
    separates="a load of the other sign",
    parameters=(),
    channel=_folded,
    on_channel=ChannelFacts(
        where=("output", "cell", "program_load"),
        tare="own",
        by_value=False,
        about_zero=True,
        directed=True,
        image=(0.0, float("inf")),
    ),
    discrete=True,
    reshapes=True,
)
