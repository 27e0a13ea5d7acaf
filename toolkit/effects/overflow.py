"""A state that cannot rise beyond a level: a tank that runs over."""

from __future__ import annotations

from toolkit.effects.effect import Effect, EffectParameter, Values


def _resisting(position: float, velocity: float, values: Values) -> float:
    return 0.0


EFFECT = Effect(
    name="overflow",
    stage="dynamics",
    statement="The state runs over: beyond a level it cannot rise.",
    equation="x' = min(x', 0) where x >= level",
    reference="mass balance of an open tank",
    signature="flat tops while the input goes on",
    separates="a run that stays below the level",
    parameters=(
        EffectParameter(
            name="level",
            unit="{position}",
            text="that the state cannot pass",
            typical=(0.5, 0.98),
            off=float("inf"),
            relative=True,
            starts=(0.4, 0.5, 0.6, 0.68, 0.76, 0.84, 0.9, 0.95),
        ),
    ),
    force=_resisting,
)
