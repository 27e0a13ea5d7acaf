"""A certificate to report content: texts, tables and pictures of the certificate's vocabulary."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import replace

from toolkit.estimate import round_to_uncertainty, round_uncertainty
from toolkit.report.certificate.model import VERDICTS, Certificate, LoadResult
from toolkit.report.certificate.plots import build_plots
from toolkit.report.certificate.statements import RULES
from toolkit.report.certificate.vocabulary import CERTIFICATE, TABLES
from toolkit.report.content import Cell, ReportContent, Table, Value
from toolkit.report.style import Style
from toolkit.version import __version__

GAP = "NOT STATED"
_PERCENT = re.compile(r"\d+\.\d+(?= %)")
# Columns of names: a serial number such as 12.5 stays what it is.
_NAMES = {"cell", "serial", "load", "term", "unit", "found_by", "row"}
SIMULATED = "SIMULATED: the instrument is a virtual machine. No real load cell was calibrated."
DRAFT = "DRAFT: the record is not approved. This paper is not a calibration certificate."
UNCERTAINTY = (
    "The expanded uncertainty U is the standard uncertainty of the load multiplied by the coverage factor k "
    "of its row, for a coverage probability p of about 95 % (JCGM 100:2008; ILAC-P14:09/2020). It is that of "
    "a load computed by the equation below from one reading, at the time and under the conditions of the "
    "calibration."
)


def build_content(certificate: Certificate, style: Style | None = None) -> ReportContent:
    """Return what a certificate's template can ask for; dates and decimal signs by the style file."""
    style = style or Style()
    values = {
        f"certificate.{name}": Value(kind="text", value=text)
        for name, text in _texts(certificate, style).items()
    }
    values |= {
        f"certificate.{name}": Value(kind="date", value=None if day is None else day.isoformat())
        for name, day in (
            ("issued", certificate.issued),
            ("received", certificate.received),
            ("calibrated", certificate.calibrated),
            ("approved_on", certificate.approved_on),
        )
    }
    plots = {
        name: replace(plot, decimal_comma=style.decimal_comma)
        for name, plot in build_plots(certificate).items()
    }
    values |= {f"caption.{name}": Value(kind="text", value=plot.caption) for name, plot in plots.items()}
    tables = _tables(certificate, style)
    conditions = dict.fromkeys(CERTIFICATE.conditions, False)
    conditions |= {path: not value.missing for path, value in values.items()}
    conditions |= {name: bool(table.rows) for name, table in tables.items()}
    conditions |= dict.fromkeys(plots, True)
    conditions |= {
        "draft": certificate.draft,
        "simulated": certificate.simulated,
        "withdrawn": certificate.withdrawn is not None,
        "amended": certificate.replaces is not None,
        "interval_agreed": certificate.interval is not None,
        "gaps": bool(certificate.gaps),
        "conformity_stated": any(one.verdict for one in certificate.loads),
        "adjusted": bool(tables["adjustment"].rows),
    }
    marks = []
    if certificate.simulated:
        marks.append(("simulated", SIMULATED))
    if certificate.draft:
        marks.append(("draft", draft_text(certificate)))
    if certificate.withdrawn:
        marks.append(("withdrawn", f"WITHDRAWN: {certificate.withdrawn}"))
    if certificate.replaces:
        marks.append(
            ("amended", f"This certificate replaces {certificate.replaces}: {certificate.amendment}")
        )
    return ReportContent(
        values=values,
        tables=tables,
        plots=plots,
        conditions=conditions,
        calibrations=(certificate.use,),
        title=f"Calibration certificate {certificate.id}",
        author=certificate.laboratory or "laboratory not stated",
        identity=certificate.id,
        subject=f"Calibration of {certificate.instrument}",
        issued=certificate.issued.isoformat(),
        marks=tuple(marks),
        style=style,
        vocabulary=CERTIFICATE,
    )


def draft_text(c: Certificate) -> str:
    """Return what a paper that is no certificate says of itself, and why."""
    return f"{DRAFT} {c.record}: {'; '.join(c.draft_reasons)}."


