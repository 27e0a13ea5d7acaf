"""Viscous damping: a force against the motion in proportion to the velocity."""

from __future__ import annotations

from toolkit.effects.effect import Effect, EffectParameter, Values


def _resisting(position: float, velocity: float, values: Values) -> float:
    return values["viscous"] * velocity


EFFECT = Effect(
    name="viscous_damping",
    stage="dynamics",
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
            relative=True,
            bounds=(0.0, float("inf")),
        ),
    ),
    force=_resisting,
)
