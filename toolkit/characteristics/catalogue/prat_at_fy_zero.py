"""PRAT at FY = 0: plysteer's aligning moment where the tire has no side force."""

from __future__ import annotations

from toolkit.characteristics.characteristic import CURVE_BUDGET, PRAT_FIGURE, PULL, Characteristic, Figure
from toolkit.characteristics.reading import COVERS_ZERO, CURVE_FY, CURVE_MZ, ZERO_OF_FY, half_without_force

CHARACTERISTIC = Characteristic(
    name="PRAT_at_FY_zero",
    symbol="PRAT_0",
    title="PRAT at FY = 0",
    definition=(
        "Mean of the aligning moments of both directions of rotation, each at the slip angle at "
        "which its own side force is zero; an error of the steering zero does not move it."
    ),
    formula="(MZ_forward + MZ_reverse) / 2, each at its own FY = 0",
    term="plysteer residual aligning torque",
    source="source document, 6.2.1: its second definition",
    channel="MZ",
    unit="N*m",
    digits=2,
    order=5,
    table=PULL,
    read=half_without_force,
    sign=1.0,
    needs=(COVERS_ZERO, CURVE_FY, CURVE_MZ, ZERO_OF_FY),
    budget=CURVE_BUDGET,
    column_text="the same at FY = 0",
    figure=PRAT_FIGURE,
    compared=True,
    comparison_figure=Figure(name="prat_at_fy_zero", title="plysteer residual aligning torque at FY = 0"),
    belt_sign=True,
    console_heading="PRAT at FY = 0",
)
