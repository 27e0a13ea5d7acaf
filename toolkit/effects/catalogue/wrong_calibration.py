"""Another record than the one that is named."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.effects.effect import Effect
from toolkit.effects.facts import Alike, ChannelFacts, Values, everywhere

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.effects.signals import Setting


def _other(y: Array, values: Values, setting: Setting) -> Array:
    source = setting.channels.get("from")
    return y if source is None else source


EFFECT = Effect(
    name="wrong_calibration",
    stage="acquisition",
    rank=4,
    in_time=False,
    statement="The values were computed with another calibration record than the one named.",
    equation="y = coefficients of another record on the same indications",
    reference="metrology of this laboratory: the registry",
    signature="an exact linear combination of the indications",
    separates="the record that the acquisition program was given",
    parameters=(),
    channel=_other,
    on_channel=ChannelFacts(where=(), tare="own", by_value=False, second="record"),
    discrete=True,
    not_correctable="the right record computes the test: toolkit process --calibration",
    alike=Alike(group="terms of a record", holds=everywhere),
)
