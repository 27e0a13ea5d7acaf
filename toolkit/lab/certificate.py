"""The certificate of a record: Word, verified PDF and the digital certificate, and what is said of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from toolkit.lab.answers import delivered_keys, file_name, finding_lines
from toolkit.trust.signing import HERE

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from datetime import date
    from pathlib import Path

    from toolkit.calibration.registry.registry import Registry
    from toolkit.lab.sealing import Sealing
    from toolkit.report.certificate.model import Certificate
    from toolkit.report.deliver import Delivered
    from toolkit.report.word.package import Template


def deliver_certificate(
    registry: Registry,
    record_id: str,
    opened: Template,
    out: Path,
    *,
    issued: date | None,
    draft: bool,
    replaces: str | None,
    amendment: str | None,
    dcc: bool,
    sealing: Sealing | None = None,
    asked: bool = False,
    named: Sequence[str] = (),
    keep: bool,
    step: Callable[[str], None],
) -> tuple[Certificate, Delivered]:
    """Make a record's certificate, with ``dcc`` the XML beside it, and issue it.

    It is an entry of the ledger where people are enrolled, where it is sealed, or where that is ``asked``
    for; a draft never is. ``named`` are the people whom a request asks to sign. With answers the day of issue
    is that of their request.

    Raises
    ------
    ToolkitError
        the record has no certificate; who signs may not issue one; the document is not delivered
    """
    from toolkit.lab.issuing import open_issuing
    from toolkit.report.certificate.collect import collect
    from toolkit.report.certificate.content import build_content
    from toolkit.report.certificate.dcc import build_dcc
    from toolkit.report.deliver import deliver
    from toolkit.report.style import read_style, style_file

    if registry.travel.answers and issued is None:
        issued = registry.today()
    style = read_style(style_file(opened.path))
    step("record")
    certificate = collect(
        registry, record_id, style, issued=issued, draft=draft, replaces=replaces, amendment=amendment
    )
    xml = build_dcc(certificate) if dcc else None
    content, issue = build_content(certificate, style), None
    enrolled = registry.people().history.now is not None or bool(registry.signers) or registry.travel != HERE
    issuing = open_issuing(
        registry, sealing, asked=asked or (enrolled and not certificate.draft),
        draft=certificate.draft or (asked and draft), named=named,
    )  # fmt: skip
    if issuing is not None:
        content = issuing.content(content)
        issue = issuing.issue(
            content, document=f"certificate {certificate.id}", decided=certificate.ledger_head
        )
    delivered = deliver(
        opened,
        content,
        out,
        name=file_name(certificate.id, otherwise="certificate"),
        companions=None if xml is None else {".xml": xml},
        issue=issue,
        keep=keep,
        step=step,
    )
    return certificate, delivered


def certificate_payload(
    certificate: Certificate, delivered: Delivered, sealing: Sealing | None = None
) -> dict[str, Any]:
    """Return a delivered certificate as the JSON answer."""
    return {
        "certificate": certificate.id,
        "record": {
            "id": certificate.record,
            "sha256": certificate.record_sha256,
            "status": certificate.status,
        },
        "head": certificate.ledger_head,
        "issued": certificate.issued.isoformat(),
        "draft": certificate.draft,
        "draft_reasons": list(certificate.draft_reasons),
        "withdrawn": certificate.withdrawn,
        "replaces": certificate.replaces,
        **delivered_keys(delivered),
        **({"sealed_by": sealing.key.name} if sealing else {}),
        "dcc": delivered.companions[0] if delivered.companions else None,
        "decision_rule": certificate.rule,
        "loads": {load.load: _load(load) for load in certificate.loads},
        "unverifiable": [f"{load}: {term}" for load, term in certificate.unverifiable],
        "not_stated": list(certificate.gaps),
        "manifest": [entry.as_dict() for entry in delivered.filled.manifest],
        "findings": [finding.as_dict() for finding in certificate.findings],
    }


def _load(load: Any) -> dict[str, Any]:
    full = load.full_scale
    return {
        "unit": load.unit,
        "full_scale": full.at,
        "U": full.U,
        "k": full.k,
        "probability": full.probability,
        "dof": full.dof,
        "tolerance": load.tolerance,
        "verdict": load.verdict,
    }


def certificate_text(certificate: Certificate, delivered: Delivered, sealing: Sealing | None = None) -> str:
    """Return a delivered certificate for people."""
    marks = "  DRAFT" if certificate.draft else "  WITHDRAWN" if certificate.withdrawn else ""
    lines = [
        f"certificate {certificate.id} of {certificate.record}{marks}",
        *(f"{path}" for path in (delivered.pdf, delivered.docx, *delivered.companions)),
        f"{delivered.pages} pages, {len(delivered.filled.manifest)} values verified",
        f"signature: {delivered.signature}",
        f"sealed by {sealing.key.name}" if sealing else "not sealed: no --seal",
        *(f"  warning {warning}" for warning in delivered.warnings),
        *finding_lines(certificate.findings),
    ]
    return "\n".join(lines)
