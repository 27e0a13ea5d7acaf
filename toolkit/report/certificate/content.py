"""A certificate as a document: its texts and marks, each declared with what builds it.

Required of every template are the items without which a paper is no calibration certificate: ISO/IEC
17025:2017, 7.8.2.1 and 7.8.4.1.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from toolkit.estimate import round_uncertainty
from toolkit.report.certificate.model import Certificate
from toolkit.report.certificate.statements import RULES, VERDICTS
from toolkit.report.content import ReportContent
from toolkit.report.document import Document
from toolkit.report.style import Style
from toolkit.units import printed
from toolkit.version import __version__

if TYPE_CHECKING:
    from toolkit.calibration.session.statements import DigitalSource

GAP = "NOT STATED"
_PERCENT = re.compile(r"\d+\.\d+(?= %)")
SIMULATED = "SIMULATED: the instrument is a virtual machine. No real load cell was calibrated."
DRAFT = "DRAFT: the record is not approved. This paper is not a calibration certificate."
UNCERTAINTY = (
    "The expanded uncertainty U is the standard uncertainty of the load multiplied by the coverage factor k "
    "of its row, for a coverage probability p of about 95 % (JCGM 100:2008; ILAC-P14:09/2020). It is that of "
    "a load computed by the equation below from one reading, at the time and under the conditions of the "
    "calibration."
)

_REQUIRED = (
    "title id laboratory address place customer method item calibrated issued checked_by temperature "
    "uncertainty traceability record_hash ledger_head"
).split()

CERTIFICATE: Document[Certificate] = Document(
    name="certificate",
    family="certificate",
    package=__package__,
    required=tuple(f"tk:certificate.{name}" for name in _REQUIRED),
)


def build_content(certificate: Certificate, style: Style | None = None) -> ReportContent:
    """Return what a certificate's template can ask for; dates and decimal signs by the style file."""
    return CERTIFICATE.content(
        certificate,
        style or Style(),
        calibrations=(certificate.use,),
        title=f"Calibration certificate {certificate.id}",
        author=certificate.stated.get("laboratory") or "laboratory not stated",
        identity=certificate.id,
        subject=f"Calibration of {certificate.record.instrument}",
        issued=certificate.issued,
    )


def draft_text(c: Certificate) -> str:
    """Return what a paper that is no certificate says of itself, and why."""
    return f"{DRAFT} {c.record.id}: {'; '.join(c.draft_reasons)}."


def traceability(c: Certificate, style: Style | None = None) -> str:
    """Return the statement of metrological traceability (ISO/IEC 17025:2017, 7.8.4.1 c, annex A).

    Without a style its numbers have a decimal point, as in the DCC.
    """
    reference = c.statements.reference
    if reference.standard is None:
        return f"{GAP}: the session names no reference standard."
    text = (
        f"The results are traceable through the reference standard {reference.standard}, certificate "
        f"{reference.certificate or GAP}."
    )
    for stated in reference.uncertainties:
        U, unit = stated.U, c.record.load(stated.load).unit
        if stated.relative is not None:
            U, unit = 100 * stated.relative, "% of the applied load"
        # As the standard's own certificate states it, where that takes fewer digits.
        shortest = min(round_uncertainty(U), f"{U:g}", key=len)
        text += (
            f" Its uncertainty for {stated.load}: U = {signed(shortest, style)} {printed(unit)}, "
            f"k = {signed(f'{stated.k:g}', style)}."
        )
    return text if reference.digital is None else text + _digital(reference.digital)


def _digital(source: DigitalSource) -> str:
    accredited = f", {source.accreditation}" if source.accreditation else ""
    places = "; ".join(f"{load}: {source.place(load)}" for load, *_ in source.places)
    return (
        f" These numbers are taken from its digital certificate {source.file} by {source.laboratory}"
        f"{accredited} (SHA-256 {source.sha256}; sealed by {source.signer}, certificate "
        f"{source.signer_sha256}), at {places}."
    )


def uncertainty(c: Certificate) -> str:
    """Return the statement about U, with what it does not hold."""
    absent = sorted({name for load in c.loads for name in load.full_scale.not_stated})
    if not absent:
        return UNCERTAINTY
    return f"{UNCERTAINTY} It holds no contribution of {', '.join(absent)}: nothing was stated or measured."


