"""Tire stage: what the road does to the tire, as the machine feels it.

The symmetric tire is the one of `bakker1987`; ply-steer and conicity break its symmetry as pseudo-angles,
so that both grow with load (plysteer = cornering stiffness x pseudo slip angle, conicity = camber
stiffness x pseudo camber angle). Forces are in the machine's own axes. With the drum reversed:

* plysteer is even under half a turn about z. In axes that follow the travel nothing changes, so in the
  machine's axes FY changes sign and MZ does not;
* conicity is even under x -> -x: the machine feels the same FY and the opposite MZ. In axes that follow
  the travel its pseudo camber angle changes sign. An error of the wheel's camber acts in the same way.

So for a symmetric tire FY(SA) = -FY_forward(SA) and MZ(SA) = +MZ_forward(SA).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from toolkit.arrays import Array
from toolkit.channels import Rotation
from toolkit.errors import ConfigError

# A passenger-car tire: the Magic Formula and coefficients of Bakker, Nyborg and Pacejka (1987).


@dataclass(frozen=True, slots=True, kw_only=True)
class Coefficients:
    """The numbers of one table of the paper: C, a1 to a8, and a9 to a13 for the inclination angle."""

    C: float
    a: tuple[float, ...]
    camber: tuple[float, ...]


LATERAL = Coefficients(
    C=1.30,
    a=(-22.1, 1011.0, 1078.0, 1.82, 0.208, 0.0, -0.354, 0.707),
    camber=(0.028, 0.0, 14.8, 0.022, 0.0),
)
ALIGNING = Coefficients(
    C=2.40,
    a=(-2.72, -2.28, -1.86, -2.73, 0.110, -0.070, 0.643, -4.04),
    camber=(0.015, -0.066, 0.945, 0.030, 0.070),
)


def lateral_force(*, slip_angle: ArrayLike, load: ArrayLike, camber: ArrayLike = 0.0) -> Array:
    """Return FY [N] in adapted-SAE axes.

    Parameters
    ----------
    slip_angle, camber : [rad] adapted SAE, any shapes that broadcast
    load : [N], positive; without load there is no force

    Examples
    --------
    The cornering stiffness at 1.11 kN is 433 N/deg:

    >>> import math
    >>> round(float(lateral_force(slip_angle=math.radians(1e-4), load=1110.0)) / 1e-4)
    433
    """
    kN = np.maximum(np.asarray(load, dtype=np.float64), 0.0) / 1000.0
    a3, a4, a5 = LATERAL.a[2:5]
    return _curve(LATERAL, a3 * np.sin(a4 * np.arctan(a5 * kN)), kN, slip_angle, camber)


def aligning_moment(*, slip_angle: ArrayLike, load: ArrayLike, camber: ArrayLike = 0.0) -> Array:
    """Return MZ [N·m] in adapted-SAE axes; parameters as in `lateral_force`.

    >>> import math
    >>> round(float(aligning_moment(slip_angle=math.radians(1e-4), load=3700.0)) / 1e-4, 1)
    -23.7
    """
    kN = np.maximum(np.asarray(load, dtype=np.float64), 0.0) / 1000.0
    a3, a4, a5 = ALIGNING.a[2:5]
    return _curve(ALIGNING, (a3 * kN**2 + a4 * kN) / np.exp(a5 * kN), kN, slip_angle, camber)


def _curve(table: Coefficients, BCD: Array, kN: Array, slip: ArrayLike, camber: ArrayLike) -> Array:
    gamma = np.degrees(np.asarray(camber, dtype=np.float64))
    a1, a2 = table.a[:2]
    a6, a7, a8 = table.a[5:]
    a9, a10, a11, a12, a13 = table.camber
    D = a1 * kN**2 + a2 * kN
    loaded = kN > 0
    B = np.where(loaded, BCD / np.where(loaded, table.C * D, 1.0), 1.0) * (1 - a12 * np.abs(gamma))
    E = (a6 * kN**2 + a7 * kN + a8) / (1 - a13 * np.abs(gamma))
    x = np.degrees(np.asarray(slip, dtype=np.float64)) + a9 * gamma
    phi = (1 - E) * x + E / B * np.arctan(B * x)
    force: Array = D * np.sin(table.C * np.arctan(B * phi)) + (a10 * kN**2 + a11 * kN) * gamma
    return force


@dataclass(frozen=True, slots=True, kw_only=True)
class TireTruth:
    """The virtual tire.

    ``plysteer_rad`` pseudo slip angle (SAE) of force and moment; ``aligning_shift_rad`` what the moment's
    pseudo slip angle is more than the force's, so that MZ is not zero where FY is (residual aligning torque);
    ``conicity_N`` force at ``nominal_load_N``;
    ``vertical_stiffness_N_m`` of the loaded tire on the drum; ``rolling_ratio`` effective rolling radius
    over free radius.
    """

    plysteer_rad: float = math.radians(0.12)
    aligning_shift_rad: float = math.radians(0.10)
    conicity_N: float = 45.0
    nominal_load_N: float = 3700.0
    free_radius_m: float = 0.316
    rolling_ratio: float = 0.97
    vertical_stiffness_N_m: float = 210e3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TireForces:
    """FY [N] and MZ [N·m] in the machine's axes, and the loaded radius [m]; all of one shape."""

    FY: Array
    MZ: Array
    loaded_radius: Array


