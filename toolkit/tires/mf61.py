"""Magic Formula 6.1, pure lateral slip: FY and MZ over slip angle, load, camber and pressure.

Axes ISO-W, SI. Equations: Pacejka, Tire and Vehicle Dynamics, 3rd ed. (2012), 4.E19 to 4.E49, with the
peak trail, trail stiffness and camber terms as in Besselink, Schmeitz, Pacejka, Vehicle System Dynamics 48
(2010), A58 and A60: the book's 4.E40 names QBZ6, which no tire file has. Turn slip factors are one,
alpha* = tan(alpha), gamma* = sin(gamma), E_y and E_t are limited to 1, and F_y in M_z is the one at zero
camber. A coefficient that is absent is zero, a scale factor one, PKY4 two.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]

LATERAL = tuple(
    "PCY1 PDY1 PDY2 PDY3 PEY1 PEY2 PEY3 PEY4 PEY5 PKY1 PKY2 PKY3 PKY4 PKY5 PKY6 PKY7 PHY1 PHY2 PVY1 PVY2 "
    "PVY3 PVY4 PPY1 PPY2 PPY3 PPY4 PPY5".split()
)
ALIGNING = tuple(
    "QBZ1 QBZ2 QBZ3 QBZ4 QBZ5 QBZ9 QBZ10 QCZ1 QDZ1 QDZ2 QDZ3 QDZ4 QDZ6 QDZ7 QDZ8 QDZ9 QDZ10 QDZ11 QEZ1 QEZ2 "
    "QEZ3 QEZ4 QEZ5 QHZ1 QHZ2 QHZ3 QHZ4 PPZ1 PPZ2".split()
)
_TINY = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lateral:
    """FY [N] with what the aligning moment needs of it: B, C, and the shift of the residual moment [rad]."""

    FY: Array
    B: Array
    C: float
    residual_shift: Array


def lateral(
    p: Mapping[str, float],
    *,
    SA: ArrayLike,
    FZ: ArrayLike,
    FNOMIN: float,
    IA: ArrayLike = 0.0,
    pressure_change: ArrayLike = 0.0,
) -> Lateral:
    """Return FY [N] at slip angles [rad], loads [N], camber [rad]; arrays broadcast.

    Parameters
    ----------
    p : coefficients and scale factors by their names in a tire file
    FNOMIN : nominal load [N]
    pressure_change : (P - NOMPRES) / NOMPRES
    """
    c, s = _coefficients(p)
    FZ, dp = np.asarray(FZ, dtype=np.float64), np.asarray(pressure_change)
    F0 = FNOMIN * s("LFZO")
    df = (FZ - F0) / F0
    a, g = np.tan(SA), np.sin(IA)
    K = c("PKY1") * F0 * (1 + c("PPY1") * dp) * (1 - c("PKY3") * np.abs(g)) * s("LKY")
    K = K * np.sin(
        p.get("PKY4", 2.0) * np.arctan(FZ / F0 / ((c("PKY2") + c("PKY5") * g * g) * (1 + c("PPY2") * dp)))
    )
    K = np.where(np.abs(K) < _TINY, _TINY, K)
    Sv_camber = FZ * (c("PVY3") + c("PVY4") * df) * g * s("LKYC") * s("LMUY")
    K_camber = FZ * (c("PKY6") + c("PKY7") * df) * (1 + c("PPY5") * dp) * s("LKYC")
    Sh = (c("PHY1") + c("PHY2") * df) * s("LHY") + (K_camber * g - Sv_camber) / K
    Sv = FZ * (c("PVY1") + c("PVY2") * df) * s("LVY") * s("LMUY") + Sv_camber
    x = a + Sh
    C = c("PCY1") * s("LCY")
    mu = (c("PDY1") + c("PDY2") * df) * (1 + c("PPY3") * dp + c("PPY4") * dp * dp)
    D = mu * (1 - c("PDY3") * g * g) * s("LMUY") * FZ
    E = (c("PEY1") + c("PEY2") * df) * s("LEY")
    E = np.minimum(E * (1 + c("PEY5") * g * g - (c("PEY3") + c("PEY4") * g) * np.sign(x)), 1.0)
    CD = C * D
    B = K / np.where(np.abs(CD) < _TINY, _TINY, CD)
    z = B * x
    FY = D * np.sin(C * np.arctan(z - E * (z - np.arctan(z)))) + Sv
    return Lateral(FY=FY, B=B, C=C, residual_shift=Sh + Sv / K)


def aligning(
    p: Mapping[str, float],
    *,
    SA: ArrayLike,
    FZ: ArrayLike,
    FNOMIN: float,
    UNLOADED_RADIUS: float,
    IA: ArrayLike = 0.0,
    pressure_change: ArrayLike = 0.0,
) -> Array:
    """Return MZ [N·m]: minus the trail times FY at zero camber, plus the residual moment."""
    c, s = _coefficients(p)
    FZ, dp = np.asarray(FZ, dtype=np.float64), np.asarray(pressure_change)
    F0 = FNOMIN * s("LFZO")
    df = (FZ - F0) / F0
    a, g, cosine = np.tan(SA), np.sin(IA), np.cos(SA)
    upright = lateral(p, SA=SA, FZ=FZ, FNOMIN=FNOMIN, pressure_change=pressure_change)
    leaned = lateral(p, SA=SA, FZ=FZ, FNOMIN=FNOMIN, IA=IA, pressure_change=pressure_change)
    x = a + c("QHZ1") + c("QHZ2") * df + (c("QHZ3") + c("QHZ4") * df) * g
    B = (c("QBZ1") + c("QBZ2") * df + c("QBZ3") * df * df) * (1 + c("QBZ4") * g + c("QBZ5") * np.abs(g))
    B = B * s("LKY") / s("LMUY")
    C = c("QCZ1")
    D = FZ * (UNLOADED_RADIUS / F0) * (c("QDZ1") + c("QDZ2") * df) * (1 - c("PPZ1") * dp) * s("LTR")
    D = D * (1 + c("QDZ3") * g + c("QDZ4") * g * g)
    z = B * x
    E = c("QEZ1") + c("QEZ2") * df + c("QEZ3") * df * df
    E = np.minimum(E * (1 + (c("QEZ4") + c("QEZ5") * g) * (2 / np.pi) * np.arctan(C * z)), 1.0)
    trail = D * np.cos(C * np.arctan(z - E * (z - np.arctan(z)))) * cosine
    Br = c("QBZ9") * s("LKY") / s("LMUY") + c("QBZ10") * leaned.B * leaned.C
    camber = (c("QDZ8") + c("QDZ9") * df) * (1 + c("PPZ2") * dp) + (c("QDZ10") + c("QDZ11") * df) * np.abs(g)
    Dr = FZ * UNLOADED_RADIUS * s("LMUY")
    Dr = Dr * ((c("QDZ6") + c("QDZ7") * df) * s("LRES") + camber * g * s("LKZC"))
    residual = Dr * np.cos(np.arctan(Br * (a + leaned.residual_shift))) * cosine
    return np.asarray(residual - trail * upright.FY)


class _Reader:
    def __init__(self, p: Mapping[str, float], default: float) -> None:
        self._p, self._default = p, default

    def __call__(self, name: str) -> float:
        return self._p.get(name, self._default)


def _coefficients(p: Mapping[str, float]) -> tuple[_Reader, _Reader]:
    return _Reader(p, 0.0), _Reader(p, 1.0)
