"""What is compared, in the order of the source document's figures 6.6 to 6.29."""

from __future__ import annotations

import math

from toolkit.comparison.model import Quantity

PER_DEGREE = math.pi / 180  # per rad -> per deg

CHARACTERISTICS: tuple[Quantity, ...] = (
    Quantity(name="conicity", title="conicity", unit="N"),
    Quantity(name="plysteer", title="plysteer", unit="N"),
    Quantity(name="CRAT", title="CRAT", unit="N*m"),
    Quantity(name="PRAT", title="PRAT at 0 deg", unit="N*m"),
    Quantity(name="PRAT_at_FY_zero", title="PRAT at FY = 0", unit="N*m"),
    Quantity(
        name="secant_cornering", title="cornering stiffness, ±1 deg secant", unit="N/deg", factor=PER_DEGREE
    ),
    Quantity(
        name="slope_cornering", title="cornering stiffness, slope at 0 deg", unit="N/deg", factor=PER_DEGREE
    ),
    Quantity(
        name="secant_aligning", title="aligning stiffness, ±1 deg secant", unit="N*m/deg", factor=PER_DEGREE
    ),
    Quantity(
        name="slope_aligning", title="aligning stiffness, slope at 0 deg", unit="N*m/deg", factor=PER_DEGREE
    ),
)
CURVES: tuple[Quantity, ...] = (
    Quantity(name="FY", title="FY", unit="N"),
    Quantity(name="MZ", title="MZ", unit="N*m"),
)
QUANTITIES = {one.name: one for one in (*CHARACTERISTICS, *CURVES)}
