"""Answers on tires, as types: `process`, `fit` and `compare`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, NotRequired, TypedDict

from toolkit.calibration.records.use import UsedRecord
from toolkit.comparison.laboratories import LaboratoryComparison
from toolkit.declared.answers import merged
from toolkit.findings import FindingEntry


class Timing(TypedDict):
    """Times, which differ from run to run; nothing else in an answer does."""

    seconds: Annotated[float, "of the whole command"]
    models: NotRequired[Annotated[Mapping[str, float], "of the fit of each tire model"]]


class DraftKeys(TypedDict):
    """Whether an answer may not be issued."""

    draft: Annotated[bool, "whether a record is used that is not approved and in force"]
    draft_reasons: Annotated[list[str], "why"]


class EstimateEntry(TypedDict):
    """A value with its uncertainty."""

    value: float
    standard_uncertainty: float
    dof: Annotated[float | None, "degrees of freedom; null where the uncertainty is known beforehand"]
    expanded_uncertainty: Annotated[float, "for a coverage of 95 %"]
    k: Annotated[float, "coverage factor"]
    unit: str


class Tare(TypedDict):
    """What was taken off the indications."""

    source: Annotated[str, "where it comes from"]
    values: Annotated[Mapping[str, float], "by indication"]
    unit: str


class StatedComponent(TypedDict):
    """An uncertainty that the machine's definition states (type B)."""

    symbol: Annotated[str, "channel"]
    u: Annotated[float, "standard uncertainty"]
    unit: str
    relative: Annotated[float, "standard uncertainty as a part of the value"]
    effect: Annotated[float, "relative change of a force for a relative change of the condition"]
    common: Annotated[
        Literal["machine", "test"], "one error in all tests of the machine, or one in each test"
    ]
    source: str


class HubValue(TypedDict):
    """A calibrated load of the hub beside FY and MZ, SAE J670; MX and MY where [hub] puts them."""

    value: Annotated[float, "mean of the block, by the record"]
    u: Annotated[float, "standard uncertainty: scatter, record, zeros, arm"]
    U: Annotated[float, "expanded uncertainty"]
    k: Annotated[int, "coverage factor"]
    unit: Annotated[str, "N or N*m"]


class Condition(TypedDict):
    """The mean of one block of a recording: one slip angle under one load."""

    file: Annotated[str, "recording"]
    rotation: Annotated[str, "forward or reverse"]
    rows: Annotated[list[int], "first and last row, from 1 at the first row of data"]
    step_SA_rad: Annotated[float | None, "slip angle of the protocol's step"]
    step_FZ_N: Annotated[float | None, "load of the protocol's step"]
    SA_rad: Annotated[float, "measured slip angle"]
    FZ_N: Annotated[float, "measured load"]
    FY_N: Annotated[float, "lateral force by the record"]
    MZ_Nm: Annotated[float, "aligning moment by the record"]
    u_FY_N: Annotated[float | None, "standard uncertainty by every source; null where the block is not used"]
    u_FY_repeatability_N: Annotated[float | None, "the part of repeatability"]
    u_MZ_Nm: Annotated[float | None, "as u_FY_N"]
    u_MZ_repeatability_Nm: Annotated[float | None, "as u_FY_repeatability_N"]
    FY_file_N: Annotated[float | None, "what the file itself says"]
    MZ_file_Nm: Annotated[float | None, "what the file itself says"]
    FZ_common_N: Annotated[float, "load to which the values of one load are carried"]
    FY_common_N: Annotated[float, "FY at the common load"]
    MZ_common_Nm: Annotated[float, "MZ at the common load"]
    u_FY_common_N: Annotated[float, "standard uncertainty of carrying it there, and of the zero"]
    u_MZ_common_Nm: Annotated[float, "as u_FY_common_N"]
    used: Annotated[bool, "false where a later block of the same condition stands for it"]
    calibration_sha256: Annotated[str, "of the record that computed it"]
    hub: NotRequired[Annotated[Mapping[str, HubValue], "loads of the hub by symbol, where it has any"]]


class Budget(TypedDict):
    """The sources of a characteristic's uncertainty."""

    load_N: float
    rotation: Annotated[str | None, "direction; null of what both directions give"]
    name: Annotated[str, "of the characteristic"]
    unit: str
    standard_uncertainty: Annotated[Mapping[str, float], "by source"]