def _texts(c: Certificate, style: Style) -> dict[str, str | None]:
    temperature = None if c.temperature_C is None else f"{_signed(f'{c.temperature_C:.4g}', style)} °C"
    rule = _PERCENT.sub(lambda found: _signed(found[0], style), RULES[c.rule]) if c.rule else None
    return {
        "id": c.id,
        "title": "Calibration certificate" + (", amended" if c.replaces else ""),
        "laboratory": c.laboratory or GAP,
        "address": c.address or GAP,
        "place": c.place or GAP,
        "accreditation": c.accreditation,
        "customer": ", ".join(one for one in (c.customer, c.customer_address) if one) or GAP,
        "item": c.item,
        "instrument": c.instrument,
        "model": c.model,
        "method": c.method or GAP,
        "phase": {"as_found": "as found", "as_left": "as left"}.get(c.phase or "", "as calibrated"),
        "temperature": temperature or GAP,
        "reference": c.reference or GAP,
        "reference_certificate": c.reference_certificate or GAP,
        "traceability": traceability(c, style),
        "uncertainty": uncertainty(c),
        "decision_rule": rule or f"{GAP}: no decision rule was agreed.",
        "conformity": conformity(c, style),
        "adjustment": c.adjustment,
        "unverifiable": unverifiable(c),
        "opinions": c.opinions,
        "interval": c.interval,
        "replaces": c.replaces,
        "amendment": c.amendment,
        "entered_by": c.entered_by,
        "checked_by": c.checked_by or ("DRAFT: not checked" if c.draft else GAP),
        "approved_by": c.approved_by
        or ("DRAFT: not approved" if c.draft else f"{c.checked_by or GAP} (checked and released)"),
        "in_force_from": None if c.in_force_from is None else c.in_force_from.isoformat(),
        "status": f"not approved: {'; '.join(c.draft_reasons)}" if c.draft else c.status,
        "withdrawn": c.withdrawn,
        "record": c.record,
        "record_hash": c.record_sha256,
        "ledger_head": c.ledger_head,
        "software": f"toolkit {__version__}",
        "record_software": ", ".join(f"{name} {version}" for name, version in c.record_software) or GAP,
        "not_stated": "; ".join(c.gaps) if c.gaps else None,
    }


def traceability(c: Certificate, style: Style | None = None) -> str:
    """Return the statement of metrological traceability (ISO/IEC 17025:2017, 7.8.4.1 c, annex A).

    Without a style its numbers have a decimal point, as in the DCC.
    """
    if c.reference is None:
        return f"{GAP}: the session names no reference standard."
    text = (
        f"The results are traceable through the reference standard {c.reference}, certificate "
        f"{c.reference_certificate or GAP}."
    )
    for load, U, k, unit in c.reference_uncertainties:
        # As the standard's own certificate states it, where that takes fewer digits.
        stated = min(round_uncertainty(U), f"{U:g}", key=len)
        told, factor = _signed(stated, style), _signed(f"{k:g}", style)
        text += f" Its uncertainty for {load}: U = {told} {shown(unit)}, k = {factor}."
    return text


def uncertainty(c: Certificate) -> str:
    """Return the statement about U, with what it does not hold."""
    absent = sorted({name for one in c.loads for name in one.not_stated})
    if not absent:
        return UNCERTAINTY
    return f"{UNCERTAINTY} It holds no contribution of {', '.join(absent)}: nothing was stated or measured."


def conformity(c: Certificate, style: Style | None = None) -> str:
    """Return the statement of conformity, or why there is none (ISO/IEC 17025:2017, 7.8.6)."""
    if c.rule is None:
        return "No conformity is stated: no decision rule was agreed."
    if not any(one.checks for one in c.loads):
        return "No conformity is stated: the session has no check loads."
    parts = []
    for one in c.loads:
        limit = f"tolerance {_signed(f'{one.tolerance:.4g}', style)} {shown(one.unit)}"
        if one.verdict is None:
            parts.append(f"{one.load}: not stated for all check loads ({limit})")
        else:
            parts.append(f"{one.load}: {VERDICTS[one.verdict]} ({len(one.checks)} check loads, {limit})")
    return "; ".join(parts) + "."


def unverifiable(c: Certificate) -> str:
    """Return the statement about terms that no check load could verify."""
    if not c.unverifiable:
        return "The check loads verified every term of the equations."
    if not any(one.checks for one in c.loads):
        return "The session has no check loads: no term of the equations is verified by them."
    return "The check loads could not verify these terms: a wrong value would not have shown in them."


def shown(unit: str) -> str:
    """Return a unit as it is printed.

    >>> shown("lbf*ft/(mV/V)")
    'lbf·ft/(mV/V)'
    """
    return unit.replace("*", "·")


