"""A sensitivity that is not the calibrated one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.effects.effect import ANY_OTHER, Effect, EffectParameter
from toolkit.effects.facts import ChannelFacts, Values

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.effects.signals import Setting


def _scaled(y: Array, values: Values, setting: Setting) -> Array:
    return y * (1 + values["gain_error"])


def _restored(y: Array, values: Values, setting: Setting) -> Array:
    return y / (1 + values["gain_error"])


EFFECT = Effect(
    name="sensitivity_error",
    stage="load_cells",
    rank=8,
    in_time=False,
    statement="The channel's sensitivity is not the calibrated one.",
    equation="y = y_model * (1 + gain_error)",
    reference="JCGM 200:2012, 4.12",
    signature="in proportion to the channel's own value",
    separates="a check load",
    parameters=(
        EffectParameter(
            name="gain_error",
            unit="1",
            text="relative error, 0.02 for 2 %",
            typical=(0.002, 0.1),
            bounds=(-0.6, 1.0),
        ),
    ),
    channel=_scaled,
    confined_by=("date", ANY_OTHER),
    on_channel=ChannelFacts(
        where=("output", "input", "cell", "program_cell", "program_load"),
        tare="alike",
        by_value=True,
        about_zero=True,
        inverse=_restored,
        proportion=1.0,
    ),
    not_correctable="a cell's sensitivity belongs into a new calibration",
)
