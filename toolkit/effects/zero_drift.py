"""A zero that drifts with time."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.effects.effect import Effect, EffectParameter, Values

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from toolkit.effects.signals import Setting


def _drifting(y: NDArray[np.float64], values: Values, setting: Setting) -> NDArray[np.float64]:
    return y + values["rate"] * setting.elapsed_s / 60.0


EFFECT = Effect(
    name="zero_drift",
    stage="load_cells",
    statement="The channel's zero drifts steadily with time.",
    equation="y = y_model + rate * t",
    reference="JCGM 200:2012, 4.21",
    signature="linear in time, the same at every load",
    separates="tare before and after, and the first condition repeated at the end",
    parameters=(
        EffectParameter(
            name="rate", unit="{channel}/min", text="drift of the zero", typical=(0.0001, 0.01), relative=True
        ),
    ),
    channel=_drifting,
)