def forces(
    tire: TireTruth,
    *,
    SA: ArrayLike,
    FZ: ArrayLike,
    rotation: Rotation,
    camber: ArrayLike = 0.0,
    facing: float = 1.0,
) -> TireForces:
    """Return what the tire does to the wheel.

    Parameters
    ----------
    SA : slip angle [rad], machine axes (equal to SAE in both directions of rotation)
    FZ : load [N], positive; broadcasts with SA
    rotation : of the drum
    camber : error of the wheel's camber [rad], as it acts with the drum forward
    facing : -1 for a tire that was turned round on the hub: its conicity pulls the other way
    """
    travel = 1.0 if rotation == "forward" else -1.0
    gamma = travel * (facing * pseudo_camber(tire) + np.asarray(camber, dtype=np.float64))
    slip = -(np.asarray(SA, dtype=np.float64) + tire.plysteer_rad)  # SAE to adapted SAE
    load = np.asarray(FZ, dtype=np.float64)
    return TireForces(
        FY=travel * lateral_force(slip_angle=slip, load=load, camber=gamma),
        MZ=aligning_moment(slip_angle=slip - tire.aligning_shift_rad, load=load, camber=gamma),
        loaded_radius=tire.free_radius_m - np.maximum(load, 0.0) / tire.vertical_stiffness_N_m,
    )


@lru_cache(maxsize=64)
def pseudo_camber(tire: TireTruth) -> float:
    """Return the pseudo camber angle [rad] whose force at the nominal load is the tire's conicity.

    Raises
    ------
    ConfigError
        the published camber coefficients cannot carry so large a force (they hold for a few degrees)
    """
    limit = math.radians(8.0)

    def force(gamma: float) -> float:
        return float(lateral_force(slip_angle=0.0, load=tire.nominal_load_N, camber=gamma))

    reach = force(limit)
    if abs(tire.conicity_N) > abs(reach):
        raise ConfigError(
            "the conicity is larger than the tire's camber force can be",
            where="tire.conicity",
            got=f"{tire.conicity_N:g} N",
            expected=f"at most {abs(reach):.0f} N at {tire.nominal_load_N:g} N",
            next_step="give a smaller conicity",
        )
    low, high = -limit, limit  # the force grows with the angle: bisection needs no derivative
    for _ in range(80):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if force(middle) < tire.conicity_N else (low, middle)
    return 0.5 * (low + high)


def revolution_time_s(tire: TireTruth, speed_m_s: float) -> float:
    """Return the time [s] of one tire revolution at a drum surface speed.

    >>> round(revolution_time_s(TireTruth(), 7.66 / 3.6), 2)
    0.91
    """
    return 2 * math.pi * tire.free_radius_m * tire.rolling_ratio / speed_m_s
