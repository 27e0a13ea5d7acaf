"""The certificate of a record: Word, verified PDF and the digital certificate, and what is said of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NotRequired, TypedDict

from toolkit.declared.answers import entry_of
from toolkit.findings import FindingEntry
from toolkit.lab.answers import (
    DeliveredDocument,
    DraftKeys,
    PrintedEntry,
    Timed,
    Timing,
    delivered_keys,
    file_name,
    finding_lines,
)
from toolkit.listing import one_line
from toolkit.trust.signing import HERE

if TYPE_CHECKING:
    from datetime import date

    from toolkit.calibration.registry.registry import Registry
    from toolkit.lab.signatures.sealing import Sealing
    from toolkit.report.certificate.model import Certificate, LoadResult
    from toolkit.report.deliver import Delivered
    from toolkit.report.word.package import Template


class CertifiedRecord(TypedDict):
    """The record that a certificate is of."""

    id: str
    sha256: str
    status: str


class CertifiedLoad(TypedDict):
    """A load of a certificate at its full scale, in its unit."""

    unit: str
    full_scale: float
    U: float
    k: float
    probability: float
    dof: float | None
    tolerance: float | None
    verdict: Annotated[str | None, "by the decision rule"]


class CertificateAnswer(DeliveredDocument, DraftKeys, Timed):
    """A calibration certificate, issued."""

    certificate: Annotated[str, "its number"]
    record: CertifiedRecord
    head: Annotated[str, "of the ledger"]
    issued: Annotated[str, "day of issue"]
    withdrawn: Annotated[str | None, "why the record was withdrawn"]
    replaces: str | None
    sealed_by: NotRequired[str]
    dcc: Annotated[Path | None, "the digital certificate (DCC 3.3.0)"]
    decision_rule: str | None
    loads: Annotated[Mapping[str, CertifiedLoad], "by load"]
    unverifiable: Annotated[list[str], "terms that no check load verifies"]
    not_stated: Annotated[list[str], "what is a visible gap"]
    manifest: Annotated[list[PrintedEntry], "every value as it was printed"]
    findings: list[FindingEntry]


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
    from toolkit.lab.signatures.issuing import open_issuing
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
    certificate: Certificate, delivered: Delivered, sealing: Sealing | None, timing: Timing
) -> CertificateAnswer:
    """Return a delivered certificate as the JSON answer."""
    record = entry_of(CertifiedRecord, certificate.record, status=certificate.status.state)
    return entry_of(
        CertificateAnswer, certificate,
        certificate=certificate.id, record=record, head=certificate.ledger_head,
        **delivered_keys(delivered),
        **({"sealed_by": sealing.key.name} if sealing else {}),
        dcc=delivered.companions[0] if delivered.companions else None,
        decision_rule=certificate.stated.rule,
        loads={load.load: _load(load) for load in certificate.loads},
        unverifiable=[f"{load}: {term}" for load, term in certificate.unverifiable],
        not_stated=certificate.gaps,
        manifest=[entry_of(PrintedEntry, entry) for entry in delivered.filled.manifest],
        timing=timing,
    )  # fmt: skip


def _load(load: LoadResult) -> CertifiedLoad:
    full = load.full_scale
    return entry_of(
        CertifiedLoad, full,
        unit=load.unit, full_scale=full.at, tolerance=load.tolerance, verdict=load.verdict,
    )  # fmt: skip


def certificate_text(certificate: Certificate, delivered: Delivered, sealing: Sealing | None = None) -> str:
    """Return a delivered certificate for people."""
    marks = "  DRAFT" if certificate.draft else "  WITHDRAWN" if certificate.withdrawn else ""
    lines = [
        f"certificate {certificate.id} of {certificate.record.id}{marks}",
        *(one_line(path) for path in (delivered.pdf, delivered.docx, *delivered.companions)),
        f"{delivered.pages} pages, {len(delivered.filled.manifest)} values verified",
        f"signature: {delivered.signature}",
        f"sealed by {sealing.key.name}" if sealing else "not sealed: no --seal",
        *(f"  warning {warning}" for warning in delivered.warnings),
        *finding_lines(certificate.findings),
    ]
    return "\n".join(lines)
