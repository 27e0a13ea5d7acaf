"""Curvature of the drum: its contact patch is shorter than on a flat road."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from toolkit.effects.effect import Effect, EffectParameter, Values

if TYPE_CHECKING:
    from toolkit.effects.signals import Drive, Setting, Tire


def _curved(drive: Drive, values: Values, setting: Setting, tire: Tire) -> Drive:
    left = max(1 - values["reduction"], 0.01)
    # Slope of the force as the patch length squared, of the moment as its cube.
    return dataclasses.replace(drive, stiffness=drive.stiffness * left, trail=drive.trail * np.sqrt(left))


EFFECT = Effect(
    name="drum_curvature",
    stage="road",
    statement=(
        "The road is a drum: the shorter contact patch lowers the slopes, the moment's more than the force's."
    ),
    equation=(
        "stiffness = 1 - reduction (patch length squared); moment's slope in proportion to (1 "
        "- reduction)^1.5"
    ),
    reference=(
        "Pacejka, Tire and Vehicle Dynamics, 3rd ed. 2012, 3.2; contact length factor sqrt(Rd/(Rd+Rt))"
    ),
    signature=("scales slopes at small angles, MZ more than FY; not the peak; no sign or time dependence"),
    separates="the same tire on a flat track, or on a drum of another radius",
    parameters=(
        EffectParameter(
            name="reduction",
            unit="1",
            text="reduction of the cornering stiffness",
            typical=(0.03, 0.25),
            bounds=(-0.5, 0.9),
        ),
    ),
    drive=_curved,
)
