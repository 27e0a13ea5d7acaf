"""The values of a test's report: the test, the tire, its calibration, the laboratory, and the summary."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path

from toolkit.characteristics.catalogue import summary
from toolkit.characteristics.characteristic import Characteristic
from toolkit.errors import ConfigError
from toolkit.estimate import plus_minus
from toolkit.machine import load_machine
from toolkit.machine.default import DEFAULT_MACHINE
from toolkit.report.content import Value
from toolkit.report.document import DeclaredValue, printed_number
from toolkit.report.style import Style, kept
from toolkit.report.tags import format_number
from toolkit.report.test.characteristics import summary_estimates, summary_load
from toolkit.report.test.content import REPORT, ReportedTest, report_id
from toolkit.report.test.figures import TURNED, load_groups
from toolkit.report.vocabulary import Entry
from toolkit.units import printed
from toolkit.version import __version__

_PSI = 0.45359237 * 9.80665 / 0.0254**2  # Pa


def _pressure(t: ReportedTest, style: Style) -> str | None:
    # As the source document's title page has it: 34 psi, 2.34 bar.
    if t.info.pressure_Pa is None:
        return None
    text = f"{format(round(t.info.pressure_Pa / _PSI, 1), 'g')} psi, {t.info.pressure_Pa / 1e5:.2f} bar"
    return text.replace(".", ",").replace(" psi, ", " psi; ") if style.decimal_comma else text


def _scaled(value: float | None, factor: float) -> float | None:
    return None if value is None else value * factor


def _loads(t: ReportedTest, style: Style) -> str | None:
    unit, factor = style.unit("N")
    loads = [
        format_number(load * factor, kept(".0f", factor), decimal_comma=style.decimal_comma)
        for load, _ in load_groups(t.used)
    ]
    return f"{', '.join(loads)} {unit}" if loads else None


def _slip_angles(t: ReportedTest, _style: Style) -> str | None:
    steps = sorted({round(math.degrees(c.step_SA), 2) for c in t.used if c.step_SA is not None})
    return ", ".join(f"{angle:g}" for angle in steps) + " deg" if steps else None


def _directions(t: ReportedTest, _style: Style) -> str:
    """Return the directions, and what was turned for the reversed run where it was not the road."""
    directions = [r for r in ("forward", "reverse") if any(c.rotation == r for c in t.used)]
    turned = "reverse" in directions and t.info.reversal == "tire"
    return " and ".join(directions) + (f", {TURNED}" if turned else "")


def _pressure_times(factor: float) -> Callable[[ReportedTest, Style], float | None]:
    return lambda t, _: _scaled(t.info.pressure_Pa, factor)


def _axes(t: ReportedTest, _style: Style) -> str:
    axes = t.result.reduced.axes
    return "SAE J670" if axes == "SAE" else axes


def _tare(t: ReportedTest, _style: Style) -> str:
    source = t.result.reduced.tare.source
    return "no tare was subtracted" if source == "none" else source


def _title(t: ReportedTest, _style: Style) -> str:
    return "Tire force and moment test" + (f" {t.info.tire_size}" if t.info.tire_size else "")


def _deviations(t: ReportedTest, _style: Style) -> str:
    count = len(t.findings)
    listed = f"{count} finding{'s' if count > 1 else ''}, listed under Findings"
    return t.details.deviations or (listed if count else "none")


def _item(t: ReportedTest, _style: Style) -> str | None:
    info = t.info
    parts = [part for part in (info.tire_size, info.tire_company, info.tire_series) if part]
    parts += [f"DOT {info.tire_DOT}"] if info.tire_DOT else []
    return t.details.item or (f"tire {', '.join(parts)}" if parts else None)


def _unit(name: str, description: str, unit: str) -> DeclaredValue[ReportedTest]:
    return REPORT.text(f"unit.{name}", description, lambda _, style: printed(str(style.unit(unit)[0])))


def _machine(t: ReportedTest, _style: Style) -> str:
    # By a definition of its own a test names the path of a file, which is of no use to whom it is sent to.
    try:
        return t.result.reduced.machine().name
    except ConfigError:
        return Path(t.info.machine).stem


_text, _number, _date = REPORT.text, REPORT.number, REPORT.date
VALUES = (
    _text("test.name", "name of the test", lambda t, _: t.info.name),
    _text("test.operator", "operator", lambda t, _: t.info.operator and t.titled(t.info.operator)),
    _text("test.requestor", "requestor (customer)", lambda t, _: t.info.requestor),
    _text("test.special", "what is special about the test", lambda t, _: t.info.special),
    _text("test.surface", "surface of the road", lambda t, _: t.info.surface),
    _text("test.machine", "name of the test machine", _machine),
    _text(
        "machine.title",
        "the test machine as its definition calls it, else its name",
        lambda t, style: t.result.reduced.machine_title or _machine(t, style),
    ),
    _text("test.pressure", "test pressure in psi and bar", _pressure),
    _text("test.loads", "the loads of the test, means of the blocks", _loads),
    _text("test.slip_angles", "the slip-angle steps of the test", _slip_angles),
    _text("test.directions", "directions of rotation", _directions),
    _text("test.axes", "axis system of all results", _axes),
    _text("test.averaging", "what was averaged and discarded", lambda t, _: t.result.reduced.averaging),
    _text("test.tare", "which tare was subtracted", _tare),
    _text("tire.size", "tire size", lambda t, _: t.info.tire_size),
    _text("tire.company", "maker", lambda t, _: t.info.tire_company),
    _text("tire.DOT", "DOT number", lambda t, _: t.info.tire_DOT),
    _text("tire.series", "series", lambda t, _: t.info.tire_series),
    _text("tire.construction", "construction", lambda t, _: t.info.tire_construction),
    _text("tire.rim", "rim", lambda t, _: t.info.tire_rim),
    _text("calibration.id", "id of the calibration record that computed the forces", lambda t, _: t.use.id),
    _text("calibration.hash", "SHA-256 of the calibration record", lambda t, _: t.use.sha256),
    _text(
        "calibration.instrument",
        "instrument of the calibration record",
        lambda t, style: t.record.instrument if t.record else _machine(t, style),
    ),
    _text("calibration.status", "verified, unverified, or not approved and why", lambda t, _: t.use.status),
    _text("report.id", "id of the report, made from its inputs", lambda t, _: report_id(t.result, t.details)),
    _text("report.title", "title of the report", _title),
    _text("software.name", "program", lambda *_: "toolkit"),
    _text("software.version", "version of the program", lambda *_: __version__),
    _text("laboratory.name", "laboratory (from the style file)", lambda _, style: style.laboratory),
    _text("laboratory.address", "its address (from the style file)", lambda _, style: style.address),
    _text("laboratory.contact", "how to reach it (from the style file)", lambda _, style: style.contact),
    _text(
        "laboratory.accreditation",
        "its accreditation (from the style file)",
        lambda _, style: style.accreditation,
    ),
    _text(
        "report.customer",
        "customer: of [report] in test.toml, else the requestor",
        lambda t, _: t.details.customer or t.info.requestor,
    ),
    _text(
        "report.customer_contact",
        "the customer's address or contact",
        lambda t, _: t.details.customer_contact,
    ),
    _text(
        "report.location",
        "where the test was made: of [report], else the laboratory's place",
        lambda t, style: t.details.location or style.place or style.address,
    ),
    _text(
        "report.method",
        "method: of [report], else of the style file, else what the test's protocol names",
        lambda t, style: t.details.method or style.method or t.result.reduced.protocol,
    ),
    _text(
        "report.deviations",
        "deviations from the method: of [report], else a count of the findings",
        _deviations,
    ),
    _text("report.sampling", "sampling plan", lambda t, _: t.details.sampling),
    _text("report.conformity", "statement of conformity", lambda t, _: t.details.conformity),
    _text("report.external", "results that come from another laboratory", lambda t, _: t.details.external),
    _text(
        "report.authorised_by",
        "who authorises the report: of [report], else of the style file",
        lambda t, style: t.titled(t.details.authorised_by or style.authorised_by or "") or None,
    ),
    _text(
        "report.authorised_function",
        "function of that person",
        lambda t, style: t.details.function or style.function,
    ),
    _text("report.amends", "id of the report that this one replaces", lambda t, _: t.details.amends),
    _text("report.amendment", "why it is replaced", lambda t, _: t.details.amendment),
    _text(
        "item.description",
        "the item tested: of [report], else size, maker, series and DOT number of the tire",
        _item,
    ),
    _text("item.condition", "condition of the item as received", lambda t, _: t.details.condition),
    _text(
        "simulated",
        "simulated data or measured data",
        lambda t, _: "simulated data" if t.info.simulated else "measured data",
    ),
    _unit("force", "unit of forces in the report", "N"),
    _unit("moment", "unit of moments", "N*m"),
    _unit("force_per_angle", "unit of the cornering stiffness", "N/deg"),
    _unit("moment_per_angle", "unit of the aligning stiffness", "N*m/deg"),
    _date("test.date", "date of the test", lambda t, _: t.info.date),
    _date("report.date", "date of issue", lambda t, _: t.issued),
    _date("item.received", "date on which the item was received", lambda t, _: t.details.received),
    *(
        _number(f"test.pressure.{unit}", "test pressure", _pressure_times(factor), unit=unit, spec=spec)
        for unit, factor, spec in (("psi", 1 / _PSI, ".1f"), ("bar", 1e-5, ".2f"), ("kPa", 1e-3, ".0f"))
    ),
    _number(
        "test.speed",
        "speed of the road's surface",
        lambda t, _: _scaled(t.info.speed_m_s, 3.6),
        unit="km/h",
        spec=".2f",
    ),
    _number(
        "test.rated_load", "rated load of the tire", lambda t, _: t.info.rated_load_N, unit="N", spec=".0f"
    ),
    _number(
        "test.files",
        "number of recordings",
        lambda t, _: len({c.file for c in t.result.reduced.conditions}),
        unit="1",
        spec="d",
    ),
    _number("test.conditions", "number of conditions used", lambda t, _: len(t.used), unit="1", spec="d"),
    _number("test.findings", "number of findings", lambda t, _: len(t.findings), unit="1", spec="d"),
    _number(
        "summary.load",
        "load of the summary: nearest to the rated load, else the middle one",
        lambda t, _: summary_load(t.result),
        unit="N",
        spec=".0f",
    ),
)


def _summarised(
    characteristic: Characteristic,
) -> tuple[DeclaredValue[ReportedTest], DeclaredValue[ReportedTest]]:
    """Return the value of a characteristic at the load of the summary, and its text with ``U``."""
    name = str(characteristic.summary)
    number = _number(
        f"summary.{name}",
        characteristic.summary_text,
        lambda t, _: summary_estimates(t.result)[name],
        unit=characteristic.printed_unit,
        spec=f".{characteristic.digits}f",
    )

    def with_U(t: ReportedTest, style: Style) -> str | None:
        """Return ``45.0 ± 6.1`` in the organisation's unit."""
        if summary_load(t.result) is None:
            return None
        value = printed_number(summary_estimates(t.result)[name], number.entry, style)
        if value.missing:
            return "n/a"
        if value.U is None:
            return value.text(None, style)
        return plus_minus(float(value.value or 0.0), value.U, decimal_comma=style.decimal_comma)

    description = f"{characteristic.summary_text}, with its expanded uncertainty; n/a where there is none"
    return number, _text(f"summary.{name}.with_U", description, with_U)


SUMMARY = tuple(value for characteristic in summary() for value in _summarised(characteristic))

# The coefficients of the default machine's cells, sorted, stand for those of all.
_DEFAULT_CELLS = sorted(column.symbol for column in load_machine(DEFAULT_MACHINE).indications)
_COEFFICIENTS = [
    Entry(
        path=f"calibration.{load}.{term}",
        kind="number",
        spec=".6g",
        description=f"coefficient of {term} in {load}, in the record's units",
    )
    for load in ("FY", "MZ")
    for term in (*_DEFAULT_CELLS, "intercept")
]


@REPORT.open_values(r"calibration\.(?:FY|MZ|MX|FX|FZ)\.[A-Za-z0-9_^*()]+", _COEFFICIENTS)
def coefficients(t: ReportedTest, style: Style) -> Mapping[str, Value]:
    """Return the coefficients of the record by the paths of their tags."""
    entries = (
        (
            Entry(path=f"calibration.{load.load}.{term}", kind="number", spec=".6g", description=""),
            coefficient,
        )
        for load in (t.record.loads if t.record else ())
        for term, coefficient in zip(load.terms, load.coefficients, strict=True)
    )
    return {entry.path: printed_number(coefficient, entry, style) for entry, coefficient in entries}
