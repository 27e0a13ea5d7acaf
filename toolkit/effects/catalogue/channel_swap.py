"""Two channels that were taken for each other."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.effects.effect import Effect
from toolkit.effects.facts import ChannelFacts, Values

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.effects.signals import Setting


def _other(y: Array, values: Values, setting: Setting) -> Array:
    source = setting.channels.get("from")
    return y if source is None else source


EFFECT = Effect(
    name="channel_swap",
    stage="acquisition",
    rank=3,
    in_time=False,
    statement="Two channels were taken for each other.",
    equation="y_a = b, y_b = a",
    reference="the thesis, 4.4 (D52 stands before D51)",
    signature="each channel is the other's simulation",
    separates="a load on one channel alone",
    parameters=(),
    channel=_other,
    on_channel=ChannelFacts(
        where=("output", "program_cell", "program_load"), tare="own", by_value=False, second="with"
    ),
    discrete=True,
)
