"""PRAT at FY = 0 by the formula of the source document."""

from __future__ import annotations

from toolkit.characteristics.characteristic import CURVE_BUDGET, PULL_THESIS, Characteristic
from toolkit.characteristics.reading import COVERS_ZERO, CURVE_FY, CURVE_MZ, ZERO_OF_FY, half_without_force

CHARACTERISTIC = Characteristic(
    name="thesis_PRAT_at_FY_zero",
    symbol="PRAT_0src",
    title="PRAT at FY = 0, the thesis's formula",
    definition=(
        "Half the difference of the aligning moments of both directions of rotation, each at the "
        "slip angle at which its own side force is zero."
    ),
    formula="(MZ_forward - MZ_reverse) / 2, each at its own FY = 0",
    term="plysteer residual aligning torque",
    source="source document, 6.2.1",
    channel="MZ",
    unit="N*m",
    digits=2,
    order=8,
    table=PULL_THESIS,
    read=half_without_force,
    sign=-1.0,
    needs=(COVERS_ZERO, CURVE_FY, CURVE_MZ, ZERO_OF_FY),
    budget=CURVE_BUDGET,
    column_text="PRAT by the thesis's formula on MZ at FY = 0",
)
