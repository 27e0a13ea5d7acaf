"""What imitates physics without being any: noise in the recorded slip angle, which every lag smooths away.

A simulation that is driven by a noisy channel carries that noise into its outputs. A lag on the channel then
improves the fit, by its smoothing and not by its delay. Smoothing that looks both ways improves it too, and
delays nothing: it is searched beside the effects, kept in the fits where it wins, and never named.
"""

from __future__ import annotations

import dataclasses

from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import Values
from toolkit.effects.filters import lag
from toolkit.effects.signals import Drive, Setting, Tire


def _smoothed(drive: Drive, values: Values, setting: Setting, tire: Tire) -> Drive:
    del setting, tire
    tau = max(values["time_constant"], 0.0)
    forward = lag(drive.t, drive.SA, tau)
    there_and_back = lag(-drive.t[::-1], forward[::-1], tau)[::-1]
    return dataclasses.replace(drive, SA=there_and_back)


INPUT_NOISE = Effect(
    name="input_noise",
    stage="carriage",
    rank=0,
    in_time=True,
    nuisance=True,
    statement="The recorded slip angle is noisy; the wheel's own is smoother.",
    equation="SA smoothed forward and backward by one time constant",
    reference="Rauch, Tung and Striebel, AIAA J. 3 (1965)",
    signature="a gain from smoothing alone, without delay",
    separates="",
    parameters=(
        EffectParameter(
            name="time_constant",
            unit="s",
            text="of the smoothing, each way",
            typical=(0.005, 0.2),
            bounds=(0.0, 10.0),
            starts=(0.01, 0.05, 0.2),
        ),
    ),
    drive=_smoothed,
)
