"""A force that is locked to the tire's revolution, first and second harmonic."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from toolkit.effects.effect import Effect, EffectParameter, Values

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.effects.signals import Setting


def _ripple(y: NDArray[np.float64], values: Values, setting: Setting) -> NDArray[np.float64]:
    angle = setting.channel("TIRE_ANGLE", "tire_angle")
    if angle is None:
        return y
    made = y
    for n in (1, 2):
        made = made + values[f"amplitude_{n}"] * np.cos(n * angle + np.deg2rad(values[f"phase_{n}"]))
    return made


EFFECT = Effect(
    name="nonuniformity",
    stage="tire",
    statement="The tire is not uniform: a force repeats with each revolution of the tire.",
    equation="y = y_model + sum A_n cos(n*angle + phase_n)",
    reference="Pottinger, in: The Pneumatic Tire, NHTSA 2005, ch. 9",
    signature=("lines at the tire's revolution and its harmonics, locked to its angle and not to time"),
    separates="the tire's angle, and a second speed",
    parameters=(
        EffectParameter(
            name="amplitude_1",
            unit="{channel}",
            text="at one cycle a revolution",
            typical=(20.0, 150.0),
            relative=True,
            bounds=(0.0, float("inf")),
        ),
        EffectParameter(
            name="phase_1",
            unit="deg",
            text="of it",
            typical=(-180.0, 180.0),
            off=None,
            starts=(0.0, 90.0, 180.0, -90.0),
        ),
        EffectParameter(
            name="amplitude_2",
            unit="{channel}",
            text="at two cycles a revolution",
            typical=(0.0, 50.0),
            relative=True,
            bounds=(0.0, float("inf")),
        ),
        EffectParameter(
            name="phase_2",
            unit="deg",
            text="of it",
            typical=(-180.0, 180.0),
            off=None,
            starts=(0.0, 90.0, 180.0, -90.0),
        ),
    ),
    channel=_ripple,
    any_of=("TIRE_ANGLE", "tire_angle"),
)
