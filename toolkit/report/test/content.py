"""A test's result to report content: values, tables, figures and conditions."""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from toolkit.calibration.records.use import DRAFT, UNVERIFIED
from toolkit.characteristics.catalogue import columns
from toolkit.characteristics.layout import PULL, STIFFNESS
from toolkit.estimate import has_interval, plus_minus
from toolkit.files import sha256_bytes
from toolkit.recording.details import ReportDetails
from toolkit.report.columns import UNITS
from toolkit.report.content import IMPOSSIBLE, Cell, ReportContent, Table, Value
from toolkit.report.diagnosis.in_report import Told, diagnosis_tables, diagnosis_values, told_plots
from toolkit.report.style import Style
from toolkit.report.tags import FIGURES, catalogue, format_number
from toolkit.report.test.characteristics import summary_estimates, summary_load
from toolkit.report.test.details import details_values
from toolkit.report.test.figures import TURNED, build_plots, load_groups
from toolkit.report.test.models import model_plots
from toolkit.report.test.tables import build_tables
from toolkit.report.words import say_plot, say_table, say_values
from toolkit.version import __version__

if TYPE_CHECKING:
    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.characteristics.characteristic import WideTable
    from toolkit.estimate import Estimate
    from toolkit.findings import Finding
    from toolkit.pipeline import TestResult
    from toolkit.tires.comparison import Comparison

SIMULATED = "SIMULATED DATA"


def build_content(
    result: TestResult,
    record: CalibrationRecord | None = None,
    *,
    findings: Sequence[Finding] | None = None,
    style: Style | None = None,
    issued: dt.date | None = None,
    details: ReportDetails | None = None,
    comparison: Comparison | None = None,
    diagnosis: Told | None = None,
) -> ReportContent:
    """Return what a template can ask for.

    Parameters
    ----------
    result : the test, reduced and characterised, SI and SAE J670
    record : the calibration record that computed the forces, for its coefficients; None leaves them out
    findings : what the report lists; default those of the result
    style : units, decimals and laboratory
    issued : date of issue; default today
    details : what the report says beyond the measurement: customer, item, method, opinions
    comparison : tire models fitted to the test; None leaves their table and figures out
    diagnosis : the answer of a diagnosis and who releases it; None leaves its chapter out
    """
    style = style or Style()
    day = (issued or dt.datetime.now(tz=dt.UTC).date()).isoformat()
    listed = tuple(
        (*result.reduced.findings, *result.characteristics.findings) if findings is None else findings
    )
    info, use = result.reduced.info, result.reduced.calibration
    watermark = " - ".join(one for one in (use.word, SIMULATED if info.simulated else None) if one) or None
    drawn = build_plots(result, style, watermark)
    drawn |= model_plots(comparison, watermark=watermark, decimal_comma=style.decimal_comma)
    drawn |= told_plots(diagnosis, style)
    plots = {
        name: replace(say_plot(plot, dict(style.words), dict(style.alt)), decimal_comma=style.decimal_comma)
        for name, plot in drawn.items()
    }
    details = details or ReportDetails()
    tables = build_tables(result, record, listed, style, details.opinions, comparison)
    tables |= diagnosis_tables(diagnosis, style)
    values = _values(result, record, listed, style, day)
    values |= details_values(details, result, style, len(listed))
    values |= diagnosis_values(diagnosis, style)
    values["report.id"] = Value(kind="text", value=report_id(result, details))
    values |= {
        f"caption.{name}": Value(kind="text", value=plots[name].caption) for name in FIGURES if name in plots
    }
    words = dict(style.words)
    if words:
        values = say_values(values, words)
        tables = {name: say_table(table, words) for name, table in tables.items()}
    marks = []
    if info.simulated:
        marks.append(("simulated", f"{SIMULATED}: made by simulation, not a measurement of a tire."))
    if use.draft:
        marks.append(("draft", f"Calibration {use.id}: {use.status}."))
    if use.unverified:
        marks.append(
            (
                "unverified",
                f"{UNVERIFIED}: {use.id} is a legacy import; its coefficients are not reproduced "
                "from reference data.",
            )
        )
    if impossible := result.reduced.impossible:
        told = ", ".join(dict.fromkeys(one.rule for one in impossible))
        marks.append(
            (
                "impossible",
                f"{IMPOSSIBLE}: no tire has the forces or moments of this test ({told}, see the findings); "
                "they must not be used.",
            )
        )
    return ReportContent(
        values=values,
        tables=tables,
        plots=plots,
        conditions=_conditions(result, values, tables, list(plots), len(listed)),
        calibrations=(use,),
        title=str(values["report.title"].value),
        identity=str(values["report.id"].value),
        subject="Tire force and moment",
        author=style.laboratory or info.operator or "Tire force and moment laboratory",
        issued=day,
        marks=tuple(marks),
        style=style,
    )