class ReducedTest(DraftKeys):
    """A reduced test: conditions, characteristics with their budgets, findings."""

    test: Annotated[str, "name"]
    machine: str
    simulated: Annotated[bool, "whether the virtual machine recorded it"]
    axes: Annotated[str, "axis system of all values"]
    averaging: Annotated[str, "what was averaged, in words"]
    protocol: Annotated[str | None, "the protocol that the test is held against"]
    reversal: Annotated[str, "what is turned for the reversed runs: drum or tire"]
    calibration: UsedRecord
    tare: Tare
    stated: list[StatedComponent]
    conditions: list[Condition]
    characteristics: Annotated[
        Mapping[str, list[dict[str, Any]]],
        "lists by the catalogue's tables (characteristics.md): load_N, rotation and SA_rad where the list "
        "has them, then each characteristic as value with uncertainty, or null; and budgets, as below",
    ]
    impossible: Annotated[list[FindingEntry], "values that no tire has"]
    findings: list[FindingEntry]


class ProcessAnswer(ReducedTest):
    """A reduced test, and where it was written."""

    out: Annotated[Path | None, "file that was written"]
    content_sha256: Annotated[str | None, "of the file's content"]
    timing: Timing


class Slope(TypedDict):
    """A stiffness at zero slip angle."""

    value: float
    standard_error: float
    dof: float | None


class LoadFit(TypedDict):
    """What a model over all loads says of one of them."""

    load_N: float
    n: Annotated[int, "rows"]
    error_percent: float
    prediction_error_percent: Annotated[float | None, "predicted by a fit without this load"]
    stiffness: Slope | None


class FitKeys(TypedDict):
    """What every fit of a model to a channel says."""

    model: str
    channel: Annotated[str, "FY, MZ or FX"]
    load_N: Annotated[float | None, "mean load; null of a model over all loads"]
    rotation: Annotated[str | None, "direction of the test's runs"]
    axes: Annotated[str, "axis system of the parameters"]
    n: Annotated[int, "rows"]
    dof: Annotated[float, "degrees of freedom of the residuals"]
    parameters: Annotated[Mapping[str, float], "by name, in the units below"]
    standard_errors: Annotated[Mapping[str, float | None], "null of a parameter that is not determined"]
    intervals95: Annotated[
        Mapping[str, tuple[float | None, float | None] | None], "an end is null where the data leave it open"
    ]
    not_determined: Annotated[list[str], "parameters that the data leave open"]
    at_bound: Annotated[list[str], "parameters that ended at their bound"]
    error_percent: Annotated[float, "100 sqrt(sum (model - measured)^2 / sum measured^2)"]
    scatter_floor_percent: Annotated[float | None, "the same of the measurements about their own mean"]
    cornering_stiffness_N_per_rad: Slope | None
    aligning_stiffness_Nm_per_rad: Slope | None
    loss: Annotated[str, "least squares or robust"]
    converged: Annotated[bool, "whether several starts ended at the same lowest cost"]
    message: str


class CurveEntry(FitKeys):
    """A model of one channel under one load."""

    units: Annotated[Mapping[str, str], "of the parameters"]
    standard_error_dof: Annotated[Mapping[str, float | None], "degrees of freedom of the standard errors"]


class SurfaceEntry(FitKeys):
    """A model of one channel over all loads."""

    units: Annotated[Mapping[str, str], "of the parameters"]
    parameter_axes: Annotated[str, "axis system in which the parameters are defined"]
    nominal_load_N: float | None
    fixed: Annotated[Mapping[str, str], "parameters that were not fitted, and why"]
    prediction_error_percent: Annotated[float | None, "each load predicted without it"]
    loads: list[LoadFit]
    weights: Annotated[str, "of the loads"]
    starts: int
    starts_agreeing: Annotated[int, "that ended at the lowest cost"]


class SweepCondition(TypedDict):
    """One sweep of a continuous test."""

    inclination_deg: float | None
    pressure_kPa: float | None
    load_N: float
    direction: Annotated[str, "up or down"]
    samples: int


class SweepsEntry(TypedDict):
    """What a continuous test was split into."""

    swept: Annotated[str, "what was swept: slip angle or slip ratio"]
    axes: Annotated[str, "axis system of the file"]
    samples: int
    samples_left_out: Annotated[int, "on the way between levels"]
    rows: Annotated[int, "means that are fitted"]
    conditions: list[SweepCondition]


