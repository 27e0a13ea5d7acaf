"""A zero that drifts with time."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import ChannelFacts, Values
from toolkit.effects.surroundings import Surroundings, of_channel

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.effects.signals import Setting


def _drifting(y: Array, values: Values, setting: Setting) -> Array:
    return y + values["rate"] * setting.elapsed_s / 60.0


def _over_the_test(case: Surroundings) -> float:
    return 20 * of_channel(case) / max(case.minutes, 1e-9)


def _any(values: Values) -> float:
    return math.inf  # a drift says nothing of the value that it starts from


EFFECT = Effect(
    name="zero_drift",
    stage="load_cells",
    rank=2,
    in_time=True,
    statement="The channel's zero drifts steadily with time.",
    equation="y = y_model + rate * t",
    reference="JCGM 200:2012, 4.21",
    signature="linear in time, the same at every load",
    separates="tare before and after, and the first condition repeated at the end",
    parameters=(
        EffectParameter(
            name="rate",
            unit="{channel}/min",
            text="drift of the zero",
            typical=(0.0001, 0.01),
            scale=_over_the_test,
        ),
    ),
    channel=_drifting,
    on_channel=ChannelFacts(where=("output", "cell"), tare="own", by_value=False),
    zero_beside=_any,
    not_correctable="a drift is another one in each test",
)
