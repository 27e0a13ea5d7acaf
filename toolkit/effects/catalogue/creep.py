"""Creep: the indication goes on after a load step."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import ChannelFacts, History, Values
from toolkit.effects.filters import PAST, begun, lag

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.effects.signals import Setting

FROM_REST = "_from_rest"
"""Among the values: each run's first load came on an unloaded channel; without it, it had long been there."""


def _creeping(y: Array, values: Values, setting: Setting) -> Array:
    start = begun(y, values)
    if values.get(FROM_REST):
        start = values.get(PAST, 0.0) * float(np.ptp(y)) if len(y) else 0.0
    return y + values["fraction"] * lag(setting.t, y, values["time_constant"], start)


EFFECT = Effect(
    name="creep",
    stage="load_cells",
    rank=4,
    in_time=True,
    statement="The indication goes on creeping after the load has settled.",
    equation="y = y_model + fraction * lag(y_model, time_constant)",
    reference="OIML R 60, 5.3.1",
    signature="slow at constant load, in proportion to the load",
    separates="a load that is held for half an hour",
    parameters=(
        EffectParameter(
            name="fraction",
            unit="1",
            text="of the load, that creeps",
            typical=(0.0002, 0.02),
            bounds=(-0.02, 0.9),  # against the load only as far as a gauge over-compensates its element
        ),
        EffectParameter(
            name="time_constant",
            unit="s",
            text="of the creep",
            typical=(5.0, 300.0),
            off=None,
            bounds=(0.05, 5000.0),
            starts=(3.0, 20.0, 120.0),
        ),
    ),
    channel=_creeping,
    remembers=True,
    on_channel=ChannelFacts(where=("output", "cell"), tare="own", by_value=True, about_zero=True),
    histories=(History(values={FROM_REST: 1.0}, text="unloaded before each run"),),
)
