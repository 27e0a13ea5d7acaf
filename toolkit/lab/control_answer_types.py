"""Answers on what a record's numbers are worth, as types: `diff`, `chart`, `budget`, `apply`, ..."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, NotRequired, TypedDict

from toolkit.calibration.records.use import UsedRecord
from toolkit.calibration.standards.e74 import E74Result
from toolkit.calibration.standards.iso376 import Iso376Result
from toolkit.findings import FindingEntry


class DifferenceAnswer(TypedDict):
    """Two records, term by term."""

    records: Annotated[list[str], "first and second"]
    terms: Annotated[
        list[Mapping[str, Any]],
        "load, term, unit; under each record's id its coefficient, or null; change, change_percent; effect, "
        "the largest load that the change moves [unit]; effect_percent_fs; differs; note",
    ]


class RefittedRecord(TypedDict):
    """A record by its content."""

    id: str
    sha256: str


class RecordReportAnswer(TypedDict):
    """A record's stored data, fitted again."""

    record: RefittedRecord
    loads: Annotated[Mapping[str, Mapping[str, Any]], "the report of each load, as calibrate --full has it"]
    findings: list[FindingEntry]
    balance: NotRequired[Annotated[Mapping[str, Any] | None, "the form of AIAA R-091, of a balance"]]
    figures: NotRequired[Annotated[list[str], "files that were written"]]


StandardEvaluation = TypedDict(
    "StandardEvaluation",
    {
        "standard": Annotated[str, "e74 or iso376"],
        "load": str,
        "load_unit": str,
        "indication": str | None,
        "indication_unit": str | None,
        "sense": Annotated[str | None, "of the force"],
        "direction": Annotated[str | None, "E74: whether the force increases or decreases, up or down"],
        "reasons": Annotated[list[str], "against a class, or a better one"],
        "left_out": Annotated[int, "rows that do not belong to it"],
        "class": str | None,
        "result": Annotated[E74Result | Iso376Result | None, "null where the rows cannot be evaluated"],
    },
)
StandardEvaluation.__doc__ = "One indication under one load, by one standard."


class StandardAnswer(TypedDict):
    """A record, evaluated by a standard."""

    id: str
    standard: Annotated[str, "e74 or iso376"]
    evaluations: list[StandardEvaluation]


class CheckLoad(TypedDict):
    """A load of a check point."""

    load: str
    value: float
    unit: str


class ControlLimits(TypedDict):
    """Limits of a control chart, in the load's unit."""

    centre: float
    sigma: float
    lower: float
    upper: float
    mean_range: float
    upper_range: float
    points: Annotated[int, "that make the limits"]
    provisional: Annotated[bool, "whether they rest on few points"]


class ChartPoint(TypedDict):
    """The error of a session's check load by the record in force before it."""

    session: str
    date: str
    record: str
    error: Annotated[float, "in the load's unit"]
    rows: int


class BrokenRule(TypedDict):
    """A rule of the chart that a session breaks."""

    rule: int
    text: str
    session: str


class ChartSeries(TypedDict):
    """The errors of one load at one check point, over the sessions."""

    load: str
    unit: str
    check_load: list[CheckLoad]
    tolerance: float | None
    limits: Annotated[ControlLimits | None, "null of too few points"]
    points: list[ChartPoint]
    moving_ranges: list[float]
    breaks: list[BrokenRule]


class LeftOutSession(TypedDict):
    """A session that no chart can have."""

    id: str
    reason: str


class ChartAnswer(TypedDict):
    """The control charts of an instrument."""

    instrument: str
    series: list[ChartSeries]
    left_out: list[LeftOutSession]
    findings: list[FindingEntry]
    picture: Path | None


class RecommendedInterval(TypedDict):
    """What the history recommends."""

    days: Annotated[int | None, "null of too few results"]
    drift_per_year: Annotated[float | None, "as a share of the tolerance"]
    results: int
    reason: str


class DueInstrument(TypedDict):
    """When an instrument is due."""

    instrument: str
    record: str
    session_date: str
    recall: Annotated[str | None, "interval, as its approval states it"]
    due: str | None
    days_left: int | None
    overdue: bool | None
    recommended: RecommendedInterval


class DueAnswer(TypedDict):
    """When each instrument is due."""

    on: Annotated[str, "day that is judged"]
    instruments: list[DueInstrument]
    findings: list[FindingEntry]


class BudgetComponent(TypedDict):
    """A component of a load's uncertainty."""

    name: str
    description: str
    type: Annotated[str, "A or B"]
    distribution: str
    u: Annotated[float, "standard uncertainty, in the load's unit"]
    dof: Annotated[float | None, "null where it is known beforehand"]
    share: Annotated[float, "of the combined variance"]
    source: str
    stated: Annotated[bool, "false where nobody stated it"]


class RangePoint(TypedDict):
    """The uncertainty at one load of the range."""

    value: float
    u: float
    k: float
    U: float


class MonteCarloCheck(TypedDict):
    """The budget, held against a Monte Carlo computation by JCGM 101."""

    trials: int
    seed: int
    value: float
    u: float
    low: float
    high: float
    budget_low: float
    budget_high: float
    low_difference: float
    high_difference: float
    digits: Annotated[int, "of u that count"]
    delta: Annotated[float, "numerical tolerance"]
    stable: bool
    validated: bool


class LoadBudget(TypedDict):
    """The uncertainty of one load at one value."""

    unit: str
    value: float
    indications: list[float]
    components: list[BudgetComponent]
    u: float
    dof: float | None
    k: float
    U: float
    U_rounded: str
    probability: float
    not_stated: list[str]
    range: list[RangePoint]
    monte_carlo: MonteCarloCheck | None


class BudgetAnswer(TypedDict):
    """The uncertainty of a record's loads."""

    record: str
    sha256: str
    loads: Annotated[Mapping[str, LoadBudget], "by load"]
    figure: Path | None
    findings: list[FindingEntry]


class AppliedRange(TypedDict):
    """The range of a load that was computed."""

    unit: str
    least: float
    largest: float
    U_largest: Annotated[float | None, "largest expanded uncertainty; null where it is not determined"]


class ApplyAnswer(TypedDict):
    """Loads of a file of indications, computed by a record."""

    out: Annotated[Path, "file that was written"]
    rows: int
    calibration: UsedRecord
    mark: Annotated[str | None, "what the file is marked with"]
    loads: Annotated[Mapping[str, AppliedRange], "by load"]
    findings: list[FindingEntry]
