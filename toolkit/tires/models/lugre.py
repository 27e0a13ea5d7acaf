"""LuGre: distributed bristle friction with a Stribeck law, steady state, under an asymmetric trapezoid.

With t = 0 at the leading edge of the patch (1 at the trailing one), sigma the size of the theoretical slip
and v the sliding speed,

    friction(t) = g (1 - exp(-K t)) + S2 v,   K = C sigma / (g tm),   g = MU (R + (1 - R) exp(-sqrt(v/VS)))
    F = FZ int p friction dt,   FX = F sigma_x/sigma,   FY = -F sigma_y/sigma,   MZ = int (1/2 - t) L dFY

p(t) is the normalised pressure, a trapezoid whose flat part is TOP and whose rise takes the share FRONT of
the rest; tm is its centroid. K = sigma0 L sigma/g: the bristle stiffness is sigma0 = C/(L tm), so that C is
the slope at zero over load and FY does not depend on the length L.

Source: Canudas de Wit, Tsiotras, Velenis, Basset, Gissinger, Vehicle System Dynamics 39 (2003) 189, eq. 26-31
(steady state); Velenis, Tsiotras, Canudas de Wit, Sorine, ibid. 43 (2005) 3 (two directions); Deur, Asgari,
Hrovat, ibid. 42 (2004) 153 (asymmetric pressure, aligning moment). sigma1 has no part in the steady state.
SH, K_IA, SV, SM as in the brush.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from toolkit.arrays import Array
from toolkit.tires.contact import directed, half_length, slips, with_load
from toolkit.tires.global_model import CAMBER, OFFSETS, SHIFT, GlobalModel, Responses, Rows, Seeds, parameters
from toolkit.tires.recorded import as_array

_NODES = 10  # of Gauss-Legendre on each of the trapezoid's three parts

# name, unit, default, low, high, size, stage, needs, text
_TABLE = """
C      1/rad  15.0    1.0  200.0    1.0  FY  -  cornering stiffness over load at FNOMIN, sigma0 L tm
C_Z    1       0.0   -3.0    3.0    0.1  FY  2  its change with load: CF/FZ = C exp(C_Z dfz + C_ZZ dfz^2)
C_ZZ   1       0.0   -1.5    1.5    0.1  FY  3  its second change with load
MU     1       1.0   0.05    6.0    0.1  FY  -  static friction at FNOMIN
MU_Z   1       0.0   -2.0    2.0   0.05  FY  2  its change with load: mu = MU exp(MU_Z dfz)
R      1       1.0    0.3    1.0    0.1  FY  -  Coulomb over static friction
VS     m/s     5.0    0.5  100.0    2.0  FY  -  Stribeck speed
S2     s/m     0.0    0.0   0.02  0.002  FY  v  viscous friction over load and speed
L      m      0.16  0.005    1.0   0.01  MZ  -  effective contact length at FNOMIN
L_P    1       0.5   0.05    2.0    0.1  MZ  2  its growth with load: L (FZ/FNOMIN)^L_P
TOP    1       0.5    0.0    1.0   0.15  FY  -  flat part of the pressure trapezoid
FRONT  1       0.5    0.0    1.0    0.1  MZ  -  share of its rise in what is not flat; < 0.5: load in front
"""


def forces(values: Sequence[Any], rows: Rows) -> Responses:
    """Return FX, FY [N] and MZ [N·m] in SAE axes; ``values`` as `MODEL.parameters`."""
    C, C_Z, C_ZZ, MU, MU_Z, R, VS, S2, L, L_P, TOP, FRONT, SH, K_IA, SV, SM = values
    sx, sy = slips(rows, SH - K_IA * rows.IA)
    slip, along, across = directed(sx, sy)
    speed = np.abs(rows.V * np.cos(rows.SA) * (1 + rows.KAPPA)) * slip
    g = with_load(MU, MU_Z, rows.dfz) * (R + (1 - R) * np.exp(-np.sqrt(speed / VS)))
    front, rear = (1 - TOP) * FRONT, (1 - TOP) * (1 - FRONT)
    growth = with_load(C, C_Z, rows.dfz, C_ZZ) * slip / (g * centroid(front, rear))
    filling, moment = filled(growth, front, rear)
    viscous = S2 * speed
    F = rows.FZ * (g * filling + viscous)
    arm = g * moment + viscous * (0.5 - centroid(front, rear))
    MZ = -rows.FZ * 2 * half_length(L / 2, L_P, rows) * arm * across
    return Responses(FX=F * along, FY=-F * across + rows.FZ * SV, MZ=MZ + rows.FZ * SM)


def centroid(front: Any, rear: Any) -> Any:
    """Return where the trapezoid's centroid lies, as a part of the length behind the leading edge.

    >>> float(centroid(0.5, 0.5)), round(centroid(1.0, 0.0), 6)
    (0.5, 0.666667)
    """
    flat = 1.0 - front - rear
    rising, falling = front * front / 3, rear / 2 * (1 - 2 * rear / 3)
    return (rising + flat * (front + flat / 2) + falling) / (1 - (front + rear) / 2)


def filled(growth: Any, front: Any, rear: Any) -> tuple[Array, Array]:
    """Return int p (1 - exp(-K t)) dt and int p (1 - exp(-K t)) (1/2 - t) dt for K = ``growth`` >= 0.

    p is the normalised trapezoid with the parts ``front`` and ``rear``; arrays broadcast. Gauss-Legendre
    on each of its parts: better than 1e-11 for K to 10; for K to 100, where nearly all slides, than 1e-5, and
    than 1e-3 for a pressure that begins with a step.
    """
    node, weight = np.polynomial.legendre.leggauss(_NODES)
    node, weight = 0.5 * (node + 1), 0.5 * weight
    K, f, r = (as_array(array)[..., None] for array in (growth, front, rear))
    flat = 1.0 - f - r
    t = np.concatenate(np.broadcast_arrays(f * node, f + flat * node, 1 - r * node), axis=-1)
    # The rise and the fall are linear in their own coordinate, which is 0 at the outer edge.
    p = np.concatenate(np.broadcast_arrays(f * node * weight, flat * weight, r * node * weight), axis=-1) / (
        1 - (f + r) / 2
    )
    share = p * -np.expm1(-K * t)
    return share.sum(axis=-1), (share * (0.5 - t)).sum(axis=-1)


def starts(seeds: Seeds) -> tuple[Mapping[str, float], ...]:
    """Return start values: stiffness, peak and trail of each load, with and without a falling friction."""
    stiffness, change = seeds.law(seeds.stiffness / seeds.load)
    friction, fade = seeds.law(seeds.peak / seeds.load)
    trail = seeds.at_nominal(seeds.trail)[0]
    start = {"C": 1.2 * stiffness, "C_Z": change, "MU": 1.1 * friction, "MU_Z": fade}
    if np.isfinite(trail) and trail > 0:
        start["L"] = 6 * trail
    return (
        start,
        {**start, "R": 0.6, "VS": 3.0, "MU": 1.5 * friction},
        {**start, "TOP": 0.8, "FRONT": 0.3, "C": 1.5 * stiffness},
    )


MODEL = GlobalModel(
    name="lugre",
    title="LuGre with an asymmetric pressure distribution",
    reference="Canudas de Wit et al., Vehicle System Dynamics 39 (2003) 189; Deur et al., 42 (2004) 153",
    valid="steady rolling forward on a rigid carcass, small camber; friction falls with the sliding speed, "
    "which data of one speed and a small slip range do not determine",
    axes="SAE",
    channels=("FY", "MZ"),
    joint=True,
    grid=3 * _NODES,
    parameters=parameters(_TABLE + SHIFT + CAMBER + OFFSETS),
    reads=("KAPPA", "V"),
    forces=forces,
    starts=starts,
)
