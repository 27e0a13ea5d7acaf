"""Wear: slip work takes rubber off, and a thinner tread is stiffer."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import Values

if TYPE_CHECKING:
    from toolkit.effects.signals import Drive, Setting, Tire


def _worn(drive: Drive, values: Values, setting: Setting, tire: Tire) -> Drive:
    power_kW = np.abs(tire(drive).FY * drive.V * np.sin(drive.SA)) * 1e-3
    steps = 0.5 * (power_kW[1:] + power_kW[:-1]) * np.diff(drive.t)
    work_kJ = setting.slip_work_before_kJ + np.concatenate([[0.0], np.cumsum(steps)])
    return dataclasses.replace(
        drive, stiffness=drive.stiffness * np.maximum(1 + values["rate"] * work_kJ, 0.05)
    )


EFFECT = Effect(
    name="wear",
    stage="tire",
    rank=4,
    in_time=True,
    statement="The tread wears with slip work, and its stiffness changes with it.",
    equation="stiffness = 1 + rate * integral(|FY V sin(alpha)| dt), FY of the tire as new",
    reference="Archard, J. Appl. Phys. 24 (1953); Pacejka 2012, 3.2",
    signature="monotone in slip work",
    separates="the first angle repeated at the end, after a pause",
    parameters=(
        EffectParameter(
            name="rate",
            unit="1/kJ",
            text="relative change of the slope for each kJ of slip work",
            typical=(1e-05, 0.001),
            bounds=(0.0, float("inf")),  # a tread that wears thin is stiffer, never softer
        ),
    ),
    drive=_worn,
    form_error=0.03,
    by_slip_work=True,
)
