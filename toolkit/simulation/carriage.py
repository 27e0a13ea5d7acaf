"""Carriage and drum: where the wheel is held, what presses it, and what reaches the hub.

The rack has 1 deg steps and a zero of its own, which the slip-angle sensor shows; an error of that sensor
(``steer_offset``) it does not show. The load actuator stops near the load it was told, not at it.

A drum that is not quite round presses the tire more and less, once a revolution.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, TypeVar

import numpy as np

from toolkit.arrays import Array
from toolkit.declared import Entry, Unit
from toolkit.simulation.tire import TireForces
from toolkit.units import to_si


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadTruth:
    """Run-out as load variation at the drum's revolution and at twice that; phases against drum angle 0."""

    runout_1_N: Annotated[
        float, Unit("N"), Entry("load variation once a revolution of the drum", key="drum_runout_1")
    ] = 20.0
    runout_1_phase_rad: Annotated[
        float, Unit("deg"), Entry("against drum angle 0", key="drum_runout_1_phase")
    ] = 0.6
    runout_2_N: Annotated[float, Unit("N"), Entry("twice a revolution", key="drum_runout_2")] = 5.0
    runout_2_phase_rad: Annotated[
        float, Unit("deg"), Entry("against drum angle 0", key="drum_runout_2_phase")
    ] = 2.1


def drum_angle(*, time: Array, speed_m_s: float, radius_m: float, start_rad: float, reverse: bool) -> Array:
    """Return the drum's angle [rad] at times [s]; a reversed drum counts down."""
    return start_rad + (-1.0 if reverse else 1.0) * time * speed_m_s / radius_m


def load_on_drum(road: RoadTruth, *, load: Array, angle: Array) -> Array:
    """Return the load [N] between tire and drum: the actuator's load plus the run-out's lines.

    >>> import numpy as np
    >>> lines = load_on_drum(RoadTruth(), load=np.zeros(360), angle=np.radians(np.arange(360)))
    >>> bool(abs(lines.mean()) < 1e-9)  # over a whole revolution of the drum, and only then
    True
    """
    return (
        load
        + road.runout_1_N * np.cos(angle + road.runout_1_phase_rad)
        + road.runout_2_N * np.cos(2 * angle + road.runout_2_phase_rad)
    )


Angle = TypeVar("Angle", float, "Array")


@dataclass(frozen=True, slots=True, kw_only=True)
class CarriageTruth:
    """The virtual carriage.

    ``steering_zero_rad`` measured and true slip angle at the rack's zero; ``steer_offset_rad`` how much
    the sensor shows too much; ``load_spread`` largest deviation of a block's load, as a share of it;
    ``overturning_Nm`` moment of the wheel's own weight about the hub.
    """

    steering_zero_rad: Annotated[
        float,
        Unit("deg"),
        Entry("true angle at the rack's zero, which the sensor shows", key="steering_zero"),
    ] = math.radians(-0.3)
    steer_offset_rad: Annotated[
        float, Unit("deg"), Entry("what the slip-angle sensor shows too much", key="steer_offset")
    ] = 0.0
    camber_offset_rad: Annotated[float, Unit("deg"), Entry("of the wheel", key="camber_offset")] = 0.0
    load_spread: Annotated[float, Unit("1"), Entry("largest deviation, as a share of the load")] = 0.03
    # Fitted to the moment of the ten rows of Figure 4.4: 28.9 lbf·m at no lateral force.
    overturning_Nm: Annotated[
        float, Unit("N*m"), Entry("moment of the wheel's weight about the hub", key="overturning")
    ] = float(to_si(28.9, "lbf"))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HubLoads:
    """FY [N], MZ and MX [N·m] on the hub, machine axes, and the load FZ [N] beside them."""

    FY: Array
    MZ: Array
    MX: Array
    FZ: Array


def wheel_angle(carriage: CarriageTruth, *, step_rad: Angle) -> Angle:
    """Return the wheel's slip angle [rad] at an angle of the rack."""
    return step_rad + carriage.steering_zero_rad - carriage.steer_offset_rad


def sensed_angle(carriage: CarriageTruth, *, SA: Array) -> Array:
    """Return what the slip-angle sensor stands at [rad]."""
    return SA + carriage.steer_offset_rad


def set_load(carriage: CarriageTruth, *, step_N: float, rng: np.random.Generator) -> float:
    """Return the load [N] at which the actuator stops for a step of the protocol."""
    return step_N * (1.0 + carriage.load_spread * float(rng.uniform(-1.0, 1.0)))


def hub_loads(carriage: CarriageTruth, *, tire: TireForces, FZ: Array) -> HubLoads:
    """Carry the tire's forces to the hub: MX = loaded radius x FY + the wheel's weight moment.

    Without load (a wheel that hangs free) only the weight is left.
    """
    MX = tire.loaded_radius * tire.FY + carriage.overturning_Nm
    return HubLoads(FY=tire.FY, MZ=tire.MZ, MX=MX, FZ=FZ)
