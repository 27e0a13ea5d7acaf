"""A comparison to the content of its document: texts, tables and figures of its vocabulary."""

from __future__ import annotations

import datetime as dt
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from toolkit.comparison.model import Comparison, Difference, Entry
from toolkit.files import sha256_bytes
from toolkit.report.comparison.cells import (
    comma,
    conclusion,
    factor_text,
    named,
    p_text,
    shown_rows,
    shown_unit,
    with_U,
)
from toolkit.report.comparison.plots import comparison_plots
from toolkit.report.comparison.vocabulary import COMPARISON, TABLES
from toolkit.report.content import Cell, Plot, ReportContent, Table, Value
from toolkit.version import __version__

if TYPE_CHECKING:
    from toolkit.calibration.records.use import CalibrationUse
    from toolkit.findings import Finding
    from toolkit.report.style import Style

_MODES = {
    "table": "Tests against a maker's table",
    "surfaces": "One tire on different surfaces",
    "tires": "Tires against each other",
    "repeats": "Repeats of one tire",
}
_KINDS = {"table": "maker's table of forces", "characteristics": "maker's table of characteristics"}
_METHOD = (
    "Differences from the reference at its loads, in SAE J670 axes. What two tests share (one calibration "
    "record, what the machine definition states as common) cancels in their difference; the rest of each "
    "budget stays. Significance by Student's t with Welch-Satterthwaite degrees of freedom, adjusted over "
    "each table by Holm's procedure. ±: expanded uncertainty, 95 %."
)


def build_comparison_content(
    found: Comparison, style: Style, findings: Sequence[Finding], *, issued: dt.date
) -> ReportContent:
    """Return everything that a template of a comparison can ask for."""
    plots = {f"compared_{name}": replace(plot, name=f"compared_{name}") for name, plot in
             comparison_plots(found, style).items()}  # fmt: skip
    tables = {
        name: Table(name=name, columns=TABLES[name][1], rows=tuple(rows))
        for name, rows in _tables(found, style, findings).items()
    }
    values = {f"comparison.{n}": Value(kind="text", value=text) for n, text in _texts(found).items()}
    values["comparison.issued"] = Value(kind="date", value=issued.isoformat())
    values |= {f"caption.{name}": Value(kind="text", value=plot.caption) for name, plot in plots.items()}
    return ReportContent(
        values=values,
        tables=tables,
        plots=plots,
        conditions=_conditions(found, values, tables, plots, findings),
        calibrations=found.uses,
        title=str(values["comparison.title"].value),
        author=style.laboratory or "toolkit",
        identity=str(values["comparison.id"].value),
        subject="Comparison of tire force and moment tests",
        issued=issued.isoformat(),
        marks=_marks(found),
        style=style,
        vocabulary=COMPARISON,
    )


def _marks(found: Comparison) -> tuple[tuple[str, str], ...]:
    marks = []
    if any(one.simulated for one in found.entries):
        marks.append(("simulated", "SIMULATED: a test of the virtual machine is compared."))
    legacy = ", ".join(one.label for one in found.entries if one.calibration and one.calibration.unverified)
    if legacy:
        marks.append(("unverified", f"UNVERIFIED: computed by a legacy import: {legacy}."))
    drafts = "; ".join(f"{one.id}: {one.status}" for one in found.uses if one.draft)
    if drafts:
        marks.append(("draft", f"Calibrations: {drafts}."))
    return tuple(marks)


def _conditions(
    found: Comparison,
    values: dict[str, Value],
    tables: dict[str, Table],
    plots: dict[str, Plot],
    findings: Sequence[Finding],
) -> dict[str, bool]:
    made = dict.fromkeys(COMPARISON.conditions, False)
    made |= {path: not value.missing for path, value in values.items()}
    made |= {name: bool(table.rows) for name, table in tables.items()} | dict.fromkeys(plots, True)
    return made | {
        "simulated": any(one.simulated for one in found.entries),
        "unverified": any(one.unverified for one in found.uses),
        "draft": any(one.draft for one in found.uses),
        "repeats": found.repeats is not None,
        "no_findings": not findings,
    }


