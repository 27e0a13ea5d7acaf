"""A comparison as a document: its texts, tables and figures, each declared with what builds it.

The figures are data: characteristics against load, a series an entry (thesis 6.6 to 6.29).
"""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from toolkit.characteristics.catalogue import comparison_figures
from toolkit.estimate import plus_minus
from toolkit.files import sha256_bytes
from toolkit.report.comparison.cells import (
    conclusion,
    factor_text,
    named,
    p_text,
    shown_rows,
    shown_unit,
    with_U,
)
from toolkit.report.content import Curve, Plot, ReportContent
from toolkit.report.document import Document, Row, Rows, finding_table
from toolkit.report.style import Style, kept
from toolkit.report.tags import format_number
from toolkit.units import printed
from toolkit.version import __version__

if TYPE_CHECKING:
    from toolkit.characteristics.characteristic import Characteristic, Figure
    from toolkit.comparison.model import Comparison, Difference, Entry
    from toolkit.findings import Finding

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
_DIFFERENCES = """
    quantity|quantity, with slip angle and direction of rotation
    load|load
    unit|unit of the row
    reference|value of the reference, with expanded uncertainty
    label|what is compared with it
    other|its value, with expanded uncertainty
    difference|difference, with expanded uncertainty
    p|p value adjusted over the table
    significant|a star, or nothing
    """


@dataclass(frozen=True, slots=True, kw_only=True)
class Compared:
    """A comparison with the findings and the day of its document."""

    comparison: Comparison
    findings: Sequence[Finding]
    issued: dt.date

    @property
    def id(self) -> str:
        """Identification: the same comparison has the same on any day."""
        key = "\n".join(entry.identity for entry in self.comparison.entries)
        return f"CMP-{sha256_bytes(f'{self.comparison.mode}|{key}'.encode())[:8].upper()}"

    @property
    def title(self) -> str:
        """Title: the mode and what is compared."""
        return f"{self.mode}: {', '.join(entry.label for entry in self.comparison.entries)}"

    @property
    def mode(self) -> str:
        """What the comparison is about."""
        return _MODES[self.comparison.mode]


COMPARISON: Document[Compared] = Document(
    name="comparison",
    family="comparison",
    package=__package__,
    required=("tk:comparison.calibrations", "tk:comparison.id"),
)


def build_comparison_content(source: Compared, style: Style) -> ReportContent:
    """Return everything that a template of a comparison can ask for."""
    return COMPARISON.content(
        source,
        style,
        calibrations=source.comparison.uses,
        title=source.title,
        identity=source.id,
        subject="Comparison of tire force and moment tests",
        issued=source.issued,
    )


def _calibrations(source: Compared, _style: Style) -> str:
    listed = []
    for use in source.comparison.uses:
        standing = f", {use.status}" if use.draft or use.since else " UNVERIFIED" if use.unverified else ""
        listed.append(f"{use.id} ({use.sha256}){standing}")
    return "; ".join(dict.fromkeys(listed)) or "none: makers' tables only"


def _reproducibility(source: Compared, _style: Style) -> str | None:
    repeats = source.comparison.repeats
    return None if repeats is None else f"Reproducibility: {repeats.reproducibility_note}."


def _shown(source: Compared, _style: Style) -> str:
    return (
        f"Characteristics: {shown_rows(source.comparison, 'characteristics')[1]}; * marks the significant "
        f"ones. Forces and moments at slip angles: {shown_rows(source.comparison, 'curves')[1]}."
    )


def _simulated(source: Compared, _style: Style) -> bool:
    return any(entry.simulated for entry in source.comparison.entries)


def _simulated_mark(source: Compared, style: Style) -> str | None:
    return "SIMULATED: a test of the virtual machine is compared." if _simulated(source, style) else None


def _unverified_mark(source: Compared, _style: Style) -> str | None:
    labels = [
        entry.label
        for entry in source.comparison.entries
        if entry.calibration and entry.calibration.unverified
    ]
    return f"UNVERIFIED: computed by a legacy import: {', '.join(labels)}." if labels else None


def _draft_mark(source: Compared, _style: Style) -> str | None:
    drafts = "; ".join(f"{use.id}: {use.status}" for use in source.comparison.uses if use.draft)
    return f"Calibrations: {drafts}." if drafts else None


