"""Conicity: the side force that a cone would have."""

from __future__ import annotations

from toolkit.characteristics.characteristic import CURVE_BUDGET, PULL, Characteristic, Figure
from toolkit.characteristics.reading import COVERS_ZERO, CURVE_FY, half_at_zero

_FIGURE = Figure(name="conicity", title="conicity", text="conicity against load")

CHARACTERISTIC = Characteristic(
    name="conicity",
    symbol="FY_con",
    title="conicity",
    definition=(
        "Side force at zero slip angle that points to the same side of the tire in both directions "
        "of rotation, as that of a cone."
    ),
    formula="(FY_forward - FY_reverse) / 2 at SA = 0; (F + R) / 2 in machine-fixed axes",
    term="conicity force",
    source="SAE J670; source document",
    channel="FY",
    unit="N",
    digits=1,
    order=1,
    table=PULL,
    read=half_at_zero,
    sign=-1.0,
    needs=(COVERS_ZERO, CURVE_FY),
    budget=CURVE_BUDGET,
    column_text="conicity",
    figure=_FIGURE,
    compared=True,
    comparison_figure=_FIGURE,
    summary="conicity",
    summary_text="conicity there",
    console_heading="conicity",
)
