"""Temperature of tread and carcass: friction and stiffness fall as the tire heats."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import Values
from toolkit.effects.filters import PAST, lag

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.effects.signals import Drive, Setting, Tire
    from toolkit.effects.surroundings import Surroundings


_TEMPERATURES = ("T_TREAD", "T_TIRE", "T")  # the nearest to the road first
HEATING_K_PER_KJ = 0.5  # of the tread, where no temperature was recorded (about 2 kJ/K of rubber)


def _heated(drive: Drive, values: Values, setting: Setting, tire: Tire) -> Drive:
    rise = _rise(drive, values, setting, tire)
    return dataclasses.replace(
        drive,
        friction=drive.friction * np.maximum(1 + values["peak_per_K"] * rise, 0.05),
        stiffness=drive.stiffness * np.maximum(1 + values["stiffness_per_K"] * rise, 0.05),
    )


def _rise(drive: Drive, values: Values, setting: Setting, tire: Tire) -> Array:
    name = next((channel for channel in _TEMPERATURES if channel in setting.channels), None)
    if name is not None and len(drive.t):
        recorded = setting.channels[name]
        return recorded - setting.first.get(name, float(recorded[0])) - values.get("reference", 0.0)
    power_kW = np.abs(tire(drive).FY * drive.V * np.sin(drive.SA)) * 1e-3
    tau = max(values["time_constant"], 1e-3)
    start = values.get(PAST, 0.0) * float(np.ptp(power_kW)) if len(power_kW) else 0.0
    return HEATING_K_PER_KJ * tau * lag(drive.t, power_kW, tau, start=start)


def _temperature_recorded(case: Surroundings) -> bool:
    return bool(case.drivers & set(_TEMPERATURES))


def _temperature_unknown(case: Surroundings) -> bool:
    return not _temperature_recorded(case)


EFFECT = Effect(
    name="thermal_friction",
    stage="tire",
    rank=2,
    in_time=True,
    statement=("The tire heats while it slips, and its friction and stiffness change with the temperature."),
    equation=(
        "friction = 1 + peak_per_K*(T - T0), stiffness = 1 + stiffness_per_K*(T - T0); T "
        "recorded and T0 its first value + reference, or T' = heat*|FY V sin(alpha)| - (T - T0)/time_constant"
    ),
    reference="Mizuno et al., Int. J. Automotive Technology 6 (2005)",
    signature="|FY| is larger going out than coming back, and repeats of one angle drift",
    separates="the tread's temperature recorded, slip angles up and down, and a pause",
    parameters=(
        EffectParameter(
            name="peak_per_K", unit="1/K", text="relative change of the peak", typical=(-0.01, -0.001)
        ),
        EffectParameter(
            name="stiffness_per_K", unit="1/K", text="relative change of the slope", typical=(-0.008, -0.003)
        ),
        EffectParameter(
            name="time_constant",
            unit="s",
            text="of cooling, where no temperature is recorded",
            typical=(5.0, 60.0),
            off=None,
            bounds=(0.5, 2000.0),
            starts=(8.0, 60.0),
            needless=_temperature_recorded,
        ),
        EffectParameter(
            name="reference",
            unit="K",
            text="temperature of the tire that is simulated, above the first one recorded",
            typical=(-10.0, 10.0),
            off=None,
            bounds=(-80.0, 80.0),
            starts=(0.0,),
            absent=0.0,
            needless=_temperature_unknown,
        ),
    ),
    drive=_heated,
    remembers=True,
    form_error=0.03,
    by_temperature=True,
)
