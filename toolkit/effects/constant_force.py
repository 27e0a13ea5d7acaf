"""A constant force that the equation of motion lacks."""

from __future__ import annotations

from toolkit.effects.effect import Effect, EffectParameter, Values


def _resisting(position: float, velocity: float, values: Values) -> float:
    return -values["force"]


EFFECT = Effect(
    name="constant_force",
    stage="dynamics",
    statement="A constant force is missing in the equation of motion.",
    equation="m a = ... + force",
    reference="Armstrong-Helouvry, Control of Machines with Friction, 1991",
    signature="the same at every speed and place",
    separates="the same motion in the other direction",
    parameters=(
        EffectParameter(
            name="force", unit="{force}", text="that acts all the time", typical=(0.01, 1.0), relative=True
        ),
    ),
    force=_resisting,
)
