"""PRAT at 0 deg: the aligning moment that belongs to plysteer."""

from __future__ import annotations

from toolkit.characteristics.characteristic import CURVE_BUDGET, PRAT_FIGURE, PULL, Characteristic, Figure
from toolkit.characteristics.reading import COVERS_ZERO, CURVE_MZ, half_at_zero

CHARACTERISTIC = Characteristic(
    name="PRAT",
    symbol="PRAT",
    title="PRAT at 0 deg",
    definition=(
        "Aligning moment at zero slip angle that keeps its sign with the direction of rotation, in "
        "axes that follow the travel."
    ),
    formula="(MZ_forward + MZ_reverse) / 2 at SA = 0",
    term="plysteer residual aligning torque",
    source="source document, 6.2.1; its formula corrected by symmetry",
    channel="MZ",
    unit="N*m",
    digits=2,
    order=4,
    table=PULL,
    read=half_at_zero,
    sign=1.0,
    needs=(COVERS_ZERO, CURVE_MZ),
    budget=CURVE_BUDGET,
    column_text="plysteer residual aligning torque at 0 deg",
    figure=PRAT_FIGURE,
    compared=True,
    comparison_figure=Figure(name="prat", title="plysteer residual aligning torque at 0 deg"),
    belt_sign=True,
    summary="PRAT",
    summary_text="plysteer residual aligning torque there, at 0 deg",
    console_heading="PRAT",
)
