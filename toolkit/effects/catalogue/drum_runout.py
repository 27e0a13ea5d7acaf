"""A force that is locked to the drum's revolution, first and second harmonic."""

from __future__ import annotations

from toolkit.effects.effect import Effect
from toolkit.effects.facts import ChannelFacts
from toolkit.effects.revolution import PARAMETERS, harmonics

EFFECT = Effect(
    name="drum_runout",
    stage="road",
    rank=3,
    in_time=False,
    statement="The drum is not round: a force repeats with each revolution of the drum.",
    equation="y = y_model + sum A_n cos(n*angle + phase_n)",
    reference="Pottinger, in: The Pneumatic Tire, NHTSA 2005, ch. 9",
    signature=("lines at the drum's revolution and its harmonics, locked to its angle and not to time"),
    separates="the drum's angle, and a second speed",
    parameters=PARAMETERS,
    channel=harmonics("DRUM_ANGLE", "drum_angle"),
    any_of=("DRUM_ANGLE", "drum_angle"),
    on_channel=ChannelFacts(where=("output",), tare="own", by_value=False, usual="FZ"),
)
