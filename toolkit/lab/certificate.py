"""The certificate of a record: Word, verified PDF and the digital certificate, and what is said of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from toolkit.lab.answers import delivered_keys, file_name, finding_lines

if TYPE_CHECKING:
    from collections.abc import Callable
    from datetime import date
    from pathlib import Path

    from toolkit.calibration.registry.registry import Registry
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
    keep: bool,
    step: Callable[[str], None],
) -> tuple[Certificate, Delivered]:
    """Fill the template with a record's certificate and deliver it, with ``dcc`` the XML beside it.

    Raises
    ------
    ToolkitError
        the record has no certificate; the document is not delivered
    """
    from toolkit.report.certificate.collect import collect
    from toolkit.report.certificate.content import build_content
    from toolkit.report.certificate.dcc import build_dcc
    from toolkit.report.deliver import deliver
    from toolkit.report.style import read_style, style_file

    style = read_style(style_file(opened.path))
    step("record")
    certificate = collect(
        registry, record_id, style, issued=issued, draft=draft, replaces=replaces, amendment=amendment
    )
    delivered = deliver(
        opened,
        build_content(certificate, style),
        out,
        name=file_name(certificate.id, otherwise="certificate"),
        companions={".xml": build_dcc(certificate)} if dcc else None,
        keep=keep,
        step=step,
    )
    return certificate, delivered


def certificate_payload(made: Certificate, done: Delivered) -> dict[str, Any]:
    """Return a delivered certificate as the JSON answer."""
    return {
        "certificate": made.id,
        "record": {"id": made.record, "sha256": made.record_sha256, "status": made.status},
        "head": made.ledger_head,
        "issued": made.issued.isoformat(),
        "draft": made.draft,
        "draft_reasons": list(made.draft_reasons),
        "withdrawn": made.withdrawn,
        "replaces": made.replaces,
        **delivered_keys(done),
        "dcc": done.companions[0] if done.companions else None,
        "decision_rule": made.rule,
        "loads": {one.load: _load(one) for one in made.loads},
        "unverifiable": [f"{load}: {term}" for load, term in made.unverifiable],
        "not_stated": list(made.gaps),
        "manifest": [entry.as_dict() for entry in done.filled.manifest],
        "findings": [finding.as_dict() for finding in made.findings],
    }


def _load(one: Any) -> dict[str, Any]:
    full = one.full_scale
    return {
        "unit": one.unit,
        "full_scale": full.at,
        "U": full.U,
        "k": full.k,
        "probability": full.probability,
        "dof": full.dof,
        "tolerance": one.tolerance,
        "verdict": one.verdict,
    }


def certificate_text(made: Certificate, done: Delivered) -> str:
    """Return a delivered certificate for people."""
    marks = "  DRAFT" if made.draft else "  WITHDRAWN" if made.withdrawn else ""
    lines = [
        f"certificate {made.id} of {made.record}{marks}",
        *(f"{path}" for path in (done.pdf, done.docx, *done.companions)),
        f"{done.pages} pages, {len(done.filled.manifest)} values verified",
        *(f"  warning {one}" for one in done.warnings),
        *finding_lines(made.findings),
    ]
    return "\n".join(lines)
