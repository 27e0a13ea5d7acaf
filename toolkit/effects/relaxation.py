"""Relaxation length: the contact patch follows a change of slip angle over a distance."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from toolkit.effects.effect import Effect, EffectParameter, Values
from toolkit.effects.filters import lag

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.effects.signals import Drive, Setting, Tire


_STEP = 1e-3  # rad, for the slope at zero slip


def _relaxed(drive: Drive, values: Values, setting: Setting, tire: Tire) -> Drive:
    sigma = values["relaxation_length"] * _stiffness_ratio(drive, setting, tire)
    return dataclasses.replace(drive, SA=lag(drive.t, drive.SA, sigma / np.maximum(np.abs(drive.V), 1e-6)))


def _stiffness_ratio(drive: Drive, setting: Setting, tire: Tire) -> NDArray[np.float64]:
    # The relaxation length is cornering stiffness over lateral stiffness of the standing tire; the latter
    # hardly depends on load (Pacejka 2012, 7.1).
    at = dataclasses.replace(drive, SA=np.full_like(drive.SA, _STEP))
    slope = np.abs(tire(at).FY - tire(dataclasses.replace(at, SA=-at.SA)).FY)
    nominal = dataclasses.replace(at, FZ=np.full_like(drive.FZ, setting.nominal_load_N))
    whole = np.abs(tire(nominal).FY - tire(dataclasses.replace(nominal, SA=-at.SA)).FY)
    return np.divide(slope, whole, out=np.ones_like(slope), where=whole > 0)


EFFECT = Effect(
    name="relaxation",
    stage="tire",
    statement=("The tire answers a change of slip angle only after it has rolled a relaxation length."),
    equation=("(sigma/V) * alpha' + alpha = SA, sigma in proportion to the cornering stiffness at the load"),
    reference="Pacejka, Tire and Vehicle Dynamics, 3rd ed. 2012, 7.1 to 7.3",
    signature="a loop in proportion to the steering rate and to 1/V, closed at high slip",
    separates="two steering rates part it from backlash, two speeds from a delay of the channel",
    parameters=(
        EffectParameter(
            name="relaxation_length",
            unit="m",
            text="distance, at the nominal load",
            typical=(0.1, 0.8),
            bounds=(0.0, 5.0),
            starts=(0.2, 0.6),
        ),
    ),
    drive=_relaxed,
)
