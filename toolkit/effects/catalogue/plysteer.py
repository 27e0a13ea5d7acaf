"""Plysteer: the belt's plies pull as if the wheel were steered."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import Alike, Values, everywhere

if TYPE_CHECKING:
    from toolkit.effects.signals import Drive, Setting, Tire


def _pulled(drive: Drive, values: Values, setting: Setting, tire: Tire) -> Drive:
    return dataclasses.replace(drive, SA=drive.SA + np.deg2rad(values["pseudo_slip_angle"]))


def _offset(pseudo_slip_angle: float, nominal_load_N: float | None) -> float:
    # alpha = SA + pseudo_slip_angle is alpha = SA - offset with the other sign.
    return -pseudo_slip_angle


EFFECT = Effect(
    name="plysteer",
    stage="tire",
    rank=5,
    in_time=False,
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
            sense=("SA", "SAE"),
        ),
    ),
    drive=_pulled,
    alike=Alike(group="zero of the slip angle", holds=everywhere, size=_offset),
)
