"""Plysteer: the belt's plies pull as if the wheel were steered."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from toolkit.effects.effect import Effect, EffectParameter, Values

if TYPE_CHECKING:
    from toolkit.effects.signals import Drive, Setting, Tire


def _pulled(drive: Drive, values: Values, setting: Setting, tire: Tire) -> Drive:
    return dataclasses.replace(drive, SA=drive.SA + np.deg2rad(values["pseudo_slip_angle"]))


EFFECT = Effect(
    name="plysteer",
    stage="tire",
    statement="The belt's plies pull as if the wheel were steered: plysteer is missing.",
    equation="alpha = SA + pseudo_slip_angle",
    reference="Pacejka, Tire and Vehicle Dynamics, 3rd ed. 2012, 4.3.2; SAE J1987",
    signature="FY changes its sign when the drum is reversed, and grows with load",
    separates="a steering zero that is measured apart; the tire turned round on the hub",
    parameters=(
        EffectParameter(
            name="pseudo_slip_angle",
            unit="deg",
            text="slip angle that acts as the plies do",
            typical=(0.02, 0.4),
        ),
    ),
    drive=_pulled,
)
