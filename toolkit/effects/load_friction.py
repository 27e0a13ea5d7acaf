"""Load-dependent friction: the peak grows less than the load."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from toolkit.effects.effect import Effect, EffectParameter, Values

if TYPE_CHECKING:
    from toolkit.effects.signals import Drive, Setting, Tire


def _loaded(drive: Drive, values: Values, setting: Setting, tire: Tire) -> Drive:
    change = drive.FZ / (values.get("reference", 1.0) * setting.nominal_load_N) - 1
    return dataclasses.replace(
        drive, friction=drive.friction * np.maximum(1 + values["sensitivity"] * change, 0.05)
    )


EFFECT = Effect(
    name="load_friction",
    stage="tire",
    statement="The tire's friction falls with load.",
    equation="friction = 1 + sensitivity * (FZ - F0)/F0, F0 = reference * nominal load",
    reference="Pacejka, Tire and Vehicle Dynamics, 3rd ed. 2012, 4.E23 (PDY2)",
    signature="the peak over the load falls with load",
    separates="slip angles beyond the peak at more loads",
    parameters=(
        EffectParameter(
            name="sensitivity",
            unit="1",
            text="relative change of the friction for each dfz",
            typical=(-0.3, -0.02),
        ),
        # Not every simulation tells at which load its friction was right.
        EffectParameter(
            name="reference",
            unit="1",
            text="load at which the friction is the simulation's, over the nominal load",
            typical=(0.7, 1.4),
            off=None,
            bounds=(0.2, 5.0),
            starts=(1.0,),
            absent=1.0,
        ),
    ),
    drive=_loaded,
)
