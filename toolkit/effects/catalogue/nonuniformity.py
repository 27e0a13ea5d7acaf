"""A force that is locked to the tire's revolution, first and second harmonic."""

from __future__ import annotations

from toolkit.effects.effect import Effect
from toolkit.effects.facts import ChannelFacts
from toolkit.effects.revolution import PARAMETERS, harmonics

EFFECT = Effect(
    name="nonuniformity",
    stage="tire",
    rank=10,
    in_time=False,
    statement="The tire is not uniform: a force repeats with each revolution of the tire.",
    equation="y = y_model + sum A_n cos(n*angle + phase_n)",
    reference="Pottinger, in: The Pneumatic Tire, NHTSA 2005, ch. 9",
    signature=("lines at the tire's revolution and its harmonics, locked to its angle and not to time"),
    separates="the tire's angle, and a second speed",
    parameters=PARAMETERS,
    channel=harmonics("TIRE_ANGLE", "tire_angle"),
    any_of=("TIRE_ANGLE", "tire_angle"),
    on_channel=ChannelFacts(where=("output",), tare="own", by_value=False, usual="FY"),
)
