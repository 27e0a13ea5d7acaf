"""The units of a tire property file: [UNITS] read, dimensional entries in SI.

Coefficients and scale factors are pure numbers, those that multiply an angle per radian whatever
ANGLE says. What is not listed here has no known dimension and keeps the file's number.
"""

from __future__ import annotations

import math

from toolkit.errors import UnitError
from toolkit.tires.tir import TirFile

_LBF = 0.45359237 * 9.80665
_INCH = 0.0254
_KNOWN: dict[str, dict[str, float]] = {
    "LENGTH": {
        "meter": 1.0, "metre": 1.0, "meters": 1.0, "m": 1.0, "mm": 1e-3, "millimeter": 1e-3,
        "millimetre": 1e-3, "cm": 1e-2, "centimeter": 1e-2, "km": 1e3, "kilometer": 1e3, "inch": _INCH,
        "in": _INCH,
        "foot": 12 * _INCH, "ft": 12 * _INCH,
    },
    "FORCE": {
        "newton": 1.0, "newtons": 1.0, "n": 1.0, "kn": 1e3, "knewton": 1e3, "kilonewton": 1e3,
        "lbf": _LBF, "pound_force": _LBF, "pound": _LBF, "kgf": 9.80665, "kg_force": 9.80665,
        "kilogram_force": 9.80665, "dan": 10.0,
    },
    "ANGLE": {
        "radian": 1.0, "radians": 1.0, "rad": 1.0, "degree": math.pi / 180, "degrees": math.pi / 180,
        "deg": math.pi / 180,
    },
    "MASS": {
        "kg": 1.0, "kilogram": 1.0, "g": 1e-3, "gram": 1e-3, "tonne": 1e3, "lbm": 0.45359237,
        "pound_mass": 0.45359237, "slug": _LBF / (12 * _INCH),
    },
    "TIME": {
        "second": 1.0, "seconds": 1.0, "sec": 1.0, "s": 1.0, "ms": 1e-3, "millisecond": 1e-3, "minute": 60.0,
        "min": 60.0, "hour": 3600.0, "h": 3600.0,
    },
    "PRESSURE": {
        "pascal": 1.0, "pa": 1.0, "kpa": 1e3, "kilopascal": 1e3, "mpa": 1e6, "bar": 1e5,
        "psi": _LBF / _INCH**2,
    },
}  # fmt: skip
SI = {
    "LENGTH": "meter", "FORCE": "newton", "ANGLE": "radians", "MASS": "kg", "TIME": "second",
    "PRESSURE": "pascal",
}  # fmt: skip

_DIMENSIONS: dict[str, tuple[str, ...]] = {
    "LENGTH": ("UNLOADED_RADIUS", "WIDTH", "RIM_RADIUS", "RIM_WIDTH", "BOTTOM_OFFST"),
    "FORCE": ("FNOMIN", "FZMIN", "FZMAX"),
    "ANGLE": ("ALPMIN", "ALPMAX", "CAMMIN", "CAMMAX"),
    "PRESSURE": ("NOMPRES", "INFLPRES", "PRESMIN", "PRESMAX"),
    "LENGTH/TIME": ("LONGVL", "VXLOW"),
    "FORCE/LENGTH": (
        "VERTICAL_STIFFNESS", "BOTTOM_STIFF", "LONGITUDINAL_STIFFNESS", "LATERAL_STIFFNESS",
    ),
    "FORCE*TIME/LENGTH": ("VERTICAL_DAMPING",),
    "MASS": ("MASS",),
}  # fmt: skip
_DIMENSION = {key: dimension for dimension, keys in _DIMENSIONS.items() for key in keys}


def factors(tir: TirFile) -> dict[str, float]:
    """Return the factor to SI of each kind of unit; SI where the file names none.

    Raises
    ------
    UnitError
        a unit's spelling is not known
    """
    stated = tir.section("UNITS")
    scales = {}
    for kind, table in _KNOWN.items():
        text = stated.get(kind, SI[kind])
        factor = table.get(str(text).strip().lower())
        if factor is None:
            raise UnitError(
                f"the tire file's unit of {kind} is not known", where=f"{tir.where}, [UNITS]", got=text,
                expected=", ".join(table), next_step=f"correct {kind} in [UNITS]", rule="unknown-unit",
            )  # fmt: skip
        scales[kind] = factor
    return scales


def scale(key: str, units: dict[str, float]) -> float | None:
    """Return the factor to SI of an entry, None where its dimension is not known."""
    dimension = _DIMENSION.get(key)
    if dimension is None:
        return None
    above, _, below = dimension.partition("/")
    product = 1.0
    for kind in above.split("*"):
        product *= units[kind]
    return product / units[below] if below else product


def si_number(tir: TirFile, key: str, default: float | None = None) -> float:
    """Return a dimensional entry in SI; errors as `TirFile.number`."""
    if tir.get(key) is None and default is not None:
        return default
    return tir.number(key) * (scale(key, factors(tir)) or 1.0)
