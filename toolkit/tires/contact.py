"""What the physical tire models share: slips, the contact patch, and how pressure is spread over it.

Source: Pacejka, Tire and Vehicle Dynamics, 3rd ed. (2012), 3.1 and 3.2. All in SAE axes: a slip angle SA > 0
gives FY < 0 and MZ > 0. The coordinate ``u`` along the patch runs from +1 at the leading edge to -1.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from toolkit.arrays import Array
from toolkit.tires.global_model import Rows
from toolkit.tires.recorded import as_array

_LOCKED = 1e-6  # 1 + KAPPA of a wheel that stands still: all slides, in the direction of the velocity
_ANGLE = np.deg2rad(89.0)


def slips(rows: Rows, turned: ArrayLike = 0.0) -> tuple[Array, Array]:
    """Return the theoretical slips of the rows (eq. 3.32): KAPPA/(1+KAPPA), tan(SA+turned)/(1+KAPPA).

    ``turned`` [rad] is an equivalent slip angle (plysteer, camber). Angles are limited to 89 deg.
    """
    rolling = np.maximum(np.abs(1.0 + rows.KAPPA), _LOCKED)
    angle = np.clip(rows.SA + as_array(turned), -_ANGLE, _ANGLE)
    return as_array(rows.KAPPA / rolling), as_array(np.tan(angle) / rolling)


def directed(sx: Array, sy: Array) -> tuple[Array, Array, Array]:
    """Return the size of a slip vector and its direction; (0, 0) where there is no slip."""
    size = np.hypot(sx, sy)
    safe = np.where(size > 0, size, 1.0)
    return size, sx / safe, sy / safe


def with_load(base: Any, change: Any, dfz: Array, bend: Any = 0.0) -> Array:
    """Return base exp(change dfz + bend dfz^2): ``base`` at FNOMIN, positive at every load.

    >>> float(with_load(2.0, -0.1, np.array(0.0)))
    2.0
    """
    return as_array(base * np.exp(change * dfz + bend * dfz**2))


def half_length(base: Any, exponent: Any, rows: Rows) -> Array:
    """Return half the contact length [m], base (FZ/FNOMIN)^exponent; 0 without load.

    The deflection of a tire is about proportional to its load and the patch is a chord: exponent 1/2.
    """
    return as_array(base * np.power(rows.FZ / rows.FNOMIN, exponent))


def bulged(u: ArrayLike, exponent: ArrayLike, skew: ArrayLike) -> Array:
    """Return the pressure (1 - |u|^exponent)(1 + skew u), not normalised.

    Exponent 2 is the parabola of the brush model, a large one a uniform pressure; skew > 0 moves the load
    towards the leading edge (|skew| < 1 keeps it positive).
    """
    u = as_array(u)
    return as_array((1.0 - np.power(np.abs(u), exponent)) * (1.0 + as_array(skew) * u))