def report_id(result: TestResult, details: ReportDetails | None = None) -> str:
    """Return an id made from the inputs: the same recordings and calibration give the same id.

    A report that replaces another one has an id of its own, although it rests on the same inputs; that of a
    draft says so.
    """
    reduced = result.reduced
    parts = sorted({c.file_sha256 for c in reduced.conditions})
    if details is not None and details.amends:
        parts += [details.amends, details.amendment or ""]
    digest = sha256_bytes("\n".join([reduced.info.name, reduced.calibration.sha256, *parts]).encode())
    date = "".join(ch for ch in (reduced.info.date or "") if ch.isdigit())
    draft = DRAFT if reduced.calibration.draft else ""
    return "-".join(part for part in (draft, "TR", date, digest[:8].upper()) if part)


def _values(
    result: TestResult,
    record: CalibrationRecord | None,
    findings: Sequence[Finding],
    style: Style,
    day: str,
) -> dict[str, Value]:
    reduced = result.reduced
    info, use = reduced.info, reduced.calibration
    used = reduced.used()
    pressure = info.pressure_Pa
    psi = None if pressure is None else pressure / (0.45359237 * 9.80665 / 0.0254**2)
    groups = load_groups(used)
    force, factor = style.unit("N")
    texts: dict[str, str | None] = {
        "test.name": info.name,
        "test.operator": info.operator,
        "test.requestor": info.requestor,
        "test.special": info.special,
        "test.surface": info.surface,
        "test.machine": info.machine,
        "test.pressure": None if pressure is None or psi is None else _pressure(psi, pressure, style),
        "test.loads": ", ".join(format_number(load * factor, ".0f") for load, _ in groups) + f" {force}"
        if groups
        else None,
        "test.slip_angles": _angles([c.step_SA for c in used]),
        "test.directions": _directions(result),
        "test.axes": "SAE J670" if reduced.axes == "SAE" else reduced.axes,
        "test.averaging": reduced.averaging,
        "test.tare": "no tare was subtracted" if reduced.tare.source == "none" else reduced.tare.source,
        "tire.size": info.tire_size,
        "tire.company": info.tire_company,
        "tire.DOT": info.tire_DOT,
        "tire.series": info.tire_series,
        "tire.construction": info.tire_construction,
        "tire.rim": info.tire_rim,
        "calibration.id": use.id,
        "calibration.hash": use.sha256,
        "calibration.instrument": record.instrument if record else info.machine,
        "calibration.status": use.status,
        "report.id": report_id(result),
        "report.title": "Tire force and moment test" + (f" {info.tire_size}" if info.tire_size else ""),
        "software.name": "toolkit",
        "software.version": __version__,
        "laboratory.name": style.laboratory,
        "laboratory.address": style.address,
        "simulated": "simulated data" if info.simulated else "measured data",
        **{
            f"unit.{name.replace('/', '_per_')}": str(style.unit(unit)[0]).replace("*", "·")
            for name, unit in UNITS.items()
        },
    }
    load_N = summary_load(result)
    numbers: dict[str, float | None] = {
        "test.pressure.psi": psi,
        "test.pressure.bar": None if pressure is None else pressure / 1e5,
        "test.pressure.kPa": None if pressure is None else pressure / 1e3,
        "test.speed": None if info.speed_m_s is None else info.speed_m_s * 3.6,
        "test.rated_load": info.rated_load_N,
        "test.files": len({c.file for c in reduced.conditions}),
        "test.conditions": len(used),
        "test.findings": len(findings),
        "summary.load": load_N,
    }
    made = {path: Value(kind="text", value=text) for path, text in texts.items()}
    made |= {
        "test.date": Value(kind="date", value=info.date),
        "report.date": Value(kind="date", value=day),
    }
    entries = {one.path: one for one in catalogue() if one.kind == "number"}
    for path, number in numbers.items():
        made[path] = _number(number, path, entries[path].unit, entries[path].spec, style)
    for name, estimate in summary_estimates(result).items():
        path = f"summary.{name}"
        made[path] = _number(None, path, entries[path].unit, entries[path].spec, style, estimate=estimate)
        text = _with_U(estimate, made[f"summary.{name}"], style) if load_N else None
        made[f"summary.{name}.with_U"] = Value(kind="text", value=text)
    if record is not None:
        for load in record.loads:
            for term, coefficient in zip(load.terms, load.coefficients, strict=True):
                path = f"calibration.{load.load}.{term}"
                made[path] = _number(coefficient, path, None, ".6g", style)
    return made


