"""Relaxation length: the contact patch follows a change of slip angle over a distance."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import Values
from toolkit.effects.filters import begun, lag

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.effects.signals import Drive, Setting, Tire
    from toolkit.effects.surroundings import Surroundings


_WITH_LOAD = "with_load"
_STEP = 1e-3  # rad, for a slope
_TURNS = 3  # after which the slip angle at which the slope is taken changes no more
_LOADS = 0.2  # of the largest load: less tells nothing of what goes with it
_LEAST = 0.05  # of the length at zero slip: beyond the peak the slope has no sense as a length


def _relaxed(drive: Drive, values: Values, setting: Setting, tire: Tire) -> Drive:
    # The relaxation length is the slope of the lateral force over the lateral stiffness of the standing
    # tire; the latter hardly depends on load (Pacejka 2012, 7.1).
    straight = dataclasses.replace(drive, SA=np.zeros_like(drive.SA))
    nominal = _slope(tire, dataclasses.replace(straight, FZ=np.full_like(drive.FZ, setting.nominal_load_N)))
    at_zero = _over(_slope(tire, straight), nominal)
    by_load = np.maximum(at_zero, _LEAST) ** values.get(_WITH_LOAD, 1.0)
    falling, slip = values["falling"], drive.SA
    for _ in range(_TURNS if falling else 1):
        ratio = np.ones_like(at_zero)
        if falling:
            slope = _slope(tire, dataclasses.replace(drive, SA=slip))
            ratio = np.maximum(1 + falling * (_over(slope, at_zero * nominal) - 1), _LEAST)
        length = values["relaxation_length"] * ratio * by_load
        slip = lag(drive.t, drive.SA, length / np.maximum(np.abs(drive.V), 1e-6), begun(drive.SA, values))
    return dataclasses.replace(drive, SA=slip)


def _over(slope: Array, nominal: Array) -> Array:
    return np.divide(slope, nominal, out=np.ones_like(slope), where=nominal != 0)


def _slope(tire: Tire, drive: Drive) -> Array:
    """Return dFY/dSA [N/rad] at the drive's slip angles, shape (n,)."""
    turned = tire(dataclasses.replace(drive, SA=drive.SA + _STEP)).FY
    less = tire(dataclasses.replace(drive, SA=drive.SA - _STEP)).FY
    return np.asarray((turned - less) / (2 * _STEP))


def _one_load(case: Surroundings) -> bool:
    loads = case.values("FZ")
    return not (len(loads) > 0 and float(np.ptp(loads)) > _LOADS * float(np.abs(loads).max()))


EFFECT = Effect(
    name="relaxation",
    stage="tire",
    rank=1,
    in_time=True,
    statement=("The tire answers a change of slip angle only after it has rolled a relaxation length."),
    equation=(
        "(sigma/V) * alpha' + alpha = SA; sigma in proportion to the cornering stiffness at the load to the "
        "power `with_load`, and by the share `falling` to the slope of FY at alpha"
    ),
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
        EffectParameter(
            name="falling",
            unit="1",
            text="share in which it falls with the slope of FY: 0 a constant length, 1 a carcass as a spring",
            typical=(0.0, 1.0),
            off=None,
            bounds=(0.0, 1.0),
            starts=(0.0, 1.0),
            absent=0.0,
            ends_count=True,
        ),
        EffectParameter(
            name=_WITH_LOAD,
            unit="1",
            text="how it goes with the load: 0 one length at all loads, 1 as the cornering stiffness does",
            typical=(0.0, 1.0),
            off=None,
            bounds=(0.0, 2.0),
            starts=(1.0,),
            absent=1.0,
            ends_count=True,
            needless=_one_load,
        ),
    ),
    drive=_relaxed,
    remembers=True,
    form_error=0.03,
)
