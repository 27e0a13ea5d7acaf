"""A zero that moved after the tare."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.effects.effect import ANY_OTHER, Effect, EffectParameter
from toolkit.effects.facts import ChannelFacts, Values
from toolkit.effects.surroundings import of_channel

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.effects.signals import Setting


def _moved(y: Array, values: Values, setting: Setting) -> Array:
    return y + values["offset"]


EFFECT = Effect(
    name="zero_offset",
    stage="load_cells",
    rank=1,
    in_time=False,
    statement="The channel's zero moved: a constant is added to all its values.",
    equation="y = y_model + offset",
    reference="JCGM 200:2012, 4.28",
    signature="a constant, the same at every load and angle",
    separates="a tare before and after",
    parameters=(
        EffectParameter(
            name="offset",
            unit="{channel}",
            text="that the channel shows at no load",
            typical=(0.001, 0.05),
            scale=of_channel,
        ),
    ),
    channel=_moved,
    confined_by=("date", "phase", "order", ANY_OTHER),
    on_channel=ChannelFacts(
        where=("output", "cell", "program_cell", "program_load"), tare="after", by_value=False
    ),
    is_zero=True,
    not_correctable="a cell's zero belongs into the tare of each test",
)
