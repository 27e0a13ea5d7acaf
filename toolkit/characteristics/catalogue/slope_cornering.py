"""Cornering stiffness by the slope of the fitted curve."""

from __future__ import annotations

from toolkit.characteristics.characteristic import (
    CORNERING_FIGURE,
    CURVE_BUDGET,
    SLOPE_LABEL,
    STIFFNESS,
    Characteristic,
)
from toolkit.characteristics.reading import CURVE_FY, SLOPE_FY, slope

CHARACTERISTIC = Characteristic(
    name="slope_cornering",
    symbol="C_FY",
    title="cornering stiffness, slope at 0 deg",
    definition=(
        "Negative slope of the fitted curve of the side force over the slip angle, at zero slip angle."
    ),
    formula="-dFY/dSA at SA = 0",
    term="cornering stiffness",
    source="SAE J670",
    channel="FY",
    unit="N/rad",
    digits=1,
    order=3,
    table=STIFFNESS,
    read=slope,
    sign=-1.0,
    needs=(CURVE_FY, SLOPE_FY),
    budget=CURVE_BUDGET,
    column="cornering_slope",
    column_text="cornering stiffness, slope of the curve at 0 deg",
    figure=CORNERING_FIGURE,
    label=SLOPE_LABEL,
    compared=True,
    console_heading="slope C_FY",
)
