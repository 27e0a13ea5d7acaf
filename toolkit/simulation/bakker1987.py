"""A passenger-car tire: the Magic Formula and coefficients of Bakker, Nyborg and Pacejka (1987).

    y = D sin(C arctan(B phi)) + Sv          x = slip angle + Sh
    phi = (1 - E) x + (E / B) arctan(B x)

E. Bakker, L. Nyborg, H. B. Pacejka, "Tyre modelling for use in vehicle dynamics studies", SAE paper
870421 (1987), tables of the lateral force and the aligning moment. In the paper the load is in kN, the
slip and inclination angles are in deg, the force in N and the moment in N·m; a positive slip angle gives
FY > 0 and MZ < 0 (adapted SAE). An inclination angle shifts the curves (a9 to a11), takes a12 of B for
each degree and divides E by 1 - a13 for each degree.

Here everything is SI; the paper's units live inside the two functions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

SOURCE = "Bakker, Nyborg, Pacejka: SAE 870421 (1987)"


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


def lateral_force(*, slip_angle: ArrayLike, load: ArrayLike, camber: ArrayLike = 0.0) -> NDArray[np.float64]:
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


def aligning_moment(
    *, slip_angle: ArrayLike, load: ArrayLike, camber: ArrayLike = 0.0
) -> NDArray[np.float64]:
    """Return MZ [N·m] in adapted-SAE axes; parameters as in `lateral_force`.

    >>> import math
    >>> round(float(aligning_moment(slip_angle=math.radians(1e-4), load=3700.0)) / 1e-4, 1)
    -23.7
    """
    kN = np.maximum(np.asarray(load, dtype=np.float64), 0.0) / 1000.0
    a3, a4, a5 = ALIGNING.a[2:5]
    return _curve(ALIGNING, (a3 * kN**2 + a4 * kN) / np.exp(a5 * kN), kN, slip_angle, camber)


def _curve(
    table: Coefficients, BCD: NDArray[np.float64], kN: NDArray[np.float64], slip: ArrayLike, camber: ArrayLike
) -> NDArray[np.float64]:
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
    force: NDArray[np.float64] = D * np.sin(table.C * np.arctan(B * phi)) + (a10 * kN**2 + a11 * kN) * gamma
    return force
