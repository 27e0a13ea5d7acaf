"""CRAT: the aligning moment that belongs to conicity."""

from __future__ import annotations

from toolkit.characteristics.characteristic import CURVE_BUDGET, PULL, Characteristic, Figure
from toolkit.characteristics.reading import COVERS_ZERO, CURVE_MZ, half_at_zero

_FIGURE = Figure(
    name="crat",
    title="conicity residual aligning torque",
    text="conicity residual aligning torque against load",
)

CHARACTERISTIC = Characteristic(
    name="CRAT",
    symbol="CRAT",
    title="CRAT",
    definition=(
        "Aligning moment at zero slip angle that changes its sign with the direction of rotation, "
        "in axes that follow the travel."
    ),
    formula="(MZ_forward - MZ_reverse) / 2 at SA = 0",
    term="conicity residual aligning torque",
    source="source document, 6.2.1; its formula corrected by symmetry",
    channel="MZ",
    unit="N*m",
    digits=2,
    order=3,
    table=PULL,
    read=half_at_zero,
    sign=-1.0,
    needs=(COVERS_ZERO, CURVE_MZ),
    budget=CURVE_BUDGET,
    column_text="conicity residual aligning torque",
    figure=_FIGURE,
    compared=True,
    comparison_figure=_FIGURE,
    summary="CRAT",
    summary_text="conicity residual aligning torque there",
    console_heading="CRAT",
)
