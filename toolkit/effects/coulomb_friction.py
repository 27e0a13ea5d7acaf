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
    # Dahl's bristle along a velocity that is linear between rows: z tends to sign(v) with the distance
    # travelled. An interval in which the velocity changes its sign is two: before the reversal and after.
    reach = max(values["presliding"], 0.0)
    if reach <= 0 or len(t) < 2:
        return values["coulomb"] * np.sign(velocity)
    v, w, h = velocity[:-1], velocity[1:], np.diff(t)
    turns = v * w < 0
    share = np.where(turns, v / np.where(turns, v - w, 1.0), 1.0)
    first = np.where(turns, 0.5 * np.abs(v) * share, 0.5 * np.abs(v + w)) * h
    second = np.where(turns, 0.5 * np.abs(w) * (1 - share), 0.0) * h
    ways = np.sign(np.where(turns, v, v + w))
    made = np.empty_like(velocity)
    made[0] = last = float(np.sign(velocity[0]))
    steps = zip(
        ways.tolist(), np.exp(-first / reach).tolist(), np.exp(-second / reach).tolist(), turns.tolist(),
        strict=True,
    )  # fmt: skip
    for i, (way, keep, keep_on, turned) in enumerate(steps, start=1):
        last = way + (last - way) * keep
        if turned:
            last = -way + (last + way) * keep_on
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
            text="distance over which the friction builds up after a reversal",
            typical=(0.2, 2.0),
            off=None,
            relative=True,
            bounds=(0.0, float("inf")),
            starts=(0.01, 0.2, 2.0),
        ),
    ),
    force=_resisting,
    recorded=_recorded,
)
