"""Magic Formula of one channel at one load.

    y = D sin(C arctan(B x - E (B x - arctan B x))) + Sv,    x = SA + Sh

Source: Bakker, Nyborg and Pacejka, SAE 870421 (1987); Pacejka, Tire and Vehicle Dynamics, 3rd ed., eq. 4.6
to 4.8. The slope is B C D at x = 0, that is at SA = -Sh; the slope at SA = 0 differs and is the stiffness.
The peak is D where C >= 1 and the argument reaches pi/2; far out y tends to D sin(C pi/2) for E < 1.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from toolkit.arrays import Array
from toolkit.tires.model import ParameterSpec

# The derivative of an analytic function by a complex step has no cancellation: it is exact.
_COMPLEX_STEP = 1e-30


class MagicFormula:
    """The model as the catalogue holds it."""

    name = "magic_formula"
    title = "Magic Formula at one load"
    reference = "Bakker, Nyborg, Pacejka, SAE 870421 (1987); Pacejka (2012) eq. 4.6-4.8"
    fitter = "toolkit.tires.fit"
    reads = ()
    channels = ("FY", "MZ")
    parameters = (
        ParameterSpec(name="B", unit="1/rad", bounds="B x span 0.05 to 50", text="stiffness factor"),
        ParameterSpec(name="C", unit="1", bounds="0 to 4", text="shape factor"),
        ParameterSpec(name="D", unit="y", bounds="|D| <= 3 max|y|", text="peak value; carries the sign"),
        ParameterSpec(name="E", unit="1", bounds="-20 to 1", text="curvature factor"),
        ParameterSpec(name="Sh", unit="rad", bounds="|Sh| <= 10 deg", text="horizontal shift"),
        ParameterSpec(name="Sv", unit="y", bounds="|Sv| <= max|y|", text="vertical shift"),
    )

    def value(self, values: ArrayLike, SA: ArrayLike) -> Array:
        """Return y [N or N·m] at slip angles [rad]; see `value`."""
        return value(values, SA)

    def slope(self, values: ArrayLike, SA: ArrayLike) -> Array:
        """Return dy/dSA [N/rad or N·m/rad]; see `slope`."""
        return slope(values, SA)

    def jacobian(self, values: ArrayLike, SA: ArrayLike) -> Array:
        """Return dy/dparameter (6, ...); see `jacobian`."""
        return jacobian(values, SA)

    def slope_jacobian(self, values: ArrayLike, SA: ArrayLike) -> Array:
        """Return d(dy/dSA)/dparameter (6, ...); see `slope_jacobian`."""
        return slope_jacobian(values, SA)


def value(values: ArrayLike, SA: ArrayLike) -> Array:
    """Return y of (B, C, D, E, Sh, Sv) [1/rad, 1, N, 1, rad, N] at SA [rad].

    Each parameter may be an array; they broadcast with SA.

    >>> float(value((10.0, 1.3, -4000.0, 0.0, 0.0, 25.0), 0.0))
    25.0
    """
    B, C, D, E, Sh, Sv = np.asarray(values)
    z = B * (np.asarray(SA) + Sh)
    result: Array = D * np.sin(C * np.arctan(z - E * (z - np.arctan(z)))) + Sv
    return result


def slope(values: ArrayLike, SA: ArrayLike) -> Array:
    """Return dy/dSA [N/rad or N·m/rad] of (B, C, D, E, Sh, Sv) at SA [rad].

    >>> round(float(slope((10.0, 1.3, -4000.0, 0.5, 0.0, 7.0), 0.0)), 6)  # B C D
    -52000.0
    """
    B, C, D, E, Sh, _ = np.asarray(values)
    z = B * (np.asarray(SA) + Sh)
    psi = z - E * (z - np.arctan(z))
    inner = B * (1 - E * (z * z / (1 + z * z)))
    result: Array = D * np.cos(C * np.arctan(psi)) * C / (1 + psi * psi) * inner
    return result


def jacobian(values: ArrayLike, SA: ArrayLike) -> Array:
    """Return the derivatives of y by (B, C, D, E, Sh, Sv), stacked in front: (6, ...)."""
    B, C, D, E, Sh, _ = np.asarray(values)
    x = np.asarray(SA) + Sh
    z = B * x
    bend = z - np.arctan(z)
    psi = z - E * bend
    phi = np.arctan(psi)
    s, c = np.sin(C * phi), np.cos(C * phi)
    outer = D * c * C / (1 + psi * psi)
    inner = outer * (1 - E * (z * z / (1 + z * z)))
    return np.stack(
        np.broadcast_arrays(inner * x, D * c * phi, s, -outer * bend, inner * B, np.ones_like(s)), axis=0
    )


def slope_jacobian(values: ArrayLike, SA: ArrayLike) -> Array:
    """Return the derivatives of dy/dSA by (B, C, D, E, Sh, Sv), stacked in front: (6, ...)."""
    base = np.asarray(values, dtype=np.complex128)
    rows = []
    for index in range(len(base)):
        moved = base.copy()
        moved[index] += 1j * _COMPLEX_STEP
        rows.append(np.imag(slope(moved, SA)) / _COMPLEX_STEP)
    return np.stack(rows, axis=0)


MODEL = MagicFormula()
