"""A channel with the wrong sign."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.effects.effect import ANY_OTHER, Effect, Values

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from toolkit.effects.signals import Setting


def _negated(y: NDArray[np.float64], values: Values, setting: Setting) -> NDArray[np.float64]:
    return -y


EFFECT = Effect(
    name="channel_sign",
    stage="acquisition",
    statement="The channel has the wrong sign.",
    equation="y = -y_model",
    reference="the thesis, 4.4",
    signature="a mirror image",
    separates="a known load in a known direction",
    parameters=(),
    channel=_negated,
    confined_by=("date", "rotation", "mounting", ANY_OTHER),
)
