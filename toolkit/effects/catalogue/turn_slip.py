"""Turn slip: while the wheel is steered, its patch twists on the road."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import Values

if TYPE_CHECKING:
    from toolkit.effects.signals import Drive, Setting, Tire


def _twisted(drive: Drive, values: Values, setting: Setting, tire: Tire) -> Drive:
    rate = np.gradient(drive.SA, drive.t) if len(drive.t) > 1 else np.zeros_like(drive.SA)
    phi = -rate / np.maximum(np.abs(drive.V), 1e-6)
    # Half a turn about z reverses the travel and FY, and keeps the rate of turn.
    return dataclasses.replace(drive, FY=drive.FY + setting.travel * values["force"] * phi)


EFFECT = Effect(
    name="turn_slip",
    stage="tire",
    rank=11,
    in_time=True,
    statement="While the wheel is being steered its contact patch twists on the road.",
    equation="FY = FY_model + force * phi, phi = -psi'/V",
    reference="Pacejka, Tire and Vehicle Dynamics, 3rd ed. 2012, 4.3.3",
    signature="only while steering, in proportion to the rate over the speed",
    separates="a second steering rate and a second speed",
    parameters=(
        EffectParameter(
            name="force", unit="N*m", text="lateral force for each 1/m of turn slip", typical=(200.0, 5000.0)
        ),
    ),
    drive=_twisted,
    form_error=0.03,
)
