"""What a characteristic declares: the facts of one file of `toolkit.characteristics.catalogue`.

Rows, answers, sheets, report tables, figures, tags, the comparison and ``toolkit explain`` read these facts;
nothing else names a characteristic.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from toolkit.channels import ROTATIONS, Rotation
from toolkit.units import printed

if TYPE_CHECKING:
    from toolkit.characteristics.groups import Channel, Direction
    from toolkit.characteristics.uncertain import Uncertain

Scope = Literal["load", "direction", "angle"]
BOTH = "both"

# SI unit -> unit as printed, and the factor from SI.
PRINTED: dict[str, tuple[str, float]] = {
    "N": ("N", 1.0),
    "N*m": ("N*m", 1.0),
    "N/rad": ("N/deg", math.pi / 180),
    "N*m/rad": ("N*m/deg", math.pi / 180),
    "rad": ("deg", 180 / math.pi),
    "m": ("mm", 1e3),
    "1": ("1", 1.0),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class WideTable:
    """A table with a column for each characteristic: of the report, and as a list of the JSON answer.

    ``scope`` says what there is a row of: a load (both directions together), a load and direction, or also a
    slip angle. ``answer`` is the key of the list in the JSON answer; two tables may share it. ``place`` is
    where the table stands among the others of the report.
    """

    name: str
    scope: Scope
    text: str
    place: int
    answer: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """A figure against load: its name in tags, the quantity in words, and what a list of figures says."""

    name: str
    title: str
    text: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Need:
    """A condition that a direction has to meet, and the words for a result that lacks it."""

    text: str
    met: Callable[[Direction], bool]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Characteristic:
    """One characteristic.

    Attributes
    ----------
    name : key in rows, sheets and answers
    symbol, title : as equations and people call it
    definition, formula : in words, in text; SAE axes that follow the travel
    term, source : what a standard or the source document calls it, and which
    channel : FY or MZ, what it is read off
    unit : SI; `PRINTED` has the unit in which people see it
    digits : printed decimals where no uncertainty sets them
    order : place among the characteristics of its scope
    table : the report's table and the list of the answer in which it stands
    read : its function. Scope ``load``: (self, a reader of each of ``runs``); ``direction``: (self, reader);
        ``angle``: (self, reader, slip angle [rad]). Returns an `Uncertain` in SI, None where data lack
    sign : of the slope, or of the reversed run in half the sum; for `read`
    runs : the directions that a characteristic of a load needs
    needs : what each of these directions has to have
    budget : the sources that its uncertainty can have
    column, column_text : its column in ``table``
    figure, label : the report's figure, and the series there; no figure without it
    compared : whether comparisons take it; ``comparison_figure`` where they draw it
    belt_sign : whether half the sum over a regular and a reversed belt is a pattern effect
    summary, summary_text : the value ``tk:summary.<name>`` of the report, and its description
    console_heading : its column in what ``toolkit process`` prints
    """

    name: str
    symbol: str
    title: str
    definition: str
    formula: str
    term: str
    source: str
    channel: Channel
    unit: str
    digits: int
    order: int
    table: WideTable
    read: Callable[..., Uncertain | None]
    budget: tuple[str, ...]
    column_text: str
    sign: float = 1.0
    runs: tuple[Rotation, ...] = ROTATIONS
    needs: tuple[Need, ...] = ()
    column: str = ""
    figure: Figure | None = None
    label: str = ""
    compared: bool = False
    comparison_figure: Figure | None = None
    belt_sign: bool = False
    summary: str | None = None
    summary_text: str = ""
    console_heading: str | None = None

    @property
    def scope(self) -> Scope:
        """What there is one of it for."""
        return self.table.scope

    @property
    def column_name(self) -> str:
        """Its column in the report's tables."""
        return self.column or self.name

    @property
    def printed_unit(self) -> str:
        """The unit in which people see it; the style of an organisation may choose another."""
        return PRINTED[self.unit][0]

    @property
    def factor(self) -> float:
        """From SI to the printed unit."""
        return PRINTED[self.unit][1]

    @property
    def series_label(self) -> str:
        """Its series in a figure that it shares."""
        return self.label or self.title

    def facts(self) -> dict[str, str]:
        """Return what people are told of it, in words."""
        unit = self.unit if self.printed_unit == self.unit else f"{self.printed_unit} (SI: {self.unit})"
        return {
            "title": self.title,
            "symbol": self.symbol,
            "unit": printed(unit),
            "means": self.definition,
            "formula": self.formula,
            "term": self.term,
            "source": self.source,
            "uncertainty": ", ".join(self.budget),
        }

    def why_lacking(self, directions: Sequence[Direction]) -> str:
        """Return what a result lacks, in words.

        Parameters
        ----------
        directions : those of one load, or the one that it is read off
        """
        if self.scope == "load":
            by_rotation = {direction.group.rotation: direction for direction in directions}
            absent = [rotation for rotation in self.runs if rotation not in by_rotation]
            if absent:
                return f"no run with the drum {' and '.join(absent)}"
            directions = [by_rotation[rotation] for rotation in self.runs]
        unmet = (need.text for need in self.needs if not all(need.met(direction) for direction in directions))
        return next(unmet, "the data do not determine it")


# The tables that characteristics are columns of, and the figures that several of them share.


STIFFNESS = WideTable(
    name="stiffness",
    scope="direction",
    text="cornering and aligning stiffness, one row a load and direction",
    place=1,
    answer="stiffness",
)
PULL = WideTable(
    name="pull", scope="load", text="pull characteristics by symmetry, one row a load", place=2, answer="pull"
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
TRANSIENT = WideTable(
    name="transient",
    scope="direction",
    text="how FY follows the slip angle in time, one row a load and direction",
    place=5,
    answer="transient",
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


# The sources of uncertainty that the budget of a characteristic names, and the columns that show them.


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
NOISE = "noise in time"
FORM = "form of the answer"
DELAY = "delay"
SPEED = "speed"


@dataclass(frozen=True, slots=True, kw_only=True)
class BudgetColumn:
    """A column of a printed budget: the sources that it adds in quadrature, and what they are."""

    name: str
    sources: tuple[str, ...]
    text: str


COLUMNS = (
    BudgetColumn(
        name="calibration", sources=(CALIBRATION,), text="calibration record: fit and what its session stated"
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
        sources=(REPEATABILITY, ANGLE_SCATTER, NOISE),
        text="scatter of the rows within each block, or of a sweep in time",
    ),
    BudgetColumn(
        name="fit",
        sources=(FIT, FORM, DELAY, SPEED),
        text="scatter of the blocks about the curves beyond that of their rows; of a sweep in time the form "
        "of the answer, the delay of the channels and the speed",
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
# Of sweeps in time alone.
SWEEP_BUDGET = (NOISE, FORM, DELAY, SPEED, LOAD, PRESSURE)
