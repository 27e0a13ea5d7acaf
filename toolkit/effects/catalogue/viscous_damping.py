"""Viscous damping: a force against the motion in proportion to the velocity."""

from __future__ import annotations

from toolkit.effects.effect import ANY_OTHER, Effect, EffectParameter
from toolkit.effects.facts import Term, Values
from toolkit.effects.surroundings import Surroundings


def _resisting(position: float, velocity: float, values: Values) -> float:
    return values["viscous"] * velocity


def _at_the_fastest(case: Surroundings) -> float:
    return case.motion.force / case.motion.fastest


EFFECT = Effect(
    name="viscous_damping",
    stage="dynamics",
    rank=3,
    in_time=False,
    statement="Viscous damping is missing: a force in proportion to the velocity.",
    equation="m a = ... - viscous * v",
    reference="Armstrong-Helouvry, 1991",
    signature="in proportion to the velocity",
    separates="steady motion at three speeds",
    parameters=(
        EffectParameter(
            name="viscous",
            unit="{force}/({velocity})",
            text="force for each unit of velocity",
            typical=(0.01, 1.0),
            scale=_at_the_fastest,
            bounds=(0.0, float("inf")),
        ),
    ),
    confined_by=(ANY_OTHER,),
    term=Term(of="velocity", force=_resisting),
    form_error=0.03,
)
