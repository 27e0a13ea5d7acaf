"""A force that repeats with the position: cogging, a screw's pitch."""

from __future__ import annotations

import math

from toolkit.effects.effect import Effect, EffectParameter, Values


def _resisting(position: float, velocity: float, values: Values) -> float:
    return -values["amplitude"] * math.sin(
        2 * math.pi * position / values["period"] + math.radians(values["phase"])
    )


EFFECT = Effect(
    name="periodic_ripple",
    stage="dynamics",
    statement="A force that repeats with the position is missing.",
    equation="m a = ... + amplitude * sin(2 pi x/period + phase)",
    reference="Armstrong-Helouvry, 1991",
    signature="lines over the position, not over time",
    separates="slow motion over several periods",
    parameters=(
        EffectParameter(
            name="amplitude",
            unit="{force}",
            text="of the ripple",
            typical=(0.01, 1.0),
            relative=True,
            bounds=(0.0, float("inf")),
        ),
        EffectParameter(
            name="period",
            unit="{position}",
            text="of the ripple",
            typical=(0.02, 1.0),
            off=None,
            relative=True,
            bounds=(0.0, float("inf")),
        ),
        EffectParameter(
            name="phase",
            unit="deg",
            text="at position zero",
            typical=(-180.0, 180.0),
            off=None,
            phase_of="amplitude",
        ),
    ),
    force=_resisting,
)
