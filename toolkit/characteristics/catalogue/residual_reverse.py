"""Residual aligning torque of the reversed run alone."""

from __future__ import annotations

from toolkit.characteristics.characteristic import CURVE_BUDGET, PULL_THESIS, Characteristic
from toolkit.characteristics.reading import COVERS_ZERO, CURVE_FY, CURVE_MZ, ZERO_OF_FY, residual_moment

CHARACTERISTIC = Characteristic(
    name="residual_reverse",
    symbol="RAT_r",
    title="residual aligning torque, reverse",
    definition=(
        "Aligning moment of the reversed run at the slip angle at which its side force is zero; one "
        "direction alone cannot tell CRAT from PRAT."
    ),
    formula="MZ_reverse at FY_reverse = 0",
    term="residual aligning torque",
    source="SAE J670; source document",
    channel="MZ",
    unit="N*m",
    digits=2,
    order=10,
    table=PULL_THESIS,
    read=residual_moment,
    runs=("reverse",),
    needs=(COVERS_ZERO, CURVE_FY, CURVE_MZ, ZERO_OF_FY),
    budget=CURVE_BUDGET,
    column_text="residual aligning torque, reverse, MZ at FY = 0",
)
