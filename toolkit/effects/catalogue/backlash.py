"""Backlash of rack and pinion: the wheel follows the encoder only at the ends of a gap."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import Values
from toolkit.effects.filters import PAST, play

if TYPE_CHECKING:
    from toolkit.effects.signals import Drive, Setting, Tire


def _followed(drive: Drive, values: Values, setting: Setting, tire: Tire) -> Drive:
    return dataclasses.replace(drive, SA=play(drive.SA, np.deg2rad(values["gap"]), values.get(PAST, 0.0)))


EFFECT = Effect(
    name="backlash",
    stage="carriage",
    rank=4,
    in_time=False,
    statement="The steering has play: the wheel follows the encoder only at the ends of a gap.",
    equation="alpha = play(SA, gap)",
    reference=(
        "Tao and Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities, 1996"
    ),
    signature="a loop over the slip angle that does not depend on the steering rate",
    separates=("a second steering rate: the loop of a lag grows with the rate, the loop of a gap does not"),
    parameters=(
        EffectParameter(
            name="gap", unit="deg", text="full width of the gap", typical=(0.05, 0.5), bounds=(0.0, 5.0)
        ),
    ),
    drive=_followed,
    remembers=True,
    reshapes=True,
)
