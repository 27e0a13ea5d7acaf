"""The state of a rolling tire as the Magic Formula of tire files takes it: slips, camber, load, pressure.

Pacejka, Tire and Vehicle Dynamics, 3rd ed. (2012), 4.E1 to 4.E8: alpha* = tan(alpha) sgn(Vx) and
gamma* = sin(gamma); ``raw`` leaves both angles as they are, as MF-Tyre does.

Backward rolling is forward rolling seen from behind: after a half turn about z the contact point moves
forward again, the slip angle is the same (tan(alpha) = -Vy / Vx keeps both signs), camber and kappa change
theirs, and so do FX and FY, but not MZ. Hence the trail and the residual moment turn with Vx: 4.E6 gives the
trail the factor cos'(alpha) = Vx / V, 4.E47 gives the residual moment sgn(Vx). Here ``cosine`` is that
signed one, taken once. What is built into a tire (conicity, plysteer) and the difference between braking and
driving keep the sign that the file gives them: the equations do not say how they turn.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from toolkit.arrays import Array
from toolkit.tires.recorded import as_array

Angles = Literal["star", "raw"]
ANGLES: tuple[Angles, ...] = get_args(Angles)

TINY = 1e-12


class Reader:
    """Coefficients by name; what a file does not have is the default."""

    def __init__(self, p: Mapping[str, float], default: float) -> None:
        self._p, self._default = p, default

    def __call__(self, name: str) -> float:
        """Return the value of a name."""
        return self._p.get(name, self._default)


def readers(p: Mapping[str, float]) -> tuple[Reader, Reader]:
    """Return a reader of coefficients (absent: 0) and one of scale factors (absent: 1)."""
    return Reader(p, 0.0), Reader(p, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class State:
    """alpha*, the signed cosine of alpha, gamma*, kappa [1], load [N] and its change from the nominal.

    ``cosine`` is Vx / V (4.E6), negative for a tire that rolls backward.
    ``dp`` is (P - NOMPRES) / NOMPRES; ``mu_x``, ``mu_y`` the friction scale factors at the slip speed.
    """

    a: Array
    cosine: Array
    g: Array
    kappa: Array
    FZ: Array
    F0: float
    df: Array
    dp: Array
    mu_x: Array
    mu_y: Array

    def upright(self) -> State:
        """Return the same state at zero camber."""
        return replace(self, g=np.zeros_like(self.g))


def state(
    p: Mapping[str, float],
    *,
    SA: ArrayLike,
    FZ: ArrayLike,
    FNOMIN: float,
    IA: ArrayLike = 0.0,
    KAPPA: ArrayLike = 0.0,
    pressure_change: ArrayLike = 0.0,
    V: ArrayLike = 1.0,
    V0: float | None = None,
    angles: Angles = "star",
) -> State:
    """Return the state at SA, IA [rad], FZ [N], KAPPA [1], V [m/s]; arrays broadcast.

    Parameters
    ----------
    p : scale factors by their names in a tire file
    V : speed along the wheel's own direction of travel; Vx = V cos(alpha), whose sign turns alpha*, trail and
        residual moment, so that Vy goes on beyond a quarter turn; zero counts as forward
    V0 : the file's LONGVL [m/s]; with it and LMUV (4.E7) friction falls with the slip speed
    """
    s = Reader(p, 1.0)
    angle, load, camber = (as_array(column, np.float64) for column in (SA, FZ, IA))
    speed, kappa = as_array(V, np.float64), as_array(KAPPA, np.float64)
    F0 = FNOMIN * s("LFZO")
    # LMUV is the one scale that is off when it is absent: it divides by 1 + LMUV Vs / V0.
    decay = p.get("LMUV", 0.0)
    fade: Array = np.asarray(1.0)
    if decay and V0:
        fade = 1 / (1 + decay * np.abs(speed) * np.hypot(kappa, np.tan(angle)) / abs(V0))
    # Vx / V by 4.E6: beyond a quarter turn the wheel rolls the other way, though V keeps its sign.
    ahead = np.where(speed < 0, -1.0, 1.0) * np.cos(angle)
    direction = np.where(ahead < 0, -1.0, 1.0)
    a = direction * np.tan(angle)
    if angles == "raw":
        a = np.where(np.cos(angle) < 0, np.arctan(a), direction * angle)
    return State(
        a=a,
        cosine=ahead,
        g=np.sin(camber) if angles == "star" else camber,
        kappa=kappa,
        FZ=load,
        F0=F0,
        df=(load - F0) / F0,
        dp=as_array(pressure_change, np.float64),
        mu_x=s("LMUX") * fade,
        mu_y=s("LMUY") * fade,
    )


def nonzero(x: Array) -> Array:
    """Return x with zeros moved to a tiny number of their sign, to divide by."""
    return np.where(np.abs(x) < TINY, np.copysign(TINY, x), x)


def sine(B: ArrayLike, C: ArrayLike, E: ArrayLike, x: ArrayLike) -> Array:
    """Return sin(C arctan(Bx - E(Bx - arctan Bx)))."""
    return np.sin(_inner(B, C, E, x))


def cosine(B: ArrayLike, C: ArrayLike, E: ArrayLike, x: ArrayLike) -> Array:
    """Return cos(C arctan(Bx - E(Bx - arctan Bx)))."""
    return np.cos(_inner(B, C, E, x))


def _inner(B: ArrayLike, C: ArrayLike, E: ArrayLike, x: ArrayLike) -> Array:
    z = np.multiply(B, x)
    inner: Array = np.multiply(C, np.arctan(z - np.multiply(E, z - np.arctan(z))))
    return inner
