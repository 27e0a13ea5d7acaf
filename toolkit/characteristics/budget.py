"""The sources of uncertainty that the budget of a characteristic names, and the columns that show them."""

from __future__ import annotations

from dataclasses import dataclass

CALIBRATION = "calibration"
CELL_ZERO = "cell zero"
TARE = "tare"
CORRECTION = "machine correction"
ANGLE_ZERO = "slip angle zero"
ANGLE_SCALE = "slip angle scale"
ANGLE_SCATTER = "slip angle scatter"
LOAD = "load"
PRESSURE = "pressure"
REPEATABILITY = "repeatability"
FIT = "fit"


@dataclass(frozen=True, slots=True, kw_only=True)
class BudgetColumn:
    """A column of a printed budget: the sources that it adds in quadrature, and what they are."""

    name: str
    sources: tuple[str, ...]
    text: str


COLUMNS = (
    BudgetColumn(
        name="calibration",
        sources=(CALIBRATION,),
        text="calibration record: fit and what its session stated",
    ),
    BudgetColumn(
        name="zero",
        sources=(CELL_ZERO, TARE),
        text="zero of the cells: an open one, or the scatter of the tare",
    ),
    BudgetColumn(name="SA_zero", sources=(ANGLE_ZERO,), text="zero of the slip angle"),
    BudgetColumn(name="SA_scale", sources=(ANGLE_SCALE,), text="scale of the slip angle"),
    BudgetColumn(name="load_cell", sources=(LOAD,), text="load"),
    BudgetColumn(name="pressure", sources=(PRESSURE,), text="inflation pressure"),
    BudgetColumn(
        name="repeatability",
        sources=(REPEATABILITY, ANGLE_SCATTER),
        text="scatter of the rows within each block",
    ),
    BudgetColumn(
        name="fit",
        sources=(FIT,),
        text="scatter of the blocks about the curves beyond that of their rows",
    ),
)

# What makes uncertain whatever is read off the fitted curves.
CURVE_BUDGET = (
    CALIBRATION,
    CELL_ZERO,
    TARE,
    CORRECTION,
    ANGLE_ZERO,
    ANGLE_SCALE,
    LOAD,
    PRESSURE,
    REPEATABILITY,
    FIT,
)
# Of the measured steps themselves: their slip angles scatter too.
STEP_BUDGET = (*CURVE_BUDGET, ANGLE_SCATTER)
