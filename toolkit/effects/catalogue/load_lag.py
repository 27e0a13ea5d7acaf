"""Lag of the load actuator: the load follows its command with a time constant."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import Values
from toolkit.effects.filters import begun, followed

if TYPE_CHECKING:
    from toolkit.effects.signals import Drive, Setting, Tire


def _followed(drive: Drive, values: Values, setting: Setting, tire: Tire) -> Drive:
    return dataclasses.replace(
        drive, FZ=followed(drive.t, drive.FZ, values["time_constant"], begun(drive.FZ, values))
    )


EFFECT = Effect(
    name="load_lag",
    stage="carriage",
    rank=5,
    in_time=True,
    statement="The load follows its command late, because the actuator moves at a finite speed.",
    equation="time_constant * FZ' + FZ = FZ_CMD",
    reference="the thesis, 6.4, on the actuator's speed",
    signature="the force slopes within a load block as the load does",
    separates="the load recorded beside its command, or a longer dwell after a load step",
    parameters=(
        EffectParameter(
            name="time_constant",
            unit="s",
            text="of the actuator",
            typical=(0.1, 5.0),
            bounds=(0.0, 100.0),
            starts=(0.05, 0.3, 1.5, 6.0),
        ),
    ),
    drive=_followed,
    remembers=True,
    confined_by=("repeat_of", "date", "order"),
    akin="a load that is slow to come, or a tire that is slow to settle",
    follows_command="FZ",
)
