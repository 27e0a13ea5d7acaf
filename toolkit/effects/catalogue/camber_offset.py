"""Camber error of the wheel: the carriage holds it at an inclination that nobody recorded."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import Alike, Values, mounted_one_way

if TYPE_CHECKING:
    from toolkit.effects.signals import Drive, Setting, Tire


def _tilted(drive: Drive, values: Values, setting: Setting, tire: Tire) -> Drive:
    return dataclasses.replace(drive, IA=drive.IA + np.deg2rad(values["angle"]))


EFFECT = Effect(
    name="camber_offset",
    stage="carriage",
    rank=2,
    in_time=False,
    statement="The wheel stands at a camber angle that the simulation does not have.",
    equation="gamma = IA + angle",
    reference="Pacejka, Tire and Vehicle Dynamics, 3rd ed. 2012, 4.3.2",
    signature="a lateral force that is even in the slip angle and grows with load",
    separates="the tire turned round on the hub: conicity changes its sign, camber does not",
    parameters=(
        EffectParameter(
            name="angle", unit="deg", text="inclination beyond the recorded one", typical=(0.05, 1.0)
        ),
    ),
    drive=_tilted,
    needs_tire="camber",
    alike=Alike(group="pull", holds=mounted_one_way),
)