def _texts(found: Comparison) -> dict[str, str | None]:
    key = "\n".join(one.identity for one in found.entries)
    calibrations = dict.fromkeys(_calibration(one) for one in found.uses)
    names = ", ".join(one.label for one in found.entries)
    return {
        "id": f"CMP-{sha256_bytes(f'{found.mode}|{key}'.encode())[:8].upper()}",
        "title": f"{_MODES[found.mode]}: {names}",
        "mode": _MODES[found.mode],
        "reference": found.reference.label,
        "conclusion": conclusion(found),
        "method": _METHOD,
        "calibrations": "; ".join(calibrations) or "none: makers' tables only",
        "reproducibility": None
        if found.repeats is None
        else f"Reproducibility: {found.repeats.reproducibility_note}.",
        "shown": f"Characteristics: {shown_rows(found, 'characteristics')[1]}; "
        f"* marks the significant ones. Forces and moments at slip angles: {shown_rows(found, 'curves')[1]}.",
        "left_out": "; ".join(found.left_out) or None,
        "software": f"toolkit {__version__}",
    }


def _calibration(one: CalibrationUse) -> str:
    said = f", {one.status}" if one.draft or one.since else " UNVERIFIED" if one.unverified else ""
    return f"{one.id} ({one.sha256}){said}"


def _tables(
    found: Comparison, style: Style, findings: Sequence[Finding]
) -> dict[str, list[tuple[Cell, ...]]]:
    return {
        "compared": [_entry(one) for one in found.entries],
        "differences": [_difference(one, style) for one in shown_rows(found, "characteristics")[0]],
        "curve_differences": [_difference(one, style) for one in shown_rows(found, "curves")[0]],
        "factors": _factors(found),
        "precision": _precision(found, style),
        "pattern": _pattern(found, style),
        "comparison_findings": [(one.rule, one.level, one.where, one.message) for one in findings],
    }


def _entry(one: Entry) -> tuple[Cell, ...]:
    names = ("surface", "pressure", "day", "operator", "mounting", "calibration")
    what = one.condition("tire") if one.kind == "test" else _KINDS[one.kind]
    return (one.label, what or "-", *(one.condition(name) or "-" for name in names))


def _load(load_N: float, style: Style) -> str:
    unit, factor = style.unit("N")
    return f"{load_N * factor:.0f} {unit}"


def _difference(one: Difference, style: Style) -> tuple[Cell, ...]:
    unit, factor = shown_unit(one.name, style)
    return (
        named(one.name, one.rotation, one.SA_rad, title=True),
        _load(one.load_N, style),
        unit,
        with_U(one.reference, factor, style),
        one.label,
        with_U(one.other, factor, style),
        with_U(one.difference, factor, style),
        p_text(one.p_holm, style),
        "*" if one.significant else "",
    )


def _factors(found: Comparison) -> list[tuple[Cell, ...]]:
    return [
        (one.name, ", ".join(level or "-" for level in one.levels), one.note or "told apart")
        for one in (found.repeats.factors if found.repeats else ())
    ]


def _precision(found: Comparison, style: Style) -> list[tuple[Cell, ...]]:
    rows: list[tuple[Cell, ...]] = []
    for one in found.repeats.precisions if found.repeats else ():
        unit, factor = shown_unit(one.name, style)

        def number(value: float | None, factor: float = factor) -> str:
            return "-" if value is None else comma(f"{value * factor:.3g}", style)

        rows.append(
            (
                named(one.name, one.rotation, title=True),
                _load(one.load_N, style),
                unit,
                str(one.n),
                comma(f"{one.mean * factor:.4g}", style),
                number(one.total.value),
                number(one.repeatability.value if one.repeatability else None),
                number(one.limit_r),
                "; ".join(f"{f.factor} {factor_text(f, factor, style)}" for f in one.factors) or "-",
            )
        )
    return rows


def _pattern(found: Comparison, style: Style) -> list[tuple[Cell, ...]]:
    rows: list[tuple[Cell, ...]] = []
    for one in found.pattern:
        unit, factor = shown_unit(one.name, style)
        shown = (with_U(e, factor, style) for e in (one.regular, one.reversed, one.pattern, one.body))
        rows.append((one.name, _load(one.load_N, style), unit, *shown))
    return rows
