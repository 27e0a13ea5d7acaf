"""Load-dependent friction: the peak grows less than the load."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import Values

if TYPE_CHECKING:
    from toolkit.effects.signals import Drive, Setting, Tire
    from toolkit.effects.surroundings import Surroundings


def _loaded(drive: Drive, values: Values, setting: Setting, tire: Tire) -> Drive:
    change = drive.FZ / (values.get("reference", 1.0) * setting.nominal_load_N) - 1
    return dataclasses.replace(
        drive, friction=drive.friction * np.maximum(1 + values["sensitivity"] * change, 0.05)
    )


def _stated(case: Surroundings) -> bool:
    # Not every simulation tells at which load its friction was right; a tire's own file does.
    return case.nominal_load_N is not None


EFFECT = Effect(
    name="load_friction",
    stage="tire",
    rank=7,
    in_time=False,
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
        EffectParameter(
            name="reference",
            unit="1",
            text="load at which the friction is the simulation's, over the nominal load",
            typical=(0.7, 1.4),
            off=None,
            bounds=(0.2, 5.0),
            starts=(1.0,),
            absent=1.0,
            needless=_stated,
            equation_without="friction = 1 + sensitivity * (FZ - FZ0)/FZ0, FZ0 the nominal load",
        ),
    ),
    drive=_loaded,
    form_error=0.03,
)
