"""A zero that moves with the temperature."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import ChannelFacts, Values
from toolkit.effects.surroundings import Surroundings, of_channel

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.effects.signals import Setting


_TEMPERATURES = ("T_CELL", "T_AMBIENT", "T", "T_TREAD")  # the nearest to the cell first


def _warming(y: Array, values: Values, setting: Setting) -> Array:
    name = next((channel for channel in _TEMPERATURES if channel in setting.channels), None)
    if name is None or not len(y):
        return y
    temperature = setting.channels[name]
    return y + values["coefficient"] * (temperature - setting.first.get(name, float(temperature[0])))


def _over_the_range(case: Surroundings) -> float:
    return 100 * of_channel(case) / max(case.recorded_range(*_TEMPERATURES), 0.1)


def _any(values: Values) -> float:
    return math.inf  # a drift says nothing of the value that it starts from


EFFECT = Effect(
    name="thermal_drift",
    stage="load_cells",
    rank=3,
    in_time=False,
    statement="The channel's zero moves with the temperature.",
    equation="y = y_model + coefficient * (T - T0)",
    reference="OIML R 60, 5.5.1",
    signature="follows the temperature, the same at every load",
    separates="the temperature at the cell, and a tare at two temperatures",
    parameters=(
        EffectParameter(
            name="coefficient",
            unit="{channel}/K",
            text="change of the zero",
            typical=(1e-05, 0.001),
            scale=_over_the_range,
        ),
    ),
    channel=_warming,
    any_of=_TEMPERATURES,
    on_channel=ChannelFacts(where=("output", "cell"), tare="own", by_value=False),
    zero_beside=_any,
    not_correctable="a drift is another one in each test",
    frees_zero=True,
)
