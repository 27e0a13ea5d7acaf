"""Dry friction: one size, against the motion; after a reversal it builds up over a presliding distance."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from toolkit.effects.effect import Effect, EffectParameter, Values

if TYPE_CHECKING:
    from numpy.typing import NDArray


def _resisting(position: float, velocity: float, values: Values) -> float:
    # Smooth within a thousandth of the velocity's spread, so that a solver can meet its tolerance.
    return values["coulomb"] * math.tanh(velocity / values.get("smooth", 1e-4))


def _recorded(t: NDArray[np.float64], velocity: NDArray[np.float64], values: Values) -> NDArray[np.float64]:
    # Dahl's bristle, exact for a velocity that is constant between rows: z tends to distance * sign(v).
    distance = max(values["presliding"], 0.0)
    if distance <= 0 or len(t) < 2:
        return values["coulomb"] * np.sign(velocity)
    middle = 0.5 * (velocity[1:] + velocity[:-1])
    decay = np.exp(-np.abs(middle) * np.diff(t) / distance)
    made = np.empty_like(velocity)
    made[0] = last = float(np.sign(velocity[0]))
    for i, (keep, way) in enumerate(zip(decay.tolist(), np.sign(middle).tolist(), strict=True), start=1):
        last = way + (last - way) * keep
        made[i] = last
    return values["coulomb"] * made


EFFECT = Effect(
    name="coulomb_friction",
    stage="dynamics",
    statement="Dry friction is missing: a force of one size against the motion.",
    equation="m a = ... - coulomb * z, z' = (v - |v| z)/presliding: sign(v) after a presliding distance",
    reference="Dahl, AIAA J. 14 (1976); Armstrong-Helouvry, Control of Machines with Friction, 1991",
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
        EffectParameter(
            name="presliding",
            unit="{position}",
            text="distance over which the friction builds up after a reversal, in a recorded motion",
            typical=(0.2, 2.0),
            off=None,
            relative=True,
            bounds=(0.0, float("inf")),
            starts=(0.2, 2.0),
        ),
    ),
    force=_resisting,
    recorded=_recorded,
)
