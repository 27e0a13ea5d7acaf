"""Another record than the one that is named."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.effects.effect import Effect, Values

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from toolkit.effects.signals import Setting


def _other(y: NDArray[np.float64], values: Values, setting: Setting) -> NDArray[np.float64]:
    source = setting.channels.get("from")
    return y if source is None else source


EFFECT = Effect(
    name="wrong_calibration",
    stage="acquisition",
    statement="The values were computed with another calibration record than the one named.",
    equation="y = coefficients of another record on the same indications",
    reference="metrology of this laboratory: the registry",
    signature="an exact linear combination of the indications",
    separates="the record that the acquisition program was given",
    parameters=(),
    channel=_other,
)
