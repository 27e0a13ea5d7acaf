"""Plysteer: the side force of a tire that rolls like one steered by a small angle."""

from __future__ import annotations

from toolkit.characteristics.characteristic import CURVE_BUDGET, PULL, Characteristic, Figure
from toolkit.characteristics.reading import COVERS_ZERO, CURVE_FY, half_at_zero

_FIGURE = Figure(name="plysteer", title="plysteer", text="plysteer against load")

CHARACTERISTIC = Characteristic(
    name="plysteer",
    symbol="FY_ply",
    title="plysteer",
    definition=(
        "Side force at zero slip angle that changes its side of the tire with the direction of "
        "rotation, as that of a tire steered by a small angle."
    ),
    formula="(FY_forward + FY_reverse) / 2 at SA = 0; (F - R) / 2 in machine-fixed axes",
    term="plysteer force",
    source="SAE J670; source document",
    channel="FY",
    unit="N",
    digits=1,
    order=2,
    table=PULL,
    read=half_at_zero,
    sign=1.0,
    needs=(COVERS_ZERO, CURVE_FY),
    budget=CURVE_BUDGET,
    column_text="plysteer",
    figure=_FIGURE,
    compared=True,
    comparison_figure=_FIGURE,
    summary="plysteer",
    summary_text="plysteer there",
    console_heading="plysteer",
)