DECLARED = (
    COMPARISON.text(
        "id", "identification of the comparison, made from what is compared", lambda source, _: source.id
    ),
    COMPARISON.text("title", "title", lambda source, _: source.title),
    COMPARISON.text("mode", "what the comparison is about", lambda source, _: source.mode),
    COMPARISON.text(
        "reference", "what all others are compared with", lambda source, _: source.comparison.reference.label
    ),
    COMPARISON.text(
        "conclusion", "what was found, in numbers", lambda source, _: conclusion(source.comparison)
    ),
    COMPARISON.text("method", "how differences and their significance are decided", lambda *_: _METHOD),
    COMPARISON.text("calibrations", "calibration records of the tests, with their hashes", _calibrations),
    COMPARISON.text("reproducibility", "reproducibility, or why there is none", _reproducibility),
    COMPARISON.text("shown", "which rows the tables of differences show", _shown),
    COMPARISON.text(
        "left_out",
        "what could not be compared, and why",
        lambda source, _: "; ".join(source.comparison.left_out) or None,
    ),
    COMPARISON.date("issued", "day of the comparison", lambda source, _: source.issued),
    COMPARISON.text("software", "program and version that made it", lambda *_: f"toolkit {__version__}"),
    COMPARISON.condition("simulated", "one of the tests is of a virtual machine", _simulated),
    COMPARISON.condition(
        "unverified",
        "one of the tests was computed by an unverified record",
        lambda source, _: any(use.unverified for use in source.comparison.uses),
    ),
    COMPARISON.condition(
        "draft",
        "one of the tests was computed by a record that was not in force for it",
        lambda source, _: any(use.draft for use in source.comparison.uses),
    ),
    COMPARISON.condition(
        "repeats",
        "the tests are repeats of one tire",
        lambda source, _: source.comparison.repeats is not None,
    ),
    COMPARISON.condition(
        "no_findings", "nothing departs from what was expected", lambda source, _: not source.findings
    ),
    COMPARISON.mark("simulated", "if.simulated", _simulated_mark),
    COMPARISON.mark("unverified", "if.unverified comparison.calibrations", _unverified_mark),
    COMPARISON.mark("draft", "comparison.calibrations", _draft_mark),
    finding_table(
        COMPARISON, "comparison_findings", "test, file or condition", lambda source: source.findings
    ),
)


@COMPARISON.table(
    "compared",
    "what is compared: one row a test or a maker's table",
    """
    label|name
    what|tire, or the kind of table
    surface|surface
    pressure|inflation pressure
    day|date of the test
    operator|operator
    mounting|mounting
    calibration|calibration record
    """,
)
def entries(source: Compared, _style: Style) -> Rows:
    """Return what is compared, with its stated conditions."""
    names = ("surface", "pressure", "day", "operator", "mounting", "calibration")
    for entry in source.comparison.entries:
        condition = entry.condition("tire") if entry.kind == "test" else _KINDS[entry.kind]
        yield entry.label, condition or "-", *(entry.condition(name) or "-" for name in names)


@COMPARISON.table("differences", "differences of characteristics from the reference", _DIFFERENCES)
def differences(source: Compared, style: Style) -> Rows:
    """Return the differences of characteristics that people are shown."""
    return (_difference(row, style) for row in shown_rows(source.comparison, "characteristics")[0])


@COMPARISON.table("curve_differences", "significant differences of FY and MZ at slip angles", _DIFFERENCES)
def curve_differences(source: Compared, style: Style) -> Rows:
    """Return the differences at slip angles that people are shown."""
    return (_difference(row, style) for row in shown_rows(source.comparison, "curves")[0])


def _load(load_N: float, style: Style) -> str:
    unit, factor = style.unit("N")
    return style.decimal(f"{load_N * factor:{kept('.0f', factor)}} {unit}")


def _difference(row: Difference, style: Style) -> Row:
    unit, factor = shown_unit(row.name, style)
    return (
        named(row.name, row.rotation, row.SA_rad, title=True),
        _load(row.load_N, style),
        unit,
        with_U(row.reference, factor, style),
        row.label,
        with_U(row.other, factor, style),
        with_U(row.difference, factor, style),
        p_text(row.p_holm, style),
        "*" if row.significant else "",
    )


@COMPARISON.table(
    "factors",
    "factors of repeats: what changed between them",
    """
    factor|factor
    levels|its level in each test
    note|what can be said of it
    """,
)
def factors(source: Compared, _style: Style) -> Rows:
    """Return the factors of repeats."""
    repeats = source.comparison.repeats
    for factor in repeats.factors if repeats else ():
        yield factor.name, ", ".join(level or "-" for level in factor.levels), factor.note or "told apart"


@COMPARISON.table(
    "precision",
    "repeatability and intermediate precision: one row a quantity and load",
    """
    quantity|quantity, with direction of rotation
    load|load
    unit|unit of the row
    n|number of tests
    mean|mean
    s|standard deviation of all
    s_r|repeatability standard deviation, where tests of the same conditions are there
    limit|repeatability limit
    intermediate|intermediate precision by factor; * where the factor adds significantly
    """,
)
def precision(source: Compared, style: Style) -> Rows:
    """Return the precision of each quantity at each load."""
    repeats = source.comparison.repeats
    for row in repeats.precisions if repeats else ():
        unit, factor = shown_unit(row.name, style)

        def number(value: float | None, factor: float = factor) -> str:
            return "-" if value is None else style.decimal(f"{value * factor:.3g}")

        yield (
            named(row.name, row.rotation, title=True),
            _load(row.load_N, style),
            unit,
            str(row.n),
            style.decimal(f"{row.mean * factor:.4g}"),
            number(row.total.value),
            number(row.repeatability.value if row.repeatability else None),
            number(row.limit_r),
            "; ".join(f"{f.factor} {factor_text(f, factor, style)}" for f in row.factors) or "-",
        )


