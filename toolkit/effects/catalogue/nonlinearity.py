"""Non-linearity of the indication."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import ChannelFacts, Values
from toolkit.effects.surroundings import Surroundings, per_channel

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.effects.signals import Setting


def _bent(y: Array, values: Values, setting: Setting) -> Array:
    return y + values["quadratic"] * y**2 + values["cubic"] * y**3


def _per_square(case: Surroundings) -> float:
    return 1 / case.spread(case.channel) ** 2


EFFECT = Effect(
    name="nonlinearity",
    stage="load_cells",
    rank=6,
    in_time=False,
    statement="The channel is not linear in its load.",
    equation="y = y_model + quadratic * y_model^2 + cubic * y_model^3",
    reference="ASTM E74; ISO 376",
    signature="a residual that bends with the channel's own value and repeats",
    separates="more load steps in the calibration",
    parameters=(
        EffectParameter(
            name="quadratic",
            unit="1/{channel}",
            text="of the square",
            typical=(0.001, 0.05),
            scale=per_channel,
        ),
        EffectParameter(
            name="cubic", unit="1/{channel}^2", text="of the cube", typical=(0.001, 0.05), scale=_per_square
        ),
    ),
    channel=_bent,
    on_channel=ChannelFacts(where=("output", "cell"), tare="own", by_value=True, about_zero=True),
)
