"""Crosstalk: a second load shows in the channel."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.effects.effect import Effect, EffectParameter, Values

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from toolkit.effects.signals import Setting


def _leaking(y: NDArray[np.float64], values: Values, setting: Setting) -> NDArray[np.float64]:
    source = setting.channels.get("from")
    return y if source is None else y + values["coefficient"] * source


EFFECT = Effect(
    name="crosstalk",
    stage="load_cells",
    statement="Another load shows in this channel.",
    equation="y = y_model + coefficient * other",
    reference="Bray, Barbato, Levi, Theory and Practice of Force Measurement, 1990",
    signature="in proportion to another channel, unchanged when the drum is reversed",
    separates="the other load alone, and the tire turned round on the hub",
    parameters=(
        EffectParameter(
            name="coefficient",
            unit="{channel}/({from})",
            text="of the other channel",
            typical=(0.002, 0.05),
            relative=True,
        ),
    ),
    channel=_leaking,
)
