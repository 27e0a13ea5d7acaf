"""Compliance of the steering: the aligning moment turns the wheel against the encoder."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import Correctable, Values

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.effects.facts import Channels
    from toolkit.effects.signals import Drive, Setting, Tire


_STEPS = 12  # of the fixed point; compliance times aligning stiffness is well below one


def _compliant(drive: Drive, values: Values, setting: Setting, tire: Tire) -> Drive:
    turned = drive
    for _ in range(_STEPS):
        turned = dataclasses.replace(turned, SA=drive.SA - values["compliance"] * tire(turned).MZ)
    return turned


def _taken_out(
    channels: Channels, recorded: Channels, value: float, channel: str | None, source: str | None
) -> tuple[str, Array]:
    return "SA", channels["SA"] - value * channels["MZ"]


def _u_slip(u: float, largest_MZ: float) -> float:
    return u * largest_MZ  # an upper bound for the other rows


EFFECT = Effect(
    name="steer_compliance",
    stage="carriage",
    rank=3,
    in_time=False,
    statement="The aligning moment turns the wheel away from the angle that the encoder shows.",
    equation="alpha = SA - compliance * MZ(alpha)",
    reference="Pacejka, Tire and Vehicle Dynamics, 3rd ed. 2012, 1.3",
    signature="lowers both slopes and makes no loop",
    separates="an angle that is measured at the wheel itself",
    parameters=(
        EffectParameter(
            name="compliance",
            unit="rad/(N*m)",
            text="turn of the wheel for each unit of aligning moment",
            typical=(1e-05, 0.0001),
            bounds=(-0.001, 0.001),
        ),
    ),
    drive=_compliant,
    correctable=Correctable(unit="rad/(N*m)", undo=_taken_out, u_slip=_u_slip),
)
