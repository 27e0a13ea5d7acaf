"""A constant force that the equation of motion lacks."""

from __future__ import annotations

from toolkit.effects.effect import ANY_OTHER, Effect, EffectParameter
from toolkit.effects.facts import Term, Values
from toolkit.effects.surroundings import of_force


def _resisting(position: float, velocity: float, values: Values) -> float:
    return -values["force"]


EFFECT = Effect(
    name="constant_force",
    stage="dynamics",
    rank=1,
    in_time=False,
    statement="A constant force is missing in the equation of motion.",
    equation="m a = ... + force",
    reference="Armstrong-Helouvry, Control of Machines with Friction, 1991",
    signature="the same at every speed and place",
    separates="the same motion in the other direction",
    parameters=(
        EffectParameter(
            name="force", unit="{force}", text="that acts all the time", typical=(0.01, 1.0), scale=of_force
        ),
    ),
    confined_by=(ANY_OTHER,),
    term=Term(of="nothing", force=_resisting, drives=True),
)
