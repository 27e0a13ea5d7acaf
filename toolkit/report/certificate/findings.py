"""What a certificate lacks or says of itself: gaps, conformity, state of the record."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.findings import Finding
from toolkit.report.certificate.model import MOST_FIGURES, LoadResult
from toolkit.report.certificate.statements import Stated

if TYPE_CHECKING:
    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.calibration.registry.status import RecordStatus
    from toolkit.calibration.session.statements import Statements

_GAPS = (
    ("laboratory", "name of the laboratory"),
    ("address", "address of the laboratory"),
    ("place", "place of the calibration"),
    ("customer", "customer"),
    ("method", "method of the calibration"),
    ("decision_rule", "decision rule: no conformity is stated"),
)


def gaps_of(record: CalibrationRecord, statements: Statements, stated: Stated) -> tuple[str, ...]:
    """Return what a certificate should say and nobody stated, in words."""
    gaps = [text for key, text in _GAPS if stated.get(key) is None]
    if statements.temperature_C is None:
        gaps.append("temperature during the calibration")
    if statements.reference.standard is None:
        gaps.append("reference standard")
    if statements.reference.certificate is None:
        gaps.append("certificate of the reference standard")
    gaps += [
        f"uncertainty of the reference standard for {load.load}"
        for load in record.loads
        if statements.reference.u(load.load) is None
    ]
    gaps += [f"serial number of {cell.name}" for cell in record.cells if cell.serial is None]
    return tuple(gaps)


def gap_findings(record: CalibrationRecord, gaps: tuple[str, ...]) -> list[Finding]:
    """Return a finding for each gap."""
    return [Finding(rule="certificate-gap", where=record.id, message=f"not stated: {gap}") for gap in gaps]


def result_findings(
    record: CalibrationRecord, results: tuple[LoadResult, ...], no_check: bool, stated: Stated
) -> list[Finding]:
    """Return the findings about the results: conformity, budget, pictures."""
    findings = []
    if no_check and stated.rule is not None:
        findings.append(
            Finding(
                rule="certificate-conformity",
                where=record.id,
                message="a decision rule is stated, but the session has no check loads to apply it to",
            )
        )
    for result in results:
        if result.verdict in ("conditionalFail", "fail"):
            worst = max(result.checks, key=lambda line: abs(line.deviation))
            findings.append(
                Finding(
                    rule="certificate-conformity",
                    where=result.load,
                    message=f"{result.verdict}: check load {worst.row} deviates by {worst.deviation:+.4g} "
                    f"{result.unit}, tolerance {result.tolerance:.4g} {result.unit}",
                )
            )
        findings += [
            Finding(
                rule="certificate-conformity",
                where=f"{result.load}, check row {line.row}",
                message=f"{', '.join(line.beyond)} lies beyond the fitted range: no conformity is stated",
            )
            for line in result.checks
            if line.beyond
        ]
        if result.not_stated:
            findings.append(
                Finding(
                    rule="certificate-budget",
                    where=result.load,
                    message=f"the uncertainty holds no contribution of {', '.join(result.not_stated)}: "
                    "nothing was stated or measured",
                    level="note",
                )
            )
    if len(results) > MOST_FIGURES:
        findings.append(
            Finding(
                rule="certificate-figures",
                where=record.id,
                message=f"{len(results)} loads, of which the first {MOST_FIGURES} have a picture",
            )
        )
    return findings


def state_findings(
    record: CalibrationRecord, reasons: tuple[str, ...], later: RecordStatus, same: str | None
) -> list[Finding]:
    """Return the findings about the record's state and the uniqueness of the certificate's number."""
    findings = []
    if reasons:
        message = f"the paper says DRAFT and is no certificate: {'; '.join(reasons)}"
        findings.append(Finding(rule="certificate-draft", where=record.id, message=message))
    if later.state == "withdrawn":
        message = f"withdrawn since the day asked for: {later.reason or 'no reason stated'}"
        findings.append(Finding(rule="certificate-withdrawn", where=record.id, message=message))
    if same is not None:
        message = f"{same} states the same certificate number: an id must be unique"
        findings.append(Finding(rule="certificate-number", where=record.id, message=message))
    return findings