@COMPARISON.table(
    "pattern",
    "pattern effect from a regular and a reversed belt",
    """
    quantity|definition of PRAT
    load|load
    unit|unit of the row
    regular|PRAT of the regular belt
    reversed|PRAT of the reversed belt
    pattern|pattern effect
    body|body effect
    """,
)
def pattern(source: Compared, style: Style) -> Rows:
    """Return the pattern and body effect of each PRAT."""
    for row in source.comparison.pattern:
        unit, factor = shown_unit(row.name, style)
        texts = (with_U(e, factor, style) for e in (row.regular, row.reversed, row.pattern, row.body))
        yield row.name, _load(row.load_N, style), unit, *texts


@COMPARISON.figures(
    {
        f"compared_{figure.name}": f"{figure.title} against load, a series an entry"
        for figure in comparison_figures()
    }
)
def figures(source: Compared, style: Style) -> Iterator[Plot]:
    """Return the characteristics against load that two entries at least have values for."""
    for name, plot in comparison_plots(source.comparison, style).items():
        yield replace(plot, name=f"compared_{name}")


def comparison_plots(comparison: Comparison, style: Style) -> dict[str, Plot]:
    """Return the figures by name; one that fewer than two entries have values for is left out.

    Stiffness is drawn by the ±1 deg secant, as the source document has it, with the drum forward.
    """
    plots = (_plot(comparison, figure, drawn, style) for figure, drawn in comparison_figures().items())
    return {plot.name: plot for plot in plots if plot is not None}


def _plot(comparison: Comparison, figure: Figure, drawn: Characteristic, style: Style) -> Plot | None:
    unit, factor = style.unit(drawn.printed_unit)
    load_unit, load_factor = style.unit("N")
    scale = factor * drawn.factor
    shown_unit = printed(str(unit))
    curves, sentences = [], []
    for place, entry in enumerate(comparison.entries):
        x, y, U = _series(entry, drawn.name)
        if not x:
            continue
        x, y, U = [a * load_factor for a in x], [b * scale for b in y], [c * scale for c in U]
        curves.append(
            Curve(
                label=entry.label, x=tuple(x), y=tuple(y), error=tuple(U), group=place, style="both",
                open=entry.kind != "test",
            )
        )  # fmt: skip
        listed = ", ".join(
            f"{plus_minus(b, c, decimal_comma=style.decimal_comma)} at {_number(a, load_factor, style)}"
            for a, b, c in zip(x, y, U, strict=True)
        )
        sentences.append(f"{entry.label}: {listed} {load_unit}")
    if len(curves) < 2:
        return None
    simulated = any(entry.simulated for entry in comparison.entries)
    words = (*(use.word for use in comparison.uses), "SIMULATED" if simulated else None)
    mark = " - ".join(dict.fromkeys(word for word in words if word))
    title = figure.title + (f", {drawn.series_label}, forward" if drawn.scope == "direction" else "")
    title = title[:1].upper() + title[1:]
    return Plot(
        name=figure.name,
        x_label=f"load FZ [{load_unit}]",
        y_label=f"{figure.title} [{shown_unit}]",
        curves=tuple(curves),
        caption=f"{title} against load; bars: expanded uncertainty (95 %). SAE J670 axes.",
        alt=(f"{mark}. " if mark else "")
        + f"{title} [{shown_unit}] against load with expanded uncertainty. "
        + "; ".join(sentences)
        + ". Axis system: SAE J670.",
        watermark=mark or None,
        legend_title="compared",
    )


def _series(entry: Entry, name: str) -> tuple[list[float], list[float], list[float]]:
    """Return loads [N], values and expanded uncertainties in SI of one quantity of an entry."""
    points = sorted(
        (
            (row.load_N, row.estimate.value, row.estimate.expanded()[0])
            for row in entry.rows
            if row.estimate is not None and row.name == name and row.rotation in ("both", "forward")
        ),
        key=lambda point: point[0],
    )
    return (
        [load for load, _, _ in points],
        [value for _, value, _ in points],
        [U if math.isfinite(U) else 0.0 for _, _, U in points],
    )


def _number(value: float, factor: float, style: Style) -> str:
    return format_number(value, kept(".0f", factor), decimal_comma=style.decimal_comma)
