"""What a report says beyond the measurement, as values of its tags: ISO/IEC 17025 7.8.2.1 and 7.8.3.1."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.recording.details import ReportDetails
from toolkit.report.content import Value
from toolkit.report.style import Style

if TYPE_CHECKING:
    from toolkit.pipeline import TestResult


def details_values(
    details: ReportDetails, result: TestResult, style: Style, findings: int
) -> dict[str, Value]:
    """Return the values by tag; what neither the test nor the style file says is missing."""
    info = result.reduced.info
    texts = {
        "laboratory.contact": style.contact,
        "laboratory.accreditation": style.accreditation,
        "report.customer": details.customer or info.requestor,
        "report.customer_contact": details.customer_contact,
        "report.location": details.location or style.place or style.address,
        "report.method": details.method or style.method or result.reduced.protocol,
        "report.deviations": details.deviations or _departures(findings),
        "report.sampling": details.sampling,
        "report.conformity": details.conformity,
        "report.external": details.external,
        "report.authorised_by": details.authorised_by or style.authorised_by,
        "report.authorised_function": details.function or style.function,
        "report.amends": details.amends,
        "report.amendment": details.amendment,
        "item.description": details.item or _item(result),
        "item.condition": details.condition,
    }
    made = {path: Value(kind="text", value=text) for path, text in texts.items()}
    return made | {"item.received": Value(kind="date", value=details.received)}


def _departures(findings: int) -> str:
    if not findings:
        return "none"
    return f"{findings} finding{'s' if findings > 1 else ''}, listed under Findings"


def _item(result: TestResult) -> str | None:
    info = result.reduced.info
    named = (info.tire_size, info.tire_company, info.tire_series)
    parts = [part for part in named if part] + ([f"DOT {info.tire_DOT}"] if info.tire_DOT else [])
    return f"tire {', '.join(parts)}" if parts else None
