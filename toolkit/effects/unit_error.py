"""Another unit than the stated one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.effects.effect import Effect, EffectParameter, Values

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from toolkit.effects.signals import Setting


# Units that files of this field mix up: pound-force, kilogram-force, foot-pound, degree, kilo, inch.
FACTORS = {
    "N read as lbf": 4.4482216152605,
    "lbf read as N": 1 / 4.4482216152605,
    "N read as kgf": 9.80665,
    "kgf read as N": 1 / 9.80665,
    "N*m read as lbf*ft": 1.3558179483314,
    "lbf*ft read as N*m": 1 / 1.3558179483314,
    "N*m read as lbf*in": 0.1129848290276,
    "lbf*in read as N*m": 1 / 0.1129848290276,
    "deg read as rad": 57.29577951308232,
    "rad read as deg": 1 / 57.29577951308232,
    "kilo": 1000.0,
    "milli": 0.001,
    "km/h read as m/s": 3.6,
    "m/s read as km/h": 1 / 3.6,
    "mm read as inch": 25.4,
    "inch read as mm": 1 / 25.4,
}


def _converted(y: NDArray[np.float64], values: Values, setting: Setting) -> NDArray[np.float64]:
    return y * values["factor"]


EFFECT = Effect(
    name="unit_error",
    stage="acquisition",
    statement="The channel is in another unit than the stated one.",
    equation="y = factor * y_model",
    reference="NIST SP 811",
    signature="one factor that is a ratio of two units",
    separates="the unit printed beside a known load",
    parameters=(
        EffectParameter(
            name="factor",
            unit="1",
            text="channel over its true value",
            typical=(0.1, 10.0),
            off=1.0,
            starts=tuple(FACTORS.values()),
        ),
    ),
    channel=_converted,
)
