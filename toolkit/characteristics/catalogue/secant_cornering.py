"""Cornering stiffness by the secant through the +-1 deg steps."""

from __future__ import annotations

from toolkit.characteristics.characteristic import (
    CORNERING_FIGURE,
    SECANT_LABEL,
    STEP_BUDGET,
    STIFFNESS,
    Characteristic,
)
from toolkit.characteristics.reading import STEPS, secant

CHARACTERISTIC = Characteristic(
    name="secant_cornering",
    symbol="C_FY,1deg",
    title="cornering stiffness, ±1 deg secant",
    definition=(
        "Negative of the chord of the side force over the slip angle between the steps at +1 and -1 "
        "deg, each carried to its nominal angle along the fitted curve."
    ),
    formula="-(FY(+1 deg) - FY(-1 deg)) / 2 deg",
    term="cornering stiffness",
    source="SAE J670; source document, by the steps at +1 and -1 deg",
    channel="FY",
    unit="N/rad",
    digits=1,
    order=1,
    table=STIFFNESS,
    read=secant,
    sign=-1.0,
    needs=(STEPS,),
    budget=STEP_BUDGET,
    column="cornering_secant",
    column_text="cornering stiffness, +-1 deg secant",
    figure=CORNERING_FIGURE,
    label=SECANT_LABEL,
    compared=True,
    comparison_figure=CORNERING_FIGURE,
    summary="cornering_stiffness",
    summary_text="cornering stiffness there, +-1 deg secant, forward",
)
