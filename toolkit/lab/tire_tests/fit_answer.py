"""The answer of `toolkit fit`: JSON of the files contract, and tables for people."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, NotRequired, TypedDict

from toolkit.calibration.records.use import UsedRecord
from toolkit.declared.answers import entry_of
from toolkit.estimate import Estimate, plus_minus
from toolkit.findings import Finding, FindingEntry
from toolkit.lab.answers import Timing, draft_keys, findings_text, mark_words, signature_words
from toolkit.lab.tire_tests.fit_models import Fitted
from toolkit.listing import or_dash, table
from toolkit.tires.comparison import Comparison
from toolkit.tires.global_model import GlobalFit
from toolkit.tires.model import CurveFit
from toolkit.tires.sweeps import Sweeps
from toolkit.tires.table_fit import slope_sign
from toolkit.units import printed


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
    speed_km_h: Annotated[float | None, "null where the test has one speed"]
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


_PER_DEGREE = 3.141592653589793 / 180
_WORDS = {"pure": "Pure", "combined": "Combined"}


def fit_payload(fitted: Fitted) -> FittedModels:
    """Return fits and comparison as JSON."""
    global_fits = [channel_fit for fit in fitted.globals for channel_fit in fit.fits]
    answer: FittedModels = {
        "fits": [
            *(curve_payload(fit, turn) for fit, turn in zip(fitted.curves, fitted.rotations, strict=True)),
            *(global_payload(fit) for fit in global_fits),
        ],
        "comparison": fitted.comparison.as_dict(),
    }
    if fitted.sweeps is not None:
        answer["sweeps"] = sweeps_payload(fitted.sweeps)
    if fitted.use:
        answer["calibration"] = fitted.use.as_dict()
        draft = draft_keys(fitted.use)
        answer["draft"], answer["draft_reasons"] = draft["draft"], draft["draft_reasons"]
    return answer


def sweeps_payload(sweeps: Sweeps) -> SweepsEntry:
    """Return what a continuous test was split into, in degrees, kPa and N."""
    conditions = [
        entry_of(
            SweepCondition, sweep,
            inclination_deg=None if sweep.inclination_rad is None else math.degrees(sweep.inclination_rad),
            pressure_kPa=None if sweep.pressure_Pa is None else sweep.pressure_Pa / 1e3,
            speed_km_h=None if sweep.speed_m_s is None else sweep.speed_m_s * 3.6,
        )
        for sweep in sweeps.sweeps
    ]  # fmt: skip
    return entry_of(
        SweepsEntry, sweeps, axes=sweeps.table.axes, samples_left_out=sweeps.left_out,
        rows=len(sweeps.table["SA"]), conditions=conditions,
    )  # fmt: skip


def sweeps_text(sweeps: Sweeps) -> str:
    """Return the same for people: the levels of each condition."""
    conditions = sweeps_payload(sweeps)["conditions"]
    lines = [
        f"{sweeps.samples} samples in axes {sweeps.table.axes}, {sweeps.swept} swept; {sweeps.left_out} on "
        f"the way between levels left out; {len(conditions)} sweeps, {len(sweeps.table['SA'])} means"
    ]
    levels = (
        ("inclination", "deg", [c["inclination_deg"] for c in conditions]),
        ("pressure", "kPa", [c["pressure_kPa"] for c in conditions]),
        ("load", "N", [c["load_N"] for c in conditions]),
        ("speed", "km/h", [c["speed_km_h"] for c in conditions]),
    )
    for name, unit, column in levels:
        values = sorted({round(value, 1) for value in column if value is not None})
        if values:
            lines.append(f"  {name:12s} {', '.join(f'{value:g}' for value in values)} {unit}")
    return "\n".join(lines)


def curve_payload(fit: CurveFit, rotation: str | None = None) -> CurveEntry:
    """Return the fit of one load as the JSON answer of the files contract."""
    return {
        **_common(fit, rotation),
        "standard_error_dof": {p.name: _finite(p.dof) for p in fit.parameters},
        "units": {p.name: p.unit for p in fit.parameters},
    }


def global_payload(fit: GlobalFit) -> SurfaceEntry:
    """Return a channel of a model over all loads; the contract's keys, and what is said of each load."""
    return entry_of(
        SurfaceEntry,
        fit,
        **_common(fit, None),
        units={p.name: p.unit for p in fit.parameters},
        loads=[entry_of(LoadFit, load, stiffness=_estimate(load.stiffness, fit)) for load in fit.loads],
    )


def _common(fit: CurveFit | GlobalFit, rotation: str | None) -> FitKeys:
    stiffness = _estimate(fit.slope_at_zero, fit)
    return entry_of(
        FitKeys,
        fit,
        rotation=rotation,
        parameters={p.name: p.value for p in fit.parameters},
        standard_errors={p.name: p.standard_error for p in fit.parameters},
        intervals95={p.name: p.interval95 for p in fit.parameters},
        cornering_stiffness_N_per_rad=stiffness if fit.channel == "FY" else None,
        aligning_stiffness_Nm_per_rad=stiffness if fit.channel == "MZ" else None,
    )


def _estimate(slope: Estimate | None, fit: CurveFit | GlobalFit) -> Slope | None:
    # Both stiffnesses are positive for a tire in every axis system.
    if slope is None:
        return None
    sign = slope_sign(fit.axes, fit.channel)  # type: ignore[arg-type]
    return {"value": sign * slope.value, "standard_error": slope.u, "dof": _finite(slope.dof)}


