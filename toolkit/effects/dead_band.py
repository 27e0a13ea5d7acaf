"""A channel that reads nothing of small loads."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from toolkit.effects.effect import Effect, EffectParameter, Values

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.effects.signals import Setting


def _dead(y: NDArray[np.float64], values: Values, setting: Setting) -> NDArray[np.float64]:
    half = 0.5 * abs(values["width"])
    return np.sign(y) * np.maximum(np.abs(y) - half, 0.0)


EFFECT = Effect(
    name="dead_band",
    stage="acquisition",
    statement="The channel reads nothing of small loads.",
    equation="y = sign(y_model) * max(|y_model| - width/2, 0)",
    reference="Tao and Kokotovic, 1996",
    signature="flat about zero, shifted outside",
    separates="small loads of both signs",
    parameters=(
        EffectParameter(
            name="width",
            unit="{channel}",
            text="full width of the band",
            typical=(0.02, 0.3),
            relative=True,
            bounds=(0.0, float("inf")),
            starts=(0.05, 0.2),
        ),
    ),
    channel=_dead,
)
