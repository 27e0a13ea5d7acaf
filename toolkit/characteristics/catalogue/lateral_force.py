"""Lateral force at the slip angles of the protocol."""

from __future__ import annotations

from toolkit.characteristics.characteristic import AT_ANGLES, CURVE_BUDGET, Characteristic
from toolkit.characteristics.reading import CURVE_FY, curve_value

CHARACTERISTIC = Characteristic(
    name="FY",
    symbol="FY",
    title="FY",
    definition=(
        "Lateral force at a slip angle of the protocol, off the fitted curve of one load and direction."
    ),
    formula="FY(SA)",
    term="lateral force",
    source="SAE J670",
    channel="FY",
    unit="N",
    digits=1,
    order=1,
    table=AT_ANGLES,
    read=curve_value,
    needs=(CURVE_FY,),
    budget=CURVE_BUDGET,
    column_text="lateral force",
    compared=True,
)