def _finite(dof: float | None) -> float | None:
    # Infinite where the noise was known beforehand: JSON has no such number.
    return dof if dof is not None and math.isfinite(dof) else None


def fit_text(fitted: Fitted, findings: Sequence[Finding]) -> str:
    """Return what a person reads: single loads, models over all loads, the comparison, findings."""
    parts = []
    if fitted.use:
        parts.append(f"calibration {fitted.use.id}{mark_words(fitted.use)}\n{signature_words(fitted.use)}")
    if fitted.sweeps is not None:
        parts.append(sweeps_text(fitted.sweeps))
    rows = list(zip(fitted.curves, fitted.rotations, strict=True))
    for channel, head in (("FY", "C_FY [N/deg]"), ("MZ", "C_MZ [N·m/deg]")):
        if lines := [_line(fit, turn) for fit, turn in rows if fit.channel == channel]:
            names = [p.name for p in next(f for f, _ in rows if f.channel == channel).parameters]
            header = ["model", "FZ [N]", "drum", "n", "error %", "floor %", head, *names, "converged"]
            parts.append(f"{channel}\n{table(header, lines)}")
    if rows:
        axes = ", ".join(dict.fromkeys(fit.axes for fit, _ in rows))
        parts.append(
            f"axes {axes}; parameters in SI (B 1/rad, Sh rad, D and Sv in N or N·m); "
            "± is one standard error, (value) is not determined by the data"
        )
    parts += [_global_text(channel_fit) for fit in fitted.globals for channel_fit in fit.fits]
    if len(fitted.comparison.models) > 1:
        parts.append(comparison_text(fitted.comparison))
    if findings:
        parts.append(findings_text(findings))
    return "\n\n".join(parts)


def comparison_text(comparison: Comparison) -> str:
    """Return the table of all models in the form of the thesis's table 3.1: errors in percent."""
    floors = dict(comparison.floors)
    lines = []
    for condition, channel in comparison.conditions:
        entries = [comparison.get(model, condition, channel) for model in comparison.models]
        floor = floors.get(channel)
        label = f"{_WORDS[condition]} {channel}"
        errors = ["-" if entry is None else f"{entry.error_percent:.2f}" for entry in entries]
        lines.append([label, *errors, or_dash(floor, ".2f")])
        away = [None if entry is None else entry.prediction_error_percent for entry in entries]
        if any(value is not None for value in away):
            cells = [or_dash(value, ".2f") for value in away]
            lines.append([f"  {channel}, load left out", *cells, ""])
    if seconds := dict(comparison.seconds):
        cells = [f"{seconds[model]:.2f}" if model in seconds else "-" for model in comparison.models]
        lines.append(["time / s", *cells, ""])
    header = ["error in %", *comparison.models, "floor"]
    note = (
        "100 sqrt(sum (model - measured)^2 / sum measured^2) over the rows fitted; floor: the rows about\n"
        "their mean in bins of 0.25 deg and load; load left out: every load predicted by a fit without it"
    )
    return f"comparison\n{table(header, lines)}\n{note}"


def _global_text(fit: GlobalFit) -> str:
    parameters = [
        [
            p.name,
            *_value_and_error(p.value, p.standard_error),
            printed(p.unit),
            "not determined" if p.name in fit.not_determined else "",
        ]
        for p in fit.parameters
        if p.name not in dict(fit.fixed)
    ]
    floor = "" if fit.scatter_floor_percent is None else f", floor {fit.scatter_floor_percent:.2f} %"
    away = fit.prediction_error_percent
    head = (
        f"{fit.model} {fit.channel} over all loads: error {fit.error_percent:.2f} %{floor}"
        + ("" if away is None else f", load left out {away:.2f} %")
        + f"; {'converged' if fit.converged else 'NOT CONVERGED'} "
        f"({fit.starts_agreeing} starts at the lowest cost)"
    )
    if fit.slope_at_zero is not None:
        unit = "N" if fit.channel == "FY" else "N·m"
        slope = _stiffness(fit.slope_at_zero, fit)
        head += f"\nC_{fit.channel} at {fit.nominal_load_N:.0f} N: {slope} {unit}/deg"
    shown = (
        f"\n{table(['parameter', 'value', '±', 'unit', ''], parameters, align='<>><<')}" if parameters else ""
    )
    return f"{head}{shown}" + (f"\n{fit.message}" if fit.message else "")


def _stiffness(slope: Estimate, fit: CurveFit | GlobalFit) -> str:
    sign = slope_sign(fit.axes, fit.channel)  # type: ignore[arg-type]
    return plus_minus(sign * slope.value * _PER_DEGREE, slope.u * _PER_DEGREE)


def _value_and_error(value: float, error: float | None) -> list[str]:
    # In two columns of a table: the same two texts that stand beside each other elsewhere.
    parts = plus_minus(value, math.nan if error is None else error, spec=".5g").split(" ± ")
    return parts if len(parts) == 2 else [*parts, "-"]


def _line(fit: CurveFit, rotation: str | None) -> list[str]:
    cells = [
        f"({p.value:.4g})" if p.standard_error is None else plus_minus(p.value, p.standard_error)
        for p in fit.parameters
    ]
    return [
        fit.model,
        f"{fit.load_N:.0f}" if fit.load_N is not None else "all",
        rotation or "-",
        str(fit.n),
        f"{fit.error_percent:.2f}",
        or_dash(fit.scatter_floor_percent, ".2f"),
        "-" if fit.slope_at_zero is None else _stiffness(fit.slope_at_zero, fit),
        *cells,
        "yes" if fit.converged else "no",
    ]