def conformity(c: Certificate, style: Style | None = None) -> str:
    """Return the statement of conformity, or why there is none (ISO/IEC 17025:2017, 7.8.6)."""
    if c.stated.rule is None:
        return "No conformity is stated: no decision rule was agreed."
    if not any(load.checks for load in c.loads):
        return "No conformity is stated: the session has no check loads."
    parts = []
    for load in c.loads:
        limit = f"tolerance {signed(f'{load.tolerance:.4g}', style)} {printed(load.unit)}"
        if load.verdict is None:
            parts.append(f"{load.load}: not stated for all check loads ({limit})")
        else:
            parts.append(f"{load.load}: {VERDICTS[load.verdict]} ({len(load.checks)} check loads, {limit})")
    return "; ".join(parts) + "."


def unverifiable(c: Certificate) -> str:
    """Return the statement about terms that no check load could verify."""
    if not c.unverifiable:
        return "The check loads verified every term of the equations."
    if not any(load.checks for load in c.loads):
        return "The session has no check loads: no term of the equations is verified by them."
    return "The check loads could not verify these terms: a wrong value would not have shown in them."


def signed(number: str, style: Style | None) -> str:
    """Return a number as text with the decimal sign of the organisation."""
    return style.decimal(number) if style else number


def _temperature(c: Certificate, style: Style) -> str:
    at = c.statements.temperature_C
    return GAP if at is None else f"{signed(f'{at:.4g}', style)} °C"


def _decision_rule(c: Certificate, style: Style) -> str:
    if not c.stated.rule:
        return f"{GAP}: no decision rule was agreed."
    return _PERCENT.sub(lambda number: signed(number[0], style), RULES[c.stated.rule])


def _phase(c: Certificate, _style: Style) -> str:
    return {"as_found": "as found", "as_left": "as left"}.get(c.statements.phase or "", "as calibrated")


def _customer(c: Certificate, _style: Style) -> str:
    return ", ".join(filter(None, map(c.stated.get, ("customer", "customer_address")))) or GAP


def _checked_by(c: Certificate, _style: Style) -> str:
    return c.checked_by or ("DRAFT: not checked" if c.draft else GAP)


def _approved_by(c: Certificate, _style: Style) -> str:
    released = f"{c.checked_by or GAP} (checked and released)"
    return c.approved_by or ("DRAFT: not approved" if c.draft else released)


def _in_force_from(c: Certificate, _style: Style) -> str | None:
    day = c.approval and c.approval.in_force_from
    return day.isoformat() if day else None


def _status(c: Certificate, _style: Style) -> str:
    return f"not approved: {'; '.join(c.draft_reasons)}" if c.draft else c.status.state


def _record_software(c: Certificate, _style: Style) -> str:
    return ", ".join(f"{name} {version}" for name, version in c.record.software) or GAP


def _amended_mark(c: Certificate, _style: Style) -> str | None:
    return f"This certificate replaces {c.replaces}: {c.amendment}" if c.replaces else None


