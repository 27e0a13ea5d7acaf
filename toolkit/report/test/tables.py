"""The tables of a test's report, each declared with what builds it: plain numbers, SAE J670."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from toolkit.calibration.uncertainty.common_errors import standard_errors
from toolkit.report.document import Rows
from toolkit.report.style import Style
from toolkit.report.tags import format_number
from toolkit.report.test.content import REPORT, ReportedTest
from toolkit.report.vocabulary import columns_of, number_column
from toolkit.units import from_si, printed

if TYPE_CHECKING:
    from toolkit.machine import TypeB
    from toolkit.report.content import Cell

_DEG = math.pi / 180
_STATED = {
    "FZ": "load",
    "zero": "zero of the cells, without a tare",
    "SA": "zero of the slip angle",
    "SA_scale": "scale of the slip angle",
    "P": "inflation pressure",
}
_COMMON = {"machine": "all tests of the machine", "test": "this test"}


@REPORT.table(
    "results",
    "one row a condition, as measured, SAE J670",
    """
    rotation|direction of rotation
    SA|measured slip angle|deg|.2f
    FZ|measured load|force|.0f
    FY|lateral force|force|.1f|U of U_FY
    U_FY|expanded uncertainty of FY, every source, k = 2|force|.1f|U of U_FY
    MZ|aligning moment|moment|.2f|U of U_MZ
    U_MZ|expanded uncertainty of MZ, every source, k = 2|moment|.2f|U of U_MZ
    file|recording
    """,
)
def results(report: ReportedTest, _style: Style) -> Rows:
    """Return the conditions that were used."""
    points = {(point.file, point.first_row): point for point in report.result.characteristics.points}
    for c in report.used:
        u = points[c.file, c.first_row]
        yield c.rotation, c.SA / _DEG, c.FZ, c.FY, 2 * u.u_FY, c.MZ, 2 * u.u_MZ, c.file


@REPORT.table(
    "stated",
    "standard uncertainties that the machine states of what has no calibration record of its own",
    """
    quantity|what it is the uncertainty of
    u|standard uncertainty, in a unit and relative to the value
    common|whether its error is the same in all tests of the machine, or another in each
    source|where the figure comes from
    """,
)
def stated(report: ReportedTest, style: Style) -> Rows:
    """Return what the machine states; the two parts of one uncertainty add as squares."""
    for statement in report.result.reduced.stated:
        parts = " and ".join(_parts(statement, style))
        name = _STATED.get(statement.symbol, statement.symbol)
        yield name, parts, _COMMON[statement.common], statement.source


def _parts(statement: TypeB, style: Style) -> list[str]:
    def shown(value: float, unit: str) -> str:
        return f"{format_number(value, '.3g', decimal_comma=style.decimal_comma)} {unit}"

    parts = []
    if statement.u and statement.symbol == "FZ":
        unit, factor = style.unit("N")
        parts.append(shown(statement.u * factor, str(unit)))
    elif statement.u and statement.symbol == "P":
        parts.append(shown(float(from_si(statement.u, "kPa")), "kPa"))
    elif statement.u:
        parts.append(shown(math.degrees(statement.u), "deg"))
    if statement.relative:
        parts.append(shown(100 * statement.relative, "%"))
    if statement.effect and parts:
        parts[-1] += f", of which a force follows {shown(100 * statement.effect, '%')}"
    return parts


@REPORT.table(
    "fits",
    "Magic Formula per load, channel and direction",
    """
    channel|FY or MZ
    rotation|direction of rotation
    load|mean load of the block|force|.0f
    B|Magic Formula B|1/rad|.3f|U of u_B
    u_B|standard error of B|1/rad|.3f|U of u_B
    C|Magic Formula C|1|.3f|U of u_C
    u_C|standard error of C|1|.3f|U of u_C
    D|Magic Formula D in the channel's unit||.1f|U of u_D
    u_D|standard error of D in the channel's unit||.1f|U of u_D
    E|Magic Formula E|1|.3f|U of u_E
    u_E|standard error of E|1|.3f|U of u_E
    Sh|Magic Formula Sh|deg|.3f|U of u_Sh
    u_Sh|standard error of Sh|deg|.3f|U of u_Sh
    Sv|Magic Formula Sv in the channel's unit||.2f|U of u_Sv
    u_Sv|standard error of Sv in the channel's unit||.2f|U of u_Sv
    error|error of the fit|%|.2f
    floor|scatter of the measurements about their bin means|%|.2f
    """,
)
def fits(report: ReportedTest, style: Style) -> Rows:
    """Return the fitted curves, those of FY first."""
    for channel, unit in (("FY", "N"), ("MZ", "N*m")):
        factor = style.unit(unit)[1]
        for direction in report.result.characteristics.fits:
            fit = getattr(direction, channel)
            if fit is None:
                continue
            row: dict[str, Cell] = {
                "channel": channel,
                "rotation": direction.rotation,
                "load": direction.load_N,
                "error": fit.error_percent,
                "floor": fit.scatter_floor_percent,
            }
            for p in fit.parameters:
                scale = factor if p.name in ("D", "Sv") else 1 / _DEG if p.name == "Sh" else 1.0
                row[p.name] = p.value * scale
                row[f"u_{p.name}"] = None if p.standard_error is None else p.standard_error * scale
            yield row


@REPORT.table(
    "calibration",
    "coefficients of the calibration record",
    """
    load|computed load
    term|term
    coefficient|full-precision coefficient||.6g
    issued|coefficient as issued on the certificate||.6g
    standard_error|standard error||.2g
    unit|unit of load and indication
    """,
)
def calibration(report: ReportedTest, style: Style) -> Rows:
    """Return the terms of every load."""
    record = report.record
    units = record.units if record else {}
    for load in record.loads if record else ():
        errors = standard_errors(record, load.load) if record else ()
        for i, term in enumerate(load.terms):
            unit = units.get(term)
            yield (
                load.load,
                term,
                load.coefficients[i],
                style.decimal(load.issued_texts[i]),
                errors[i] if i < len(errors) else None,
                printed(f"{load.unit} per {unit}" if unit else load.unit),
            )


@REPORT.table(
    "acquisition",
    "the acquisition program's own FY and MZ against the report's, one row a file",
    (
        *columns_of("file|recording"),
        number_column("FY_difference", "largest |FY of the file - FY|", "force", ".1f"),
        number_column("MZ_difference", "largest |MZ of the file - MZ|", "moment", ".2f"),
    ),
)
def acquisition(report: ReportedTest, _style: Style) -> Rows:
    """Return the largest differences of each file that has values of its own."""
    files: dict[str, dict[str, float]] = {}
    for c in report.used:
        row = files.setdefault(c.file, {})
        for name, theirs, ours in (("FY_difference", c.FY_file, c.FY), ("MZ_difference", c.MZ_file, c.MZ)):
            if theirs is not None:
                row[name] = max(row.get(name, 0.0), abs(theirs - ours))
    return [{"file": file, **row} for file, row in files.items() if row]


@REPORT.table(
    "findings",
    "departures from what was expected",
    """
    rule|rule
    level|error, warning or note
    where|file, block or channel
    message|what was found
    """,
)
def findings(report: ReportedTest, _style: Style) -> Rows:
    """Return the findings that the report lists."""
    return ((finding.rule, finding.level, finding.where, finding.message) for finding in report.findings)


@REPORT.table(
    "opinions",
    "opinions and interpretations, which are not results of the test",
    """
    statement|opinion or interpretation
    basis|what it rests on
    """,
)
def opinions(report: ReportedTest, _style: Style) -> Rows:
    """Return what people stated."""
    return ((opinion.statement, opinion.basis) for opinion in report.details.opinions)


@REPORT.table(
    "files",
    "the recordings and their hashes",
    """
    file|recording
    rotation|direction of rotation
    sha256|SHA-256 of the file
    """,
)
def files(report: ReportedTest, _style: Style) -> Rows:
    """Return the recordings, each once."""
    recordings = {c.file: c for c in report.result.reduced.conditions}
    return ((c.file, c.rotation, c.file_sha256) for c in recordings.values())
