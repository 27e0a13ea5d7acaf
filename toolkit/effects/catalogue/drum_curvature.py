"""Curvature of the drum: its contact patch is shorter than on a flat road."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import Values

if TYPE_CHECKING:
    from toolkit.effects.signals import Drive, Setting, Tire
    from toolkit.effects.surroundings import Surroundings

_EXPONENT = "moment_exponent"
_OF_A_BRUSH = 1.5  # force as the patch length squared, moment as its cube


def _curved(drive: Drive, values: Values, setting: Setting, tire: Tire) -> Drive:
    ratio = max(1 - values["reduction"], 0.01)
    # The moment's slope is force times trail: what the exponent has above one is the trail's.
    trail = drive.trail * ratio ** (values.get(_EXPONENT, _OF_A_BRUSH) - 1)
    return dataclasses.replace(drive, stiffness=drive.stiffness * ratio, trail=trail)


def _without_moment(case: Surroundings) -> bool:
    return "MZ" not in case.outputs


EFFECT = Effect(
    name="drum_curvature",
    stage="road",
    rank=1,
    in_time=False,
    statement=(
        "The road is a drum: the shorter contact patch lowers the slopes, the moment's more than the force's."
    ),
    equation=(
        "stiffness in proportion to 1 - reduction (patch length squared); moment's slope to (1 - "
        "reduction)^moment_exponent (1.5 of a brush: patch length cubed)"
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
            text="reduction of the cornering stiffness; negative inside a drum: a longer patch",
            typical=(0.03, 0.25),
            bounds=(-0.5, 0.9),
        ),
        EffectParameter(
            name=_EXPONENT,
            unit="1",
            text="by which the moment's slope falls with the force's; a soft carcass has more than a brush",
            typical=(1.4, 1.9),
            off=None,
            starts=(_OF_A_BRUSH,),
            bounds=(0.5, 3.0),
            absent=_OF_A_BRUSH,
            needless=_without_moment,
        ),
    ),
    drive=_curved,
    form_error=0.1,  # one factor and one exponent, beside bristles on a carcass
    size_error=0.03,  # tires of bristles on drums of 3 and 8.5 m: the factor was 0.3 to 2.8 % off
)
