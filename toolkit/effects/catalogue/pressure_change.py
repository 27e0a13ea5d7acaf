"""Inflation pressure that differs from the stated one."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import Values

if TYPE_CHECKING:
    from toolkit.effects.signals import Drive, Setting, Tire


def _inflated(drive: Drive, values: Values, setting: Setting, tire: Tire) -> Drive:
    return dataclasses.replace(drive, pressure_error=drive.pressure_error + 1e3 * values["pressure_error"])


EFFECT = Effect(
    name="pressure_change",
    stage="tire",
    rank=3,
    in_time=False,
    statement="The tire's pressure is not the stated one.",
    equation="P = P_INFL + pressure_error",
    reference="Besselink, Schmeitz, Pacejka, Vehicle System Dynamics 48 S1 (2010)",
    signature="stiffness falls at low load and rises at high load; the trail falls",
    separates="the pressure recorded while the tire runs",
    parameters=(
        EffectParameter(
            name="pressure_error",
            unit="kPa",
            text="true pressure less the stated one",
            typical=(2.0, 50.0),
            bounds=(-150.0, 300.0),
        ),
    ),
    drive=_inflated,
    form_error=0.03,
    needs_tire="pressure",
)
