"""Aligning stiffness by the slope of the fitted curve."""

from __future__ import annotations

from toolkit.characteristics.characteristic import (
    ALIGNING_FIGURE,
    CURVE_BUDGET,
    SLOPE_LABEL,
    STIFFNESS,
    Characteristic,
)
from toolkit.characteristics.reading import CURVE_MZ, SLOPE_MZ, slope

CHARACTERISTIC = Characteristic(
    name="slope_aligning",
    symbol="C_MZ",
    title="aligning stiffness, slope at 0 deg",
    definition=("Slope of the fitted curve of the aligning moment over the slip angle, at zero slip angle."),
    formula="dMZ/dSA at SA = 0",
    term="aligning stiffness",
    source="SAE J670",
    channel="MZ",
    unit="N*m/rad",
    digits=2,
    order=4,
    table=STIFFNESS,
    read=slope,
    sign=1.0,
    needs=(CURVE_MZ, SLOPE_MZ),
    budget=CURVE_BUDGET,
    column="aligning_slope",
    column_text="aligning stiffness, slope of the curve at 0 deg",
    figure=ALIGNING_FIGURE,
    label=SLOPE_LABEL,
    compared=True,
    console_heading="slope C_MZ",
)