_text, _date, _when, _mark = CERTIFICATE.text, CERTIFICATE.date, CERTIFICATE.condition, CERTIFICATE.mark
VALUES = (
    _text("id", "unique identification of the certificate", lambda c, _: c.id),
    _text("title", "title", lambda c, _: "Calibration certificate" + (", amended" if c.replaces else "")),
    _text("laboratory", "name of the laboratory", lambda c, _: c.stated.get("laboratory") or GAP),
    _text("address", "its address", lambda c, _: c.stated.get("address") or GAP),
    _text("place", "where the calibration was done", lambda c, _: c.stated.get("place") or GAP),
    _text("accreditation", "accreditation, where one was stated", lambda c, _: c.stated.get("accreditation")),
    _text("customer", "name and address of the customer", _customer),
    _text("item", "what was calibrated", lambda c, _: c.item),
    _text("instrument", "instrument", lambda c, _: c.record.instrument),
    _text("model", "form of the calibration equation and method of its fit", lambda c, _: c.model),
    _text("method", "method of the calibration", lambda c, _: c.stated.get("method") or GAP),
    _text("phase", "state of the item: as found, as left, or not stated", _phase),
    _text("temperature", "temperature during the calibration", _temperature),
    _text("reference", "reference standard", lambda c, _: c.statements.reference.standard or GAP),
    _text(
        "reference_certificate",
        "certificate of the reference standard",
        lambda c, _: c.statements.reference.certificate or GAP,
    ),
    _text("traceability", "statement of metrological traceability", traceability),
    _text("uncertainty", "statement about the expanded uncertainty", lambda c, _: uncertainty(c)),
    _text("decision_rule", "decision rule of the conformity statement, and its risk", _decision_rule),
    _text("conformity", "statement of conformity, or why there is none", conformity),
    _text(
        "adjustment",
        "results before and after adjustment, or what is known of them",
        lambda c, _: c.adjustment,
    ),
    _text(
        "unverifiable",
        "statement about the terms that the check loads could not verify",
        lambda c, _: unverifiable(c),
    ),
    _text("opinions", "opinions and interpretations, marked as such", lambda c, _: c.stated.get("opinions")),
    _text(
        "interval",
        "calibration interval or due date; only where it was agreed",
        lambda c, _: c.stated.interval,
    ),
    _text("replaces", "the certificate that this one replaces", lambda c, _: c.replaces),
    _text("amendment", "why it was amended", lambda c, _: c.amendment),
    _text("entered_by", "who calibrated and entered the record", lambda c, _: c.entered_by),
    _text("checked_by", "who checked the record", _checked_by),
    _text("approved_by", "who approved it", _approved_by),
    _text("in_force_from", "first day on which the record is in force", _in_force_from),
    _text("status", "status of the calibration record", _status),
    _text("withdrawn", "why and from when the record is void", lambda c, _: c.withdrawn),
    _text("record", "id of the calibration record", lambda c, _: c.record.id),
    _text("record_hash", "SHA-256 of the calibration record", lambda c, _: c.record.sha256),
    _text(
        "ledger_head",
        "hash of the ledger's last line that decides about a record, at the issue",
        lambda c, _: c.ledger_head,
    ),
    _text("software", "program and version that made the certificate", lambda *_: f"toolkit {__version__}"),
    _text("record_software", "programs and versions that made the record", _record_software),
    _text("not_stated", "what the session did not state", lambda c, _: "; ".join(c.gaps) or None),
    _date("issued", "date of issue", lambda c, _: c.issued),
    _date("received", "date of receipt of the item, where it was stated", lambda c, _: c.stated.received),
    _date("calibrated", "date of the calibration", lambda c, _: c.statements.date),
    _date("approved_on", "day of the approval", lambda c, _: c.approval.known_on if c.approval else None),
)

MARKS = (
    _when("simulated", "the instrument is a virtual machine", lambda c, _: c.simulated),
    _when("draft", "the record is not approved, and the paper is no certificate", lambda c, _: c.draft),
    _when("withdrawn", "the record is withdrawn", lambda c, _: c.withdrawn is not None),
    _when("amended", "the certificate replaces another one", lambda c, _: c.replaces is not None),
    _when(
        "interval_agreed",
        "an interval was agreed with the customer and stated",
        lambda c, _: c.stated.interval is not None,
    ),
    _when("gaps", "something that a certificate should say was not stated", lambda c, _: bool(c.gaps)),
    _when("conformity_stated", "conformity is stated", lambda c, _: any(load.verdict for load in c.loads)),
    _when(
        "adjusted",
        "there are results before and after adjustment",
        lambda c, _: any(load.adjustment for load in c.loads),
    ),
    _mark("simulated", "if.simulated", lambda c, _: SIMULATED if c.simulated else None),
    _mark("draft", "if.draft", lambda c, _: draft_text(c) if c.draft else None),
    _mark(
        "withdrawn",
        "if.withdrawn certificate.withdrawn",
        lambda c, _: f"WITHDRAWN: {c.withdrawn}" if c.withdrawn else None,
    ),
    _mark("amended", "certificate.replaces", _amended_mark),
)
