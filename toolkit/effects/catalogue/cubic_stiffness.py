"""A spring that hardens with the cube of the deflection."""

from __future__ import annotations

from toolkit.effects.effect import ANY_OTHER, Effect, EffectParameter
from toolkit.effects.facts import Term, Values
from toolkit.effects.surroundings import Surroundings


def _resisting(position: float, velocity: float, values: Values) -> float:
    return values["k3"] * position**3


def _at_the_farthest(case: Surroundings) -> float:
    # Not at its spread: the cube of three of them would be another motion.
    return case.motion.force / case.motion.farthest**3


EFFECT = Effect(
    name="cubic_stiffness",
    stage="dynamics",
    rank=5,
    in_time=False,
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
            scale=_at_the_farthest,
        ),
    ),
    confined_by=(ANY_OTHER,),
    term=Term(of="position", force=_resisting, on_place=True),
    form_error=0.03,
)
