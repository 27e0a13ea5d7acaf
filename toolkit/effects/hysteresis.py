"""Hysteresis: rising and falling loads read differently, at any rate."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.effects.effect import Effect, EffectParameter, Values
from toolkit.effects.filters import play

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from toolkit.effects.signals import Setting


def _looping(y: NDArray[np.float64], values: Values, setting: Setting) -> NDArray[np.float64]:
    return play(y, values["width"])


EFFECT = Effect(
    name="hysteresis",
    stage="load_cells",
    statement="The channel reads differently on the way up and on the way down.",
    equation="y = play(y_model, width)",
    reference="Brokate and Sprekels, Hysteresis and Phase Transitions, 1996, ch. 2",
    signature="a loop over the channel's own value that does not depend on the rate",
    separates="load up and down at two rates",
    parameters=(
        EffectParameter(
            name="width",
            unit="{channel}",
            text="full height of the loop",
            typical=(0.002, 0.1),
            relative=True,
            bounds=(0.0, float("inf")),
        ),
    ),
    channel=_looping,
)
