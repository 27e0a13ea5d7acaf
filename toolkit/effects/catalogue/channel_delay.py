"""A channel that comes later than the others."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import ChannelFacts, Values
from toolkit.effects.filters import PAST, STRAIGHT, delayed

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.effects.signals import Setting


def _late(y: Array, values: Values, setting: Setting) -> Array:
    straight, past = STRAIGHT in values, values.get(PAST, 0.0)
    return delayed(setting.t, y, values["delay"], straight=straight, past=past)


EFFECT = Effect(
    name="channel_delay",
    stage="acquisition",
    rank=5,
    in_time=True,
    statement=("The channel is late (or early) against the inputs by one time at all loads and speeds."),
    equation="y = y_model(t - delay)",
    reference="Ljung, System Identification, 1999, 4.2",
    signature="like a lag, but the same time at all loads and speeds; may be negative",
    separates="motion at two rates: a delay is one time at both; a second speed parts it from relaxation",
    parameters=(
        EffectParameter(
            name="delay",
            unit="s",
            text="positive where the channel is later than the inputs",
            typical=(0.01, 0.5),
            starts=(-0.1, -0.02, 0.02, 0.1, 0.4),
        ),
    ),
    channel=_late,
    remembers=True,
    reshapes=True,  # a lag's own parameter imitates it
    on_channel=ChannelFacts(where=("output", "cell"), tare="own", by_value=True, between_rows=True),
)
