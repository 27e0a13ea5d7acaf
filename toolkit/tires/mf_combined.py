"""What MF 5.2 and MF 6.x share: longitudinal force, weights of combined slip, equivalent slip angles.

Pacejka, Tire and Vehicle Dynamics, 3rd ed. (2012): FX 4.E9 to 4.E18, combined FX 4.E50 to 4.E57,
combined FY 4.E58 to 4.E67, arm of FX 4.E76. MF 5.2 has no pressure, no RBX3 and no RBY4: `mf_versions`
keeps them out. The curvature factors are limited to 1.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.tires.recorded import as_array
from toolkit.tires.slip import State, cosine, nonzero, readers, sine

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Forces:
    """FX, FY [N], MZ [N·m], arrays of one shape, ISO-W."""

    FX: Array
    FY: Array
    MZ: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Longitudinal:
    """FX [N] of pure longitudinal slip and its stiffness K [N]."""

    FX: Array
    K: Array


def longitudinal(p: Mapping[str, float], q: State) -> Longitudinal:
    """Return the force of pure longitudinal slip (4.E9 to 4.E18)."""
    c, s = readers(p)
    x = q.kappa + (c("PHX1") + c("PHX2") * q.df) * s("LHX")
    C = c("PCX1") * s("LCX")
    mu = (c("PDX1") + c("PDX2") * q.df) * (1 + c("PPX3") * q.dp + c("PPX4") * q.dp**2)
    D = mu * (1 - c("PDX3") * q.g**2) * q.mu_x * q.FZ
    E = (c("PEX1") + c("PEX2") * q.df + c("PEX3") * q.df**2) * (1 - c("PEX4") * np.sign(x)) * s("LEX")
    K = q.FZ * (c("PKX1") + c("PKX2") * q.df) * np.exp(c("PKX3") * q.df)
    K = K * (1 + c("PPX1") * q.dp + c("PPX2") * q.dp**2) * s("LKX")
    Sv = q.FZ * (c("PVX1") + c("PVX2") * q.df) * s("LVX") * q.mu_x
    return Longitudinal(FX=D * sine(K / nonzero(C * D), C, np.minimum(E, 1.0), x) + Sv, K=K)


def weight_x(p: Mapping[str, float], q: State) -> Array:
    """Return G_xa, by which slip angle lowers FX (4.E51 to 4.E57)."""
    c, s = readers(p)
    B = (c("RBX1") + c("RBX3") * q.g**2) * np.cos(np.arctan(c("RBX2") * q.kappa)) * s("LXAL")
    C, E = c("RCX1"), np.minimum(c("REX1") + c("REX2") * q.df, 1.0)
    return cosine(B, C, E, q.a + c("RHX1")) / nonzero(cosine(B, C, E, c("RHX1")))


def weight_y(p: Mapping[str, float], q: State) -> Array:
    """Return G_yk, by which longitudinal slip lowers FY (4.E59 to 4.E65)."""
    c, s = readers(p)
    B = (c("RBY1") + c("RBY4") * q.g**2) * np.cos(np.arctan(c("RBY2") * (q.a - c("RBY3")))) * s("LYKA")
    C, E = c("RCY1"), np.minimum(c("REY1") + c("REY2") * q.df, 1.0)
    shift = c("RHY1") + c("RHY2") * q.df
    return cosine(B, C, E, q.kappa + shift) / nonzero(cosine(B, C, E, shift))


def kappa_force(p: Mapping[str, float], q: State, friction: Array) -> Array:
    """Return S_Vyk [N], the side force that kappa induces (4.E66, 4.E67); ``friction`` is mu_y Fz [N]."""
    c, s = readers(p)
    D = friction * (c("RVY1") + c("RVY2") * q.df + c("RVY3") * q.g) * np.cos(np.arctan(c("RVY4") * q.a))
    return as_array(D * np.sin(c("RVY5") * np.arctan(c("RVY6") * q.kappa)) * s("LVYKA"))


def equivalent(slip: Array, ratio: Array, kappa: Array) -> Array:
    """Return the slip angle that stands for both slips; ``ratio`` is K_x / K_y.

    arctan sqrt(tan^2(slip) + ratio^2 kappa^2) sgn(slip): Besselink, Schmeitz, Pacejka, Vehicle System
    Dynamics 48 (2010), A54 and A55. At kappa = 0 it is the slip angle itself. From a quarter turn on,
    where the tangent would fold it back, nothing is added.
    """
    inside = np.abs(slip) < np.pi / 2
    joined = np.arctan(np.hypot(np.tan(np.where(inside, slip, 0.0)), ratio * kappa))
    return np.where(inside & (kappa != 0), np.copysign(joined, slip), slip)


def arm(p: Mapping[str, float], q: State, *, FY: Array, UNLOADED_RADIUS: float) -> Array:
    """Return s [m], the arm of FX about the contact centre (4.E76)."""
    c, s = readers(p)
    share = c("SSZ1") + c("SSZ2") * FY / q.F0 + (c("SSZ3") + c("SSZ4") * q.df) * q.g
    return UNLOADED_RADIUS * share * s("LS")
