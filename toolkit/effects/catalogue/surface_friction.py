"""Friction of the surface: another road scales the peak, and the slope where adhesion ends early."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import Values

if TYPE_CHECKING:
    from toolkit.effects.signals import Drive, Setting, Tire


def _gripping(drive: Drive, values: Values, setting: Setting, tire: Tire) -> Drive:
    return dataclasses.replace(drive, friction=drive.friction * max(values["mu_factor"], 0.01))


EFFECT = Effect(
    name="surface_friction",
    stage="road",
    rank=2,
    in_time=False,
    statement="The road's friction is another than the simulation's.",
    equation="friction = mu_factor",
    reference="Pacejka, Tire and Vehicle Dynamics, 3rd ed. 2012, 4.E8 (LMUY)",
    signature="scales the peak first, the slope at zero hardly",
    separates="a locked or high-slip run on both surfaces",
    parameters=(
        EffectParameter(
            name="mu_factor",
            unit="1",
            text="friction over the simulation's",
            typical=(0.8, 1.2),
            off=1.0,
            bounds=(0.05, 5.0),
        ),
    ),
    drive=_gripping,
    confined_by=("surface",),
    form_error=0.03,
)
