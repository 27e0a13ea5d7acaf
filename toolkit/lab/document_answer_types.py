"""Answers on documents, as types: `report`, `watch`, `calibration certificate`, `template` and `demo`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, NotRequired, TypedDict

from toolkit.calibration.records.use import UsedRecord
from toolkit.findings import FindingEntry
from toolkit.lab.tire_answer_types import DraftKeys, Timing


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


class RefusedReport(TypedDict):
    """A report that was not delivered."""

    verified: bool
    error: ErrorEntry | None


class PrintedUnits(TypedDict):
    """Units as a document prints them."""

    force: str
    moment: str


class DeliveredReport(DeliveredDocument, DraftKeys):
    """The report of a test."""

    calibrations: list[UsedRecord]
    units: PrintedUnits
    manifest: Annotated[list[PrintedEntry], "every value as it was printed"]
    manifest_file: Path | None
    handed_over: Annotated[list[Path], "files beside the report"]
    simulated: bool
    impossible: Annotated[list[FindingEntry], "values that no tire has"]
    findings: list[FindingEntry]


class NamedReport(DeliveredReport):
    """The report of one of several tests."""

    test: Path


class NamedRefusal(RefusedReport):
    """The refusal of one of several tests."""

    test: Path


class Timed(TypedDict):
    """How long the command took."""

    timing: Timing


class ReportAnswer(DeliveredReport, Timed):
    """The report of one test."""


class RefusalAnswer(RefusedReport, Timed):
    """The one report that was asked for was not delivered."""


class ReportsAnswer(Timed):
    """The reports of several tests."""

    reports: Annotated[list[NamedReport | NamedRefusal], "in the order of the command"]


ReportForms = ReportAnswer | RefusalAnswer | ReportsAnswer


class WaitingTest(TypedDict):
    """A test that a watch waits for."""

    test: str
    reason: str


class SetAsideTest(TypedDict):
    """A test that a watch has set aside."""

    test: str
    rule: str | None
    reason: str


class WatchAnswer(TypedDict):
    """What a watch made, and what waits at its end."""

    made: list[NamedReport | NamedRefusal]
    waiting: list[WaitingTest]
    set_aside: list[SetAsideTest]
    attention: Annotated[int, "reports that a person should look at"]


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


class LintEntry(TypedDict):
    """What is wrong with a template at one place."""

    rule: str
    level: Annotated[str, "error, warning or note"]
    part: Annotated[str, "part of the Word file"]
    place: str
    message: str


class ListedTag(TypedDict):
    """A tag that a template may use."""

    tag: str
    kind: Annotated[str, "text, number, date, figure, table or if"]
    unit: str | None
    required: bool
    columns: Annotated[list[str], "of a table"]
    available: Annotated[bool | None, "whether the test has it; null without a test"]
    value: Annotated[str | bool | None, "as it would be printed"]
    description: str


class TemplateCheckAnswer(TypedDict):
    """What is wrong with a template."""

    template_sha256: str
    tag_count: Annotated[int, "different tags"]
    findings: list[LintEntry]


class TagsAnswer(TypedDict):
    """Every tag that a template may use."""

    tags: list[ListedTag]
    written: NotRequired[Annotated[list[str], "files"]]


class MissingTranslation(TypedDict):
    """A phrase that a language lacks."""

    language: str
    phrase: str


class WordsAnswer(TypedDict):
    """The phrases that documents print."""

    languages: list[str]
    phrases: Annotated[list[Mapping[str, str]], "phrase, and its translation under each language that has it"]
    missing: list[MissingTranslation]


class NewTemplateAnswer(TypedDict):
    """A template and its style file, copied."""

    template: Path
    style: Path


class DemoStep(TypedDict):
    """A step of the demonstration."""

    title: str
    exit_code: int
    told: Annotated[str, "its outcome"]


class DemoAnswer(TypedDict):
    """The demonstration: its steps and its files."""

    out: Path
    files: list[str]
    steps: list[DemoStep]
    report: Annotated[str, "outcome of the last step"]
    timing: Timing
