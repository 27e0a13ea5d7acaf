"""Drag in proportion to the square of the velocity."""

from __future__ import annotations

from toolkit.effects.effect import Effect, EffectParameter, Values


def _resisting(position: float, velocity: float, values: Values) -> float:
    return values["drag"] * velocity * abs(velocity)


EFFECT = Effect(
    name="quadratic_drag",
    stage="dynamics",
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
            relative=True,
            bounds=(0.0, float("inf")),
        ),
    ),
    force=_resisting,
)
