"""Dry friction: one size, against the motion."""

from __future__ import annotations

import math

from toolkit.effects.effect import Effect, EffectParameter, Values


def _resisting(position: float, velocity: float, values: Values) -> float:
    # Smooth within a thousandth of the velocity's spread, so that a solver can meet its tolerance.
    return values["coulomb"] * math.tanh(velocity / values.get("smooth", 1e-4))


EFFECT = Effect(
    name="coulomb_friction",
    stage="dynamics",
    statement="Dry friction is missing: a force of one size against the motion.",
    equation="m a = ... - coulomb * sign(v)",
    reference="Armstrong-Helouvry, Control of Machines with Friction, 1991",
    signature="jumps where the velocity changes its sign, and does not grow with speed",
    separates="slow motion in both directions",
    parameters=(
        EffectParameter(
            name="coulomb",
            unit="{force}",
            text="size of the friction",
            typical=(0.01, 1.0),
            relative=True,
            bounds=(0.0, float("inf")),
        ),
    ),
    force=_resisting,
)
