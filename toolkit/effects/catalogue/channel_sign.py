"""A channel with the wrong sign."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.effects.effect import ANY_OTHER, Effect
from toolkit.effects.facts import Alike, ChannelFacts, Values

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.effects.signals import Setting
    from toolkit.effects.surroundings import Surroundings


def _negated(y: Array, values: Values, setting: Setting) -> Array:
    return -y


def _restored(y: Array, values: Values, setting: Setting) -> Array:
    return -y


def _of_a_cell(case: Surroundings) -> bool:
    return case.channel in case.cells


EFFECT = Effect(
    name="channel_sign",
    stage="acquisition",
    rank=2,
    in_time=False,
    statement="The channel has the wrong sign.",
    equation="y = -y_model",
    reference="the thesis, 4.4",
    signature="a mirror image",
    separates="a known load in a known direction",
    parameters=(),
    channel=_negated,
    confined_by=("date", "rotation", "mounting", ANY_OTHER),
    on_channel=ChannelFacts(
        where=("output", "input", "cell", "program_cell", "program_load"),
        tare="alike",
        by_value=False,
        about_zero=True,
        directed=True,
        inverse=_restored,
    ),
    discrete=True,
    not_correctable="the right record computes the test: toolkit process --calibration",
    alike=Alike(group="terms of a record", holds=_of_a_cell),
)
