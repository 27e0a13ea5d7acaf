"""Drag in proportion to the square of the velocity."""

from __future__ import annotations

from toolkit.effects.effect import ANY_OTHER, Effect, EffectParameter
from toolkit.effects.facts import Term, Values
from toolkit.effects.surroundings import Surroundings


def _resisting(position: float, velocity: float, values: Values) -> float:
    return values["drag"] * velocity * abs(velocity)


def _at_the_fastest(case: Surroundings) -> float:
    return case.motion.force / case.motion.fastest**2


EFFECT = Effect(
    name="quadratic_drag",
    stage="dynamics",
    rank=4,
    in_time=False,
    statement="Drag is missing: a force with the square of the velocity.",
    equation="m a = ... - drag * v|v|",
    reference="Batchelor, An Introduction to Fluid Dynamics, 1967, 5.11",
    signature="grows with the square of the speed",
    separates="steady motion at three speeds",
    parameters=(
        EffectParameter(
            name="drag",
            unit="{force}/({velocity})^2",
            text="force for each unit of velocity squared",
            typical=(0.01, 1.0),
            scale=_at_the_fastest,
            bounds=(0.0, float("inf")),
        ),
    ),
    confined_by=(ANY_OTHER,),
    term=Term(of="velocity", force=_resisting),
    form_error=0.03,
)
