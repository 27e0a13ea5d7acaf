"""PRAT by the formula of the source document, for comparison with its figures."""

from __future__ import annotations

from toolkit.characteristics.characteristic import CURVE_BUDGET, PULL_THESIS, Characteristic
from toolkit.characteristics.reading import COVERS_ZERO, CURVE_MZ, half_at_zero

CHARACTERISTIC = Characteristic(
    name="thesis_PRAT",
    symbol="PRAT_src",
    title="PRAT, the thesis's formula",
    definition=(
        "PRAT by the source document's formula, which is CRAT by symmetry in the axes of this machine."
    ),
    formula="(MZ_forward - MZ_reverse) / 2 at SA = 0",
    term="plysteer residual aligning torque",
    source="source document, 6.2.1",
    channel="MZ",
    unit="N*m",
    digits=2,
    order=7,
    table=PULL_THESIS,
    read=half_at_zero,
    sign=-1.0,
    needs=(COVERS_ZERO, CURVE_MZ),
    budget=CURVE_BUDGET,
    column_text="PRAT by the thesis's formula",
)
