"""Aligning moment at the slip angles of the protocol."""

from __future__ import annotations

from toolkit.characteristics.characteristic import AT_ANGLES, CURVE_BUDGET, Characteristic
from toolkit.characteristics.reading import CURVE_MZ, curve_value

CHARACTERISTIC = Characteristic(
    name="MZ",
    symbol="MZ",
    title="MZ",
    definition=(
        "Aligning moment at a slip angle of the protocol, off the fitted curve of one load and direction."
    ),
    formula="MZ(SA)",
    term="aligning moment",
    source="SAE J670",
    channel="MZ",
    unit="N*m",
    digits=2,
    order=2,
    table=AT_ANGLES,
    read=curve_value,
    needs=(CURVE_MZ,),
    budget=CURVE_BUDGET,
    column_text="aligning moment",
    compared=True,
)
