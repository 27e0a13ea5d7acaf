"""Zero error of the slip-angle sensor: the wheel stands at another angle than the one recorded."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from toolkit.effects.effect import Effect, EffectParameter, Values

if TYPE_CHECKING:
    from toolkit.effects.signals import Drive, Setting, Tire


def _turned(drive: Drive, values: Values, setting: Setting, tire: Tire) -> Drive:
    return dataclasses.replace(drive, SA=drive.SA - np.deg2rad(values["offset"]))


EFFECT = Effect(
    name="steer_offset",
    stage="carriage",
    statement=("The slip angle's zero is off: the wheel stands at another angle than the recorded one."),
    equation="alpha = SA - offset",
    reference="Pacejka, Tire and Vehicle Dynamics, 3rd ed. 2012, 4.3; SAE J1987",
    signature="FY and MZ are shifted by one angle at all loads",
    separates=(
        "a steering zero that is measured with the wheel at rest, or the tire turned round on the hub"
    ),
    parameters=(
        EffectParameter(
            name="offset", unit="deg", text="what the slip-angle sensor shows too much", typical=(0.02, 0.5)
        ),
    ),
    drive=_turned,
)