def _tables(c: Certificate, style: Style) -> dict[str, Table]:
    rows: dict[str, list[list[str]]] = {
        "cells": [
            [
                cell.name,
                cell.serial or GAP,
                shown(cell.unit),
                _g(cell.minimum),
                _g(cell.maximum),
                _g(resolution),
            ]
            for cell, resolution in zip(c.cells, c.resolutions, strict=True)
        ],
        "coefficients": [
            [
                one.load,
                t.term,
                repr(t.full),
                repr(t.issued),
                round_uncertainty(t.standard_error),
                shown(t.unit),
            ]
            for one in c.loads
            for t in one.terms
        ],
        "uncertainty": [row for one in c.loads for row in _uncertainty(one)],
        "budget": [row for one in c.loads for row in _budget(one)],
        "fit": [_fit(one) for one in c.loads],
        "check": [row for one in c.loads for row in _checks(one)],
        "adjustment": [_adjustment(one) for one in c.loads if one.adjustment],
        "unverifiable": [list(pair) for pair in c.unverifiable],
    }
    return {
        name: Table(
            name=name,
            columns=columns,
            rows=tuple(_localised(row, [column.name for column in columns], style) for row in rows[name]),
        )
        for name, (_, columns) in TABLES.items()
    }


def _uncertainty(one: LoadResult) -> Iterable[list[str]]:
    full = max(abs(one.minimum), abs(one.maximum))
    for at in one.range:
        dof = f"{at.dof:.0f}" if math.isfinite(at.dof) and at.dof < 1e4 else "∞"
        yield [
            one.load, round_to_uncertainty(at.at, at.U), f"{100 * at.at / full:.0f}", round_uncertainty(at.U),
            shown(one.unit), f"{at.k:.2f}", f"{100 * at.probability:g}", dof,
        ]  # fmt: skip


def _budget(one: LoadResult) -> Iterable[list[str]]:
    for part in one.parts:
        if not part.stated:
            continue  # the statement about U names what it does not hold
        dof = f"{part.dof:.0f}" if math.isfinite(part.dof) and part.dof < 1e4 else "∞"
        yield [
            one.load, part.name, part.evaluation, part.distribution, round_uncertainty(part.u),
            shown(one.unit), dof, f"{100 * part.share:.1f}", part.source,
        ]  # fmt: skip


def _fit(one: LoadResult) -> list[str]:
    return [
        one.load, shown(one.unit), f"{one.minimum:g}", f"{one.maximum:g}", str(one.n), str(one.dof),
        f"{one.residual_sd:.3g}", f"{max(one.residuals, key=abs):+.3g}",
    ]  # fmt: skip


def _checks(one: LoadResult) -> Iterable[list[str]]:
    for line in one.checks:
        U = line.uncertainty.U
        said = VERDICTS[line.verdict] if line.verdict else "beyond the range" if line.beyond else "not stated"
        yield [
            one.load, str(line.row), f"{line.reference:.10g}", round_to_uncertainty(line.result, U),
            round_to_uncertainty(line.deviation, U), round_uncertainty(U), f"{one.tolerance:.4g}",
            shown(one.unit), said,
        ]  # fmt: skip


def _adjustment(one: LoadResult) -> list[str]:
    told = one.adjustment
    assert told is not None  # noqa: S101  only loads with one are asked
    left, left_U = "not measured", "-"
    if told.as_left is not None and told.left is not None:
        left, left_U = round_to_uncertainty(told.as_left, told.left.U), round_uncertainty(told.left.U)
    U = told.found.U
    return [
        one.load, told.found_by, round_to_uncertainty(told.as_found, U), f"{told.found.at:.6g}", left,
        f"{one.tolerance:.4g}", shown(one.unit), round_uncertainty(U), left_U,
    ]  # fmt: skip


def _g(value: float | None) -> str:
    return "-" if value is None else f"{value:.6g}"


def _localised(row: list[str], names: list[str], style: Style) -> tuple[Cell, ...]:
    # Numbers are texts here, rounded to their uncertainty: only the decimal sign is the organisation's.
    return tuple(
        _signed(cell, style) if name not in _NAMES and _is_number(cell) else cell
        for name, cell in zip(names, row, strict=True)
    )


def _signed(number: str, style: Style | None) -> str:
    return number.replace(".", ",") if style and style.decimal_comma else number


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
