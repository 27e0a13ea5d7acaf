"""The lag of a filter in the acquisition."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import ChannelFacts, Values
from toolkit.effects.filters import STRAIGHT, begun, filtered

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.effects.signals import Setting


def _filtered(y: Array, values: Values, setting: Setting) -> Array:
    return filtered(
        setting.t, y, values["time_constant"], straight=STRAIGHT in values, start=begun(y, values)
    )


EFFECT = Effect(
    name="filter_lag",
    stage="acquisition",
    rank=6,
    in_time=True,
    statement="A filter makes the channel late and smooth.",
    equation="time_constant * y' + y = y_model",
    reference="Oppenheim and Schafer, Discrete-Time Signal Processing, 2010",
    signature="fast changes late and smaller, slow ones hardly",
    separates="a step that is recorded with and without the filter",
    parameters=(
        EffectParameter(
            name="time_constant",
            unit="s",
            text="of the filter",
            typical=(0.01, 1.0),
            bounds=(0.0, 1000.0),
            starts=(0.02, 0.1, 0.5, 3.0),
        ),
    ),
    channel=_filtered,
    remembers=True,
    on_channel=ChannelFacts(where=("output", "cell"), tare="own", by_value=True, between_rows=True),
)
