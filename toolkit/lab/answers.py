"""What all answers share: keys of the JSON document, tables and marks of the text, names of files."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NotRequired, TypedDict, cast

from toolkit.calibration.records.use import CalibrationUse, signature_of
from toolkit.declared.answers import entry_of
from toolkit.errors import refuse_unknown
from toolkit.listing import one_line, table

if TYPE_CHECKING:
    from collections.abc import Iterable

    from toolkit.findings import Finding
    from toolkit.report.deliver import Delivered
    from toolkit.report.document import DeclaredTable
    from toolkit.report.style import Style


class ErrorEntry(TypedDict):
    """An error, as every command prints it."""

    rule: str | None
    what: str
    where: str | None
    line: NotRequired[str | None]
    got: str | None
    expected: str | None
    next_step: str | None


class DocumentCheck(TypedDict):
    """A check of a document against its PDF."""

    name: str
    ok: bool
    message: str


class PrintedEntry(TypedDict):
    """A value as it was printed."""

    tag: str
    text: str
    part: Annotated[str, "part of the Word file"]


class DrawnFigure(TypedDict):
    """A figure of a document."""

    tag: str
    alt: Annotated[str, "what it shows, in words"]


class DeliveredDocument(TypedDict):
    """A Word document and its PDF, verified against each other."""

    docx: Path
    pdf: Path
    pages: int
    verified: Annotated[bool, "whether the PDF shows every value and figure"]
    signature: Annotated[str, "who signed, or unsigned"]
    ledger: Annotated[Mapping[str, Any] | None, "the proof of its entry; null where it was not issued"]
    checks: list[DocumentCheck]
    template_sha256: str
    content_sha256: Annotated[str, "the same for the same inputs, whatever the day"]
    figures: list[DrawnFigure]
    warnings: list[str]


class Timed(TypedDict):
    """How long the command took."""

    timing: Timing


class Timing(TypedDict):
    """Times, which differ from run to run; nothing else in an answer does."""

    seconds: Annotated[float, "of the whole command"]
    models: NotRequired[Annotated[Mapping[str, float], "of the fit of each tire model"]]


class DraftKeys(TypedDict):
    """Whether an answer may not be issued."""

    draft: Annotated[bool, "whether a record is used that is not approved and in force"]
    draft_reasons: Annotated[list[str], "why"]


class EstimateEntry(TypedDict):
    """A value with its uncertainty."""

    value: float
    standard_uncertainty: float
    dof: Annotated[float | None, "degrees of freedom; null where the uncertainty is known beforehand"]
    expanded_uncertainty: Annotated[float, "for a coverage of 95 %"]
    k: Annotated[float, "coverage factor"]
    unit: str


def needs_attention(findings: Sequence[Finding]) -> bool:
    """Tell whether a finding asks for a person's attention; notes only inform."""
    return any(finding.level != "note" for finding in findings)


def finding_lines(findings: Sequence[Finding]) -> list[str]:
    """Return findings as lines for people: level, rule and place, then the sentence, wrapped."""
    import textwrap

    lines = []
    for finding in findings:
        lines.append(f"  {finding.level:<8}{finding.rule:<20} {one_line(finding.where)}")
        indent = " " * 10
        wrapped = textwrap.wrap(finding.message, width=98, initial_indent=indent, subsequent_indent=indent)
        lines += map(one_line, wrapped)
    return lines


def findings_text(findings: Sequence[Finding]) -> str:
    """Return findings under the line that says where more stands; empty without any."""
    if not findings:
        return ""
    return "findings (toolkit explain RULE tells more):\n" + "\n".join(finding_lines(findings))


def counted(count: int, noun: str) -> str:
    """Return how many of something there are.

    >>> counted(1, "figure"), counted(2, "figure")
    ('1 figure', '2 figures')
    """
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def document_table(declared: DeclaredTable[Any], source: object, style: Style) -> str:
    """Return a table of texts as a document has it, headed by its columns' names; empty without rows."""
    rows = [list(map(str, row)) for row in cast("Iterable[Sequence[object]]", declared.build(source, style))]
    align = "".join(">" if all(map(_is_number, column)) else "<" for column in zip(*rows, strict=True))
    return table([column.name for column in declared.entry.columns], rows, align=align)


def _is_number(text: str) -> bool:
    return text[:1] in "+-−.0123456789"


def draft_keys(*uses: CalibrationUse) -> DraftKeys:
    """Return whether an answer is a draft, and why: the same keys in every answer and manifest."""
    reasons = dict.fromkeys(f"{use.id}: {reason}" for use in uses for reason in use.draft_reasons)
    return {"draft": bool(reasons), "draft_reasons": list(reasons)}


def mark_words(*uses: CalibrationUse) -> str:
    """Return the marks of the records as the end of a line for people."""
    words = dict.fromkeys(
        word
        for use in uses
        for word, on in (("DRAFT", use.draft), ("UNVERIFIED", use.unverified), ("KNOWN SINCE", use.since))
        if on
    )
    return "".join(f"  {word}" for word in words)


def signature_words(*uses: CalibrationUse) -> str:
    """Return the line of signatures of an answer for people."""
    return f"signature: {signature_of(uses)}"


def delivered_keys(delivered: Delivered) -> DeliveredDocument:
    """Return what an answer says of any delivered document: files, pages, checks, hashes, warnings."""
    figures = [{"tag": tag, "alt": alt} for tag, alt in delivered.filled.figures]
    return entry_of(DeliveredDocument, delivered, verified=True, figures=figures)


def document_text(document: DeliveredDocument | None) -> str:
    """Return what people read of a delivered document, below the rest of an answer; empty without one."""
    if document is None:
        return ""
    lines = [
        "",
        *(one_line(document[kind]) for kind in ("pdf", "docx")),
        f"{document['pages']} pages, verified",
    ]
    return "\n".join([*lines, *(f"  warning {warning}" for warning in document["warnings"])])


def file_name(text: str, *, otherwise: str) -> str:
    """Return the name of a test, or the id of a certificate, as a file's name.

    >>> file_name("CAL 2026/017", otherwise="certificate"), file_name("../", otherwise="test")
    ('CAL-2026-017', 'test')
    """
    return re.sub(r"[^\w.-]+", "-", text).strip("-.")[:100] or otherwise


def unit_choice(units: str) -> Style:
    """Return the units of text and figures: N and N·m, or lbf and lbf·ft.

    Raises
    ------
    ConfigError
        the choice is neither ``SI`` nor ``lbf``
    """
    from toolkit.report.style import Style

    choices = {"SI": Style(), "lbf": Style(force="lbf", moment="lbf*ft")}
    refuse_unknown("units", units, choices, where="--units", rule="unknown-units")
    return choices[units]
