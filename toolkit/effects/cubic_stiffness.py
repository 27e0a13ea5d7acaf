"""A spring that hardens with the cube of the deflection."""

from __future__ import annotations

from toolkit.effects.effect import Effect, EffectParameter, Values


def _resisting(position: float, velocity: float, values: Values) -> float:
    return values["k3"] * position**3


EFFECT = Effect(
    name="cubic_stiffness",
    stage="dynamics",
    statement="The stiffness is not linear: a cubic term is missing.",
    equation="m a = ... - k3 * x^3",
    reference="Kovacic and Brennan, The Duffing Equation, 2011",
    signature="grows with the cube of the deflection; the frequency depends on the amplitude",
    separates="free motion at two amplitudes",
    parameters=(
        EffectParameter(
            name="k3",
            unit="{force}/({position})^3",
            text="force for each unit of deflection cubed",
            typical=(0.01, 1.0),
            relative=True,
        ),
    ),
    force=_resisting,
)