def _number(
    value: float | None,
    path: str,
    unit: str | None,
    spec: str,
    style: Style,
    estimate: Estimate | None = None,
) -> Value:
    shown, factor = style.unit(unit)
    digits = style.digits(path, shown)
    if digits is not None and spec.endswith("f"):
        spec = f".{digits}f"
    if estimate is None:
        return Value(kind="number", value=None if value is None else value * factor, unit=shown, spec=spec)
    scaled = estimate.scaled(factor, "")
    # Decimals that the style file gives this very tag rule; those of its unit are for numbers without U.
    U = scaled.expanded()[0] if style.digits(path) is None else math.nan
    own = U if has_interval(scaled.value, U) else None
    return Value(kind="number", value=scaled.value, unit=shown, spec=spec, U=own)


def _pressure(psi: float, pascal: float, style: Style) -> str:
    # As the source document's title page has it: 34 psi, 2.34 bar.
    text = f"{format(round(psi, 1), 'g')} psi, {pascal / 1e5:.2f} bar"
    return text.replace(".", ",").replace(" psi, ", " psi; ") if style.decimal_comma else text


def _directions(result: TestResult) -> str:
    """Return the directions, and what was turned for the reversed run where it was not the drum."""
    found = [r for r in ("forward", "reverse") if any(c.rotation == r for c in result.reduced.used())]
    turned = "reverse" in found and result.reduced.info.reversal == "tire"
    return " and ".join(found) + (f", {TURNED}" if turned else "")


def _angles(steps: Sequence[float | None]) -> str | None:
    found = sorted({round(math.degrees(step), 2) for step in steps if step is not None})
    return ", ".join(f"{angle:g}" for angle in found) + " deg" if found else None


def _with_U(estimate: Estimate | None, number: Value, style: Style) -> str:
    """Return ``45.0 ± 6.1`` in the organisation's unit."""
    if estimate is None or number.value is None or number.missing:
        return "n/a"
    if number.U is None:
        return number.text(None, style)
    return plus_minus(float(number.value), number.U, decimal_comma=style.decimal_comma)


def _has_any(result: TestResult, table: WideTable, *, summarised: bool = False) -> bool:
    """Tell whether a characteristic of a table has a value; ``summarised``: one that the summary has."""
    names = {one.name for one in columns(table) if one.summary is not None or not summarised}
    return any(row.name in names and row.estimate is not None for row in result.characteristics.rows)


def _conditions(
    result: TestResult, values: dict[str, Value], tables: dict[str, Table], plots: list[str], findings: int
) -> dict[str, bool]:
    info = result.reduced.info
    pull, stiffness = _has_any(result, PULL, summarised=True), _has_any(result, STIFFNESS)
    made = {path: not value.missing for path, value in values.items()}
    made |= {name: bool(table.rows) for name, table in tables.items()}
    made |= {name: name in plots for name in FIGURES}
    return made | {
        "simulated": info.simulated,
        "measured": not info.simulated,
        "unverified": result.reduced.calibration.unverified,
        "impossible": bool(result.reduced.impossible),
        "verified": not (result.reduced.calibration.unverified or result.reduced.calibration.draft),
        "draft": result.reduced.calibration.draft,
        "pull": pull,
        "no_pull": not pull,
        "reverse": any(c.rotation == "reverse" for c in result.reduced.used()),
        "stiffness": stiffness,
        "no_findings": findings == 0,
    }


__all__ = ["IMPOSSIBLE", "SIMULATED", "UNITS", "UNVERIFIED", "Cell", "build_content", "report_id"]
