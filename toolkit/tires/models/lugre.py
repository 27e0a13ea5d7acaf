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
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.tires.contact import directed, half_length, slips, with_load
from toolkit.tires.global_model import GlobalModel, GlobalParameter, Responses, Rows, Seeds

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_NODES = 10  # of Gauss-Legendre on each of the trapezoid's three parts


def forces(values: Sequence[Any], rows: Rows) -> Responses:
    """Return FX, FY [N] and MZ [N·m] in SAE axes; ``values`` as `MODEL.parameters`."""
    C, C_Z, C_ZZ, MU, MU_Z, R, VS, S2, L, L_P, TOP, FRONT, SH, K_IA, SV, SM = values
    sx, sy = slips(rows, SH - K_IA * rows.IA)
    slip, along, across = directed(sx, sy)
    speed = np.abs(rows.V * np.cos(rows.SA) * (1 + rows.KAPPA)) * slip
    g = with_load(MU, MU_Z, rows.dfz) * (R + (1 - R) * np.exp(-np.sqrt(speed / VS)))
    front, rear = (1 - TOP) * FRONT, (1 - TOP) * (1 - FRONT)
    growth = with_load(C, C_Z, rows.dfz, C_ZZ) * slip / (g * centroid(front, rear))
    whole, moment = filled(growth, front, rear)
    viscous = S2 * speed
    F = rows.FZ * (g * whole + viscous)
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
    K, f, r = (np.asarray(one)[..., None] for one in (growth, front, rear))
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
    stiffness, change = _law(seeds, seeds.stiffness / seeds.load)
    friction, fade = _law(seeds, seeds.peak / seeds.load)
    trail = seeds.at_nominal(seeds.trail)[0]
    start = {"C": 1.2 * stiffness, "C_Z": change, "MU": 1.1 * friction, "MU_Z": fade}
    if np.isfinite(trail) and trail > 0:
        start["L"] = 6 * trail
    return (
        start,
        {**start, "R": 0.6, "VS": 3.0, "MU": 1.5 * friction},
        {**start, "TOP": 0.8, "FRONT": 0.3, "C": 1.5 * stiffness},
    )


def _law(seeds: Seeds, ratio: Any) -> tuple[float, float]:
    base, slope = seeds.at_nominal(np.log(ratio))
    return float(np.exp(base)), slope


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
    parameters=(
        GlobalParameter(
            name="C", unit="1/rad", default=15.0, low=1.0, high=200.0, size=1.0,
            text="cornering stiffness over load at FNOMIN, sigma0 L tm",
        ),
        GlobalParameter(
            name="C_Z", unit="1", default=0.0, low=-3.0, high=3.0, size=0.1,
            text="its change with load: CF/FZ = C exp(C_Z dfz + C_ZZ dfz^2)", needs=("two_loads",),
        ),
        GlobalParameter(
            name="C_ZZ", unit="1", default=0.0, low=-1.5, high=1.5, size=0.1,
            text="its second change with load", needs=("three_loads",),
        ),
        GlobalParameter(
            name="MU", unit="1", default=1.0, low=0.05, high=6.0, size=0.1,
            text="static friction at FNOMIN",
        ),
        GlobalParameter(
            name="MU_Z", unit="1", default=0.0, low=-2.0, high=2.0, size=0.05,
            text="its change with load: mu = MU exp(MU_Z dfz)", needs=("two_loads",),
        ),
        GlobalParameter(
            name="R", unit="1", default=1.0, low=0.3, high=1.0, size=0.1,
            text="Coulomb over static friction",
        ),
        GlobalParameter(
            name="VS", unit="m/s", default=5.0, low=0.5, high=100.0, size=2.0, text="Stribeck speed",
        ),
        GlobalParameter(
            name="S2", unit="s/m", default=0.0, low=0.0, high=0.02, size=2e-3,
            text="viscous friction over load and speed; a curve of one speed cannot tell it from shape",
            needs=("speed",),
        ),
        GlobalParameter(
            name="L", unit="m", default=0.16, low=0.005, high=1.0, size=0.01,
            text="effective contact length at FNOMIN", stage="MZ",
        ),
        GlobalParameter(
            name="L_P", unit="1", default=0.5, low=0.05, high=2.0, size=0.1,
            text="its growth with load: L (FZ/FNOMIN)^L_P", stage="MZ", needs=("two_loads",),
        ),
        GlobalParameter(
            name="TOP", unit="1", default=0.5, low=0.0, high=1.0, size=0.15,
            text="flat part of the pressure trapezoid",
        ),
        GlobalParameter(
            name="FRONT", unit="1", default=0.5, low=0.0, high=1.0, size=0.1,
            text="share of its rise in what is not flat; under 0.5 the load lies in front", stage="MZ",
        ),
        GlobalParameter(
            name="SH", unit="rad", default=0.0, low=-0.1, high=0.1, size=1e-3,
            text="equivalent slip angle of plysteer and steering zero", needs=("both_signs",),
        ),
        GlobalParameter(
            name="K_IA", unit="1", default=0.0, low=-0.5, high=1.0, size=0.02,
            text="equivalent slip angle of camber, per rad", needs=("camber",),
        ),
        GlobalParameter(
            name="SV", unit="1", default=0.0, low=-0.2, high=0.2, size=0.01,
            text="offset of FY over load (conicity)", needs=("both_signs",),
        ),
        GlobalParameter(
            name="SM", unit="m", default=0.0, low=-0.05, high=0.05, size=1e-3,
            text="offset of MZ over load", stage="MZ", needs=("both_signs",),
        ),
    ),
    forces=forces,
    starts=starts,
)  # fmt: skip
