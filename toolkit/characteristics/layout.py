"""The tables that characteristics are columns of, and the figures that several of them share."""

from __future__ import annotations

from toolkit.characteristics.characteristic import Figure, WideTable

STIFFNESS = WideTable(
    name="stiffness",
    scope="direction",
    text="cornering and aligning stiffness, one row a load and direction",
    place=1,
    answer="stiffness",
)
PULL = WideTable(
    name="pull",
    scope="load",
    text="pull characteristics by symmetry, one row a load",
    place=2,
    answer="pull",
)
PULL_THESIS = WideTable(
    name="pull_thesis",
    scope="load",
    text="the same by the thesis's formulas, and the single-direction residual moments",
    place=3,
    answer="pull",
)
AT_ANGLES = WideTable(
    name="at_angles",
    scope="angle",
    text="FY and MZ off the curves at the slip angles of the protocol, one row a load, direction and angle",
    place=4,
    answer="at_angles",
)

PRAT_FIGURE = Figure(
    name="prat",
    title="plysteer residual aligning torque",
    text="plysteer residual aligning torque against load, both definitions",
)
CORNERING_FIGURE = Figure(
    name="cornering_stiffness",
    title="cornering stiffness",
    text="cornering stiffness against load, secant and slope",
)
ALIGNING_FIGURE = Figure(
    name="aligning_stiffness",
    title="aligning stiffness",
    text="aligning stiffness against load, secant and slope",
)
SECANT_LABEL = "±1 deg secant"
SLOPE_LABEL = "slope at 0 deg"
