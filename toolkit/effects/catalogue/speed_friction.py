"""Speed-dependent friction: rubber that slides faster grips less."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import Values

if TYPE_CHECKING:
    from toolkit.effects.signals import Drive, Setting, Tire


def _sliding(drive: Drive, values: Values, setting: Setting, tire: Tire) -> Drive:
    speed = np.abs(drive.V * np.sin(drive.SA)) / setting.nominal_speed_m_s
    return dataclasses.replace(
        drive, friction=drive.friction / np.maximum(1 + values["sensitivity"] * speed, 0.05)
    )


EFFECT = Effect(
    name="speed_friction",
    stage="tire",
    rank=8,
    in_time=False,
    statement="Friction depends on the sliding speed.",
    equation="friction = 1/(1 + sensitivity * V|sin(alpha)|/V0)",
    reference="Pacejka, Tire and Vehicle Dynamics, 3rd ed. 2012, 4.E7 (LMUV)",
    signature="at high slip only, and different at another speed",
    separates="a second speed",
    parameters=(
        EffectParameter(
            name="sensitivity",
            unit="1",
            text="fall of the friction at a sliding speed equal to the nominal speed",
            typical=(0.1, 2.0),
        ),
    ),
    drive=_sliding,
    form_error=0.03,
)
