"""Non-linearity of the indication."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.effects.effect import Effect, EffectParameter, Values

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from toolkit.effects.signals import Setting


def _bent(y: NDArray[np.float64], values: Values, setting: Setting) -> NDArray[np.float64]:
    return y + values["quadratic"] * y**2 + values["cubic"] * y**3


EFFECT = Effect(
    name="nonlinearity",
    stage="load_cells",
    statement="The channel is not linear in its load.",
    equation="y = y_model + quadratic * y_model^2 + cubic * y_model^3",
    reference="ASTM E74; ISO 376",
    signature="a residual that bends with the channel's own value and repeats",
    separates="more load steps in the calibration",
    parameters=(
        EffectParameter(
            name="quadratic", unit="1/{channel}", text="of the square", typical=(0.001, 0.05), relative=True
        ),
        EffectParameter(
            name="cubic", unit="1/{channel}^2", text="of the cube", typical=(0.001, 0.05), relative=True
        ),
    ),
    channel=_bent,
)
