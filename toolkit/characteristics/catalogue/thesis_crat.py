"""CRAT by the formula of the source document, for comparison with its figures."""

from __future__ import annotations

from toolkit.characteristics.characteristic import CURVE_BUDGET, PULL_THESIS, Characteristic
from toolkit.characteristics.reading import COVERS_ZERO, CURVE_MZ, half_at_zero

CHARACTERISTIC = Characteristic(
    name="thesis_CRAT",
    symbol="CRAT_src",
    title="CRAT, the thesis's formula",
    definition=(
        "CRAT by the source document's formula, which is PRAT by symmetry in the axes of this machine."
    ),
    formula="(MZ_forward + MZ_reverse) / 2 at SA = 0",
    term="conicity residual aligning torque",
    source="source document, 6.2.1",
    channel="MZ",
    unit="N*m",
    digits=2,
    order=6,
    table=PULL_THESIS,
    read=half_at_zero,
    sign=1.0,
    needs=(COVERS_ZERO, CURVE_MZ),
    budget=CURVE_BUDGET,
    column_text="CRAT by the thesis's formula",
)