class FittedModels(TypedDict):
    """Tire models fitted to a test or a table."""

    fits: list[CurveEntry | SurfaceEntry]
    comparison: Annotated[Mapping[str, Any], "rows of all models, and the floor of each channel"]
    sweeps: NotRequired[Annotated[SweepsEntry, "of a continuous test"]]
    calibration: NotRequired[Annotated[UsedRecord, "of a test"]]
    draft: NotRequired[Annotated[bool, "of a test: whether its record is not approved and in force"]]
    draft_reasons: NotRequired[list[str]]


class FitAnswer(FittedModels):
    """Tire models fitted to a test or a table, and what was written."""

    tir: Annotated[str | None, "tire file that was written"]
    fmu: Annotated[str | None, "FMU that was written"]
    figures: Annotated[list[str], "files that were written"]
    findings: list[FindingEntry]
    timing: Timing


class ComparedEntry(TypedDict):
    """A test or a table that is compared."""

    label: str
    kind: str
    source: str
    simulated: bool
    calibration: UsedRecord | None
    unverified: bool
    conditions: Annotated[Mapping[str, Any], "day, operator, surface, ..."]


class DifferenceEntry(TypedDict):
    """One quantity of one entry against the reference."""

    table: str
    quantity: str
    rotation: str | None
    SA_rad: float | None
    load_N: float
    label: str
    reference: EstimateEntry
    other: EstimateEntry
    difference: EstimateEntry
    difference_percent: float | None
    standard_uncertainty_if_nothing_were_shared: float
    p: float | None
    p_holm: Annotated[float | None, "corrected for the number of comparisons"]
    significant: bool


class PatternEffect(TypedDict):
    """A pull divided into what turns with the tread pattern and what turns with the body."""

    quantity: str
    load_N: float
    regular: EstimateEntry
    reversed: EstimateEntry
    pattern: EstimateEntry
    body: EstimateEntry


class Compared(DraftKeys):
    """Tests held against each other, or against a maker's table; SI, angles in rad."""

    mode: str
    axes: str
    level: Annotated[float, "of significance"]
    reference: str
    entries: list[ComparedEntry]
    differences: list[DifferenceEntry]
    significant: Annotated[int, "how many differences are"]
    repeats: Annotated[Mapping[str, Any] | None, "precision by ISO 5725-3, where tests repeat each other"]
    pattern_effect: list[PatternEffect]
    left_out: Annotated[list[str], "what could not be compared, and why"]


class CompareAnswer(Compared):
    """Tests held against each other, and what was written."""

    figures: Annotated[Mapping[str, Any], "pictures that were written, by name"]
    document: Annotated[Mapping[str, Any] | None, "Word document and PDF, where they were asked for"]
    findings: list[FindingEntry]
    timing: Timing


class _LaboratoryKeys(TypedDict):
    mode: Annotated[str, "always laboratories"]
    source: str
    figures: Annotated[Mapping[str, Path], "pictures that were written, by name"]
    document: Annotated[Mapping[str, Any] | None, "Word document and PDF, where they were asked for"]
    timing: Timing


CompareForms = CompareAnswer | merged(LaboratoryComparison, _LaboratoryKeys)
"""Of tests, and with ``--laboratories``."""


class EvaluateAnswer(TypedDict):
    """A tire file, evaluated at every row of a grid."""

    tire: str
    model: Annotated[str, "mf52 or mf61"]
    axes: Annotated[str, "of the grid and of the forces"]
    angles: Annotated[str, "star: tan(alpha), sin(gamma); raw: the angles themselves"]
    units: Annotated[Mapping[str, str], "of the columns"]
    draft: bool
    rows: Annotated[list[Mapping[str, float | None]], "each by column"]
    out: Annotated[str | None, "file that was written"]
    findings: list[FindingEntry]
    timing: Timing


ConvertAnswer = TypedDict(
    "ConvertAnswer",
    {
        "in": str,
        "out": str,
        "from": Annotated[str, "kind of the source"],
        "to": Annotated[str, "kind of the target"],
        "axes": str,
        "draft": bool,
        "draft_reasons": list[str],
        "findings": list[FindingEntry],
        "timing": Timing,
    },
)
ConvertAnswer.__doc__ = "A file, written in another format."
