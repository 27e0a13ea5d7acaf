"""Magic Formula 6.1 and 6.2: FX, FY and MZ over slip angle, longitudinal slip, load, camber and pressure.

Axes ISO-W, SI. Equations: Pacejka, Tire and Vehicle Dynamics, 3rd ed. (2012), 4.E1 to 4.E78, with the
peak trail and trail stiffness as in Besselink, Schmeitz, Pacejka, Vehicle System Dynamics 48 (2010), A58
and A60, and the equivalent slip angles as in A54 and A55: the book's 4.E40 names QBZ6, which no tire file
has. Turn slip factors are one, alpha* = tan(alpha), gamma* = sin(gamma) unless raw angles are asked for,
the curvature factors are limited to 1, A_mu is 1, and F_y in M_z is the one at zero camber, with the weight
G_yk at zero camber too (4.E74); other programs take G_yk with camber: docs/magic_formula.md. A coefficient
that is absent is zero, a scale factor one, PKY4 two. For these forces 6.2 is 6.1.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from toolkit.arrays import Array
from toolkit.tires.mf import (
    MF61,
    Forces,
    arm,
    equivalent,
    kappa_force,
    longitudinal,
    magic_formula,
    weight_x,
    weight_y,
)
from toolkit.tires.recorded import as_array, may_differ_from_zero
from toolkit.tires.slip import State, cosine, nonzero, readers, sine

LATERAL = tuple(
    "PCY1 PDY1 PDY2 PDY3 PEY1 PEY2 PEY3 PEY4 PEY5 PKY1 PKY2 PKY3 PKY4 PKY5 PKY6 PKY7 PHY1 PHY2 PVY1 PVY2 "
    "PVY3 PVY4 PPY1 PPY2 PPY3 PPY4 PPY5".split()
)
ALIGNING = tuple(
    "QBZ1 QBZ2 QBZ3 QBZ4 QBZ5 QBZ9 QBZ10 QCZ1 QDZ1 QDZ2 QDZ3 QDZ4 QDZ6 QDZ7 QDZ8 QDZ9 QDZ10 QDZ11 QEZ1 QEZ2 "
    "QEZ3 QEZ4 QEZ5 QHZ1 QHZ2 QHZ3 QHZ4 PPZ1 PPZ2".split()
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lateral:
    """FY [N] of pure slip with what else needs of it.

    B, C and stiffness K [N/rad]; ``friction`` mu_y Fz [N]; ``residual_shift`` of the residual moment [rad].
    """

    FY: Array
    B: Array
    C: float
    K: Array
    friction: Array
    residual_shift: Array


def forces(p: Mapping[str, float], q: State, *, UNLOADED_RADIUS: float) -> Forces:
    """Return FX, FY, MZ of combined slip (4.E50, 4.E58, 4.E71); without kappa it is pure side slip."""
    pure, leaned = longitudinal(p, q), side(p, q)
    FX = weight_x(p, q) * pure.FX
    reduced = weight_y(p, q) * leaned.FY
    FY = reduced + kappa_force(p, q, leaned.friction)
    # Without camber the upright tire is the tire itself: half of the work.
    upright = weight_y(p, q.upright()) * side(p, q.upright()).FY if may_differ_from_zero(q.g) else reduced
    MZ = _moment(p, q, leaned, FY=upright, ratio=pure.K / leaned.K, UNLOADED_RADIUS=UNLOADED_RADIUS)
    MZ = MZ + arm(p, q, FY=FY, UNLOADED_RADIUS=UNLOADED_RADIUS) * FX
    return Forces(FX=FX, FY=FY, MZ=MZ)


def side(p: Mapping[str, float], q: State) -> Lateral:
    """Return FY [N] of pure slip at a state (4.E19 to 4.E30)."""
    c, s = readers(p)
    FZ, F0, df, dp, g = q.FZ, q.F0, q.df, q.dp, q.g
    K = c("PKY1") * F0 * (1 + c("PPY1") * dp) * (1 - c("PKY3") * np.abs(g)) * s("LKY")
    softening = nonzero((c("PKY2") + c("PKY5") * g * g) * (1 + c("PPY2") * dp))
    K = nonzero(K * np.sin(p.get("PKY4", 2.0) * np.arctan(FZ / F0 / softening)))
    Sv_camber = FZ * (c("PVY3") + c("PVY4") * df) * g * s("LKYC") * q.mu_y
    K_camber = FZ * (c("PKY6") + c("PKY7") * df) * (1 + c("PPY5") * dp) * s("LKYC")
    Sh = (c("PHY1") + c("PHY2") * df) * s("LHY") + (K_camber * g - Sv_camber) / K
    Sv = FZ * (c("PVY1") + c("PVY2") * df) * s("LVY") * q.mu_y + Sv_camber
    x = q.a + Sh
    C = c("PCY1") * s("LCY")
    mu = (c("PDY1") + c("PDY2") * df) * (1 + c("PPY3") * dp + c("PPY4") * dp * dp)
    D = mu * (1 - c("PDY3") * g * g) * q.mu_y * FZ
    E = (c("PEY1") + c("PEY2") * df) * s("LEY")
    E = np.minimum(E * (1 + c("PEY5") * g * g - (c("PEY3") + c("PEY4") * g) * np.sign(x)), 1.0)
    B = K / nonzero(C * D)
    return Lateral(FY=D * sine(B, C, E, x) + Sv, B=B, C=C, K=K, friction=D, residual_shift=Sh + Sv / K)


def _moment(
    p: Mapping[str, float], q: State, leaned: Lateral, *, FY: Array, ratio: Array, UNLOADED_RADIUS: float
) -> Array:
    # 4.E31 to 4.E49 and 4.E72 to 4.E75; FY is the one at zero camber.
    c, s = readers(p)
    FZ, df, dp, g = q.FZ, q.df, q.dp, q.g
    x = q.a + c("QHZ1") + c("QHZ2") * df + (c("QHZ3") + c("QHZ4") * df) * g
    B = (c("QBZ1") + c("QBZ2") * df + c("QBZ3") * df * df) * (1 + c("QBZ4") * g + c("QBZ5") * np.abs(g))
    B = B * s("LKY") / nonzero(q.mu_y)
    C = c("QCZ1")
    D = FZ * (UNLOADED_RADIUS / q.F0) * (c("QDZ1") + c("QDZ2") * df) * (1 - c("PPZ1") * dp) * s("LTR")
    D = D * (1 + c("QDZ3") * g + c("QDZ4") * g * g)
    E = c("QEZ1") + c("QEZ2") * df + c("QEZ3") * df * df
    E = np.minimum(E * (1 + (c("QEZ4") + c("QEZ5") * g) * (2 / np.pi) * np.arctan(C * B * x)), 1.0)
    trail = D * cosine(B, C, E, equivalent(x, ratio, q.kappa)) * q.cosine
    Br = c("QBZ9") * s("LKY") / nonzero(q.mu_y) + c("QBZ10") * leaned.B * leaned.C
    camber = (c("QDZ8") + c("QDZ9") * df) * (1 + c("PPZ2") * dp) + (c("QDZ10") + c("QDZ11") * df) * np.abs(g)
    Dr = FZ * UNLOADED_RADIUS * q.mu_y
    Dr = Dr * ((c("QDZ6") + c("QDZ7") * df) * s("LRES") + camber * g * s("LKZC"))
    turned = equivalent(q.a + leaned.residual_shift, ratio, q.kappa)
    return as_array(Dr * np.cos(np.arctan(Br * turned)) * q.cosine - trail * FY)


MODEL = magic_formula(
    name="mf61",
    title="Magic Formula 6.1",
    reference="Pacejka (2012), eq. 4.E1 to 4.E78; Besselink, Schmeitz, Pacejka (2010)",
    valid="within the loads, angles, pressures and slips of the data",
    parameters=MF61,
    evaluator=forces,
)
