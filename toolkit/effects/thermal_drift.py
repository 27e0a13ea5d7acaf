"""A zero that moves with the temperature."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.effects.effect import Effect, EffectParameter, Values

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from toolkit.effects.signals import Setting


_TEMPERATURES = ("T_CELL", "T_AMBIENT", "T", "T_TREAD")  # the nearest to the cell first


def _warming(y: NDArray[np.float64], values: Values, setting: Setting) -> NDArray[np.float64]:
    name = next((one for one in _TEMPERATURES if one in setting.channels), None)
    if name is None or not len(y):
        return y
    temperature = setting.channels[name]
    return y + values["coefficient"] * (temperature - setting.first.get(name, float(temperature[0])))


EFFECT = Effect(
    name="thermal_drift",
    stage="load_cells",
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
            relative=True,
        ),
    ),
    channel=_warming,
    any_of=_TEMPERATURES,
)
