"""Residual aligning torque of the forward run alone."""

from __future__ import annotations

from toolkit.characteristics.characteristic import CURVE_BUDGET, PULL_THESIS, Characteristic
from toolkit.characteristics.reading import COVERS_ZERO, CURVE_FY, CURVE_MZ, ZERO_OF_FY, residual_moment

CHARACTERISTIC = Characteristic(
    name="residual_forward",
    symbol="RAT_f",
    title="residual aligning torque, forward",
    definition=(
        "Aligning moment of the forward run at the slip angle at which its side force is zero; one "
        "direction alone cannot tell CRAT from PRAT."
    ),
    formula="MZ_forward at FY_forward = 0",
    term="residual aligning torque",
    source="SAE J670; source document",
    channel="MZ",
    unit="N*m",
    digits=2,
    order=9,
    table=PULL_THESIS,
    read=residual_moment,
    runs=("forward",),
    needs=(COVERS_ZERO, CURVE_FY, CURVE_MZ, ZERO_OF_FY),
    budget=CURVE_BUDGET,
    column_text="residual aligning torque, forward, MZ at FY = 0",
)
