"""Aligning stiffness by the secant through the +-1 deg steps."""

from __future__ import annotations

from toolkit.characteristics.characteristic import (
    ALIGNING_FIGURE,
    SECANT_LABEL,
    STEP_BUDGET,
    STIFFNESS,
    Characteristic,
)
from toolkit.characteristics.reading import STEPS, secant

CHARACTERISTIC = Characteristic(
    name="secant_aligning",
    symbol="C_MZ,1deg",
    title="aligning stiffness, ±1 deg secant",
    definition=(
        "Chord of the aligning moment over the slip angle between the steps at +1 and -1 deg, each "
        "carried to its nominal angle along the fitted curve."
    ),
    formula="(MZ(+1 deg) - MZ(-1 deg)) / 2 deg",
    term="aligning stiffness",
    source="SAE J670; source document, by the steps at +1 and -1 deg",
    channel="MZ",
    unit="N*m/rad",
    digits=2,
    order=2,
    table=STIFFNESS,
    read=secant,
    sign=1.0,
    needs=(STEPS,),
    budget=STEP_BUDGET,
    column="aligning_secant",
    column_text="aligning stiffness, +-1 deg secant",
    figure=ALIGNING_FIGURE,
    label=SECANT_LABEL,
    compared=True,
    comparison_figure=ALIGNING_FIGURE,
    summary="aligning_stiffness",
    summary_text="aligning stiffness there, +-1 deg secant, forward",
)
