"""Zero error of the slip-angle sensor: the wheel stands at another angle than the one recorded."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import Alike, Correctable, Values, everywhere

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.effects.facts import Channels
    from toolkit.effects.signals import Drive, Setting, Tire


def _turned(drive: Drive, values: Values, setting: Setting, tire: Tire) -> Drive:
    return dataclasses.replace(drive, SA=drive.SA - np.deg2rad(values["offset"]))


def _taken_out(
    channels: Channels, recorded: Channels, value: float, channel: str | None, source: str | None
) -> tuple[str, Array]:
    return "SA", channels["SA"] - value


def _u_slip(u: float, largest_MZ: float) -> float:
    return u


EFFECT = Effect(
    name="steer_offset",
    stage="carriage",
    rank=1,
    in_time=False,
    statement=("The slip angle's zero is off: the wheel stands at another angle than the recorded one."),
    equation="alpha = SA - offset",
    reference="Pacejka, Tire and Vehicle Dynamics, 3rd ed. 2012, 4.3; SAE J1987",
    signature="FY and MZ are shifted by one angle at all loads",
    separates=(
        "a steering zero that is measured with the wheel at rest, or the tire turned round on the hub"
    ),
    parameters=(
        EffectParameter(
            name="offset",
            unit="deg",
            text="what the slip-angle sensor shows too much",
            typical=(0.02, 0.5),
            sense=("SA", "SAE"),
        ),
    ),
    drive=_turned,
    alike=Alike(group="zero of the slip angle", holds=everywhere),
    correctable=Correctable(unit="rad", undo=_taken_out, u_slip=_u_slip),
)
