"""Magic Formula 5.2 (PAC2002): FX, FY and MZ over slip angle, longitudinal slip, load and camber.

Axes ISO-W, SI. Equations: Pacejka, Tyre and Vehicle Dynamics (2002), 4.E1 to 4.E78, as the tire files of
FITTYP 5, 6, 21 and 52 name them. Against 6.x: no pressure, camber enters by PHY3 and the scale factors
LGAX, LGAY, LGAZ, and F_y in M_z is the one with camber. Turn slip factors are one, alpha* = tan(alpha),
gamma* = sin(gamma) unless raw angles are asked for, the curvature factors are limited to 1.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np

from toolkit.arrays import Array
from toolkit.tires.mf import (
    MF52,
    Forces,
    arm,
    equivalent,
    kappa_force,
    longitudinal,
    magic_formula,
    weight_x,
    weight_y,
)
from toolkit.tires.models.mf61 import Lateral
from toolkit.tires.recorded import as_array
from toolkit.tires.slip import State, cosine, nonzero, readers, sine


def forces(p: Mapping[str, float], q: State, *, UNLOADED_RADIUS: float) -> Forces:
    """Return FX, FY, MZ of combined slip; without kappa it is pure side slip."""
    s = readers(p)[1]
    pure = longitudinal(p, dataclasses.replace(q, g=q.g * s("LGAX"), dp=np.zeros_like(q.dp)))
    lateral = side(p, q)
    FX = weight_x(p, q) * pure.FX
    reduced = weight_y(p, q) * lateral.FY
    FY = reduced + kappa_force(p, q, lateral.friction)
    MZ = _moment(p, q, lateral, FY=reduced, ratio=pure.K / lateral.K, UNLOADED_RADIUS=UNLOADED_RADIUS)
    return Forces(FX=FX, FY=FY, MZ=MZ + arm(p, q, FY=FY, UNLOADED_RADIUS=UNLOADED_RADIUS) * FX)


def side(p: Mapping[str, float], q: State) -> Lateral:
    """Return FY [N] of pure slip at a state (4.E19 to 4.E30)."""
    c, s = readers(p)
    FZ, F0, df, g = q.FZ, q.F0, q.df, q.g * s("LGAY")
    K = c("PKY1") * F0 * np.sin(2 * np.arctan(FZ / nonzero(as_array(c("PKY2") * F0))))
    K = nonzero(K * (1 - c("PKY3") * np.abs(g)) * s("LKY"))
    Sh = (c("PHY1") + c("PHY2") * df) * s("LHY") + c("PHY3") * g
    Sv = FZ * ((c("PVY1") + c("PVY2") * df) * s("LVY") + (c("PVY3") + c("PVY4") * df) * g) * q.mu_y
    x = q.a + Sh
    C = c("PCY1") * s("LCY")
    D = (c("PDY1") + c("PDY2") * df) * (1 - c("PDY3") * g * g) * q.mu_y * FZ
    E = (c("PEY1") + c("PEY2") * df) * s("LEY")
    E = np.minimum(E * (1 - (c("PEY3") + c("PEY4") * g) * np.sign(x)), 1.0)
    B = K / nonzero(C * D)
    return Lateral(FY=D * sine(B, C, E, x) + Sv, B=B, C=C, K=K, friction=D, residual_shift=Sh + Sv / K)


def _moment(
    p: Mapping[str, float], q: State, lateral: Lateral, *, FY: Array, ratio: Array, UNLOADED_RADIUS: float
) -> Array:
    # 4.E31 to 4.E49 and 4.E71 to 4.E78 without the arm of FX; FY is without what kappa induces.
    c, s = readers(p)
    FZ, df, g = q.FZ, q.df, q.g * s("LGAZ")
    x = q.a + c("QHZ1") + c("QHZ2") * df + (c("QHZ3") + c("QHZ4") * df) * g
    B = (c("QBZ1") + c("QBZ2") * df + c("QBZ3") * df * df) * (1 + c("QBZ4") * g + c("QBZ5") * np.abs(g))
    B = B * s("LKY") / nonzero(q.mu_y)
    C = c("QCZ1")
    D = FZ * (UNLOADED_RADIUS / q.F0) * (c("QDZ1") + c("QDZ2") * df) * s("LTR")
    D = D * (1 + c("QDZ3") * g + c("QDZ4") * g * g)
    E = c("QEZ1") + c("QEZ2") * df + c("QEZ3") * df * df
    E = np.minimum(E * (1 + (c("QEZ4") + c("QEZ5") * g) * (2 / np.pi) * np.arctan(C * B * x)), 1.0)
    trail = D * cosine(B, C, E, equivalent(x, ratio, q.kappa)) * q.cosine
    Br = c("QBZ9") * s("LKY") / nonzero(q.mu_y) + c("QBZ10") * lateral.B * lateral.C
    Dr = (c("QDZ6") + c("QDZ7") * df) * s("LRES") + (c("QDZ8") + c("QDZ9") * df) * g
    turned = equivalent(q.a + lateral.residual_shift, ratio, q.kappa)
    residual = FZ * UNLOADED_RADIUS * q.mu_y * Dr * np.cos(np.arctan(Br * turned)) * q.cosine
    return as_array(residual - trail * FY)


MODEL = magic_formula(
    name="mf52",
    title="Magic Formula 5.2 (PAC2002)",
    reference="Pacejka, Tyre and Vehicle Dynamics (2002), eq. 4.E1 to 4.E78",
    valid="within the loads, angles and slips of the data; one pressure",
    parameters=MF52,
    evaluator=forces,
)
