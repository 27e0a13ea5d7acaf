"""The report of a test: what it rests on, its conditions and its marks; the other modules declare more."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING

from toolkit.calibration.records.use import DRAFT, UNVERIFIED, CalibrationUse
from toolkit.characteristics.catalogue import columns
from toolkit.characteristics.characteristic import PULL, STIFFNESS, WideTable
from toolkit.files import sha256_bytes
from toolkit.report.content import IMPOSSIBLE, ReportContent
from toolkit.report.document import Chapter, Document
from toolkit.report.style import Style

if TYPE_CHECKING:
    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.findings import Finding
    from toolkit.pipeline import TestResult
    from toolkit.recording.folder import ReportDetails
    from toolkit.recording.model import TestInfo
    from toolkit.reduction.model import Condition
    from toolkit.report.diagnosis.answer import Told
    from toolkit.tires.comparison import Comparison

SIMULATED = "SIMULATED DATA"


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportedTest:
    """What the report of a test is built from (see `build_content`)."""

    result: TestResult
    record: CalibrationRecord | None
    findings: tuple[Finding, ...]
    issued: dt.date
    details: ReportDetails
    comparison: Comparison | None = None
    diagnosis: Told | None = None
    titled: Callable[[str], str] = str

    @property
    def info(self) -> TestInfo:
        """What the test says of itself."""
        return self.result.reduced.info

    @property
    def use(self) -> CalibrationUse:
        """The calibration that computed the forces, and how it stands."""
        return self.result.reduced.calibration

    @property
    def used(self) -> Sequence[Condition]:
        """The conditions that results rest on."""
        return self.result.reduced.used()

    @property
    def watermark(self) -> str | None:
        """The word in every figure; None where the numbers may be issued."""
        words = (self.use.word, SIMULATED if self.info.simulated else None)
        return " - ".join(word for word in words if word) or None


REPORT: Document[ReportedTest] = Document(
    name="report",
    package=__package__,
    required=("tk:calibration.hash",),
    foreign=("certificate", "audit", "plan", "comparison", "diagnosis", "laboratories"),
)

# A report may tell a diagnosis by the tags of its own document, from the answer alone.
DIAGNOSIS = Chapter(module="toolkit.report.diagnosis.answer", part=lambda report: report.diagnosis)


def build_content(
    result: TestResult,
    record: CalibrationRecord | None = None,
    *,
    findings: Sequence[Finding] | None = None,
    style: Style | None = None,
    issued: dt.date | None = None,
    details: ReportDetails | None = None,
    comparison: Comparison | None = None,
    diagnosis: Told | None = None,
    titled: Callable[[str], str] = str,
) -> ReportContent:
    """Return what a template can ask for.

    Parameters
    ----------
    result : the test, reduced and characterised, SI and SAE J670
    record : the calibration record that computed the forces, for its coefficients; None leaves them out
    findings : what the report lists; default those of the result
    style : units, decimals and laboratory
    issued : date of issue; default today
    details : what the report says beyond the measurement: customer, item, method, opinions
    comparison : tire models fitted to the test; None leaves their table and figures out
    diagnosis : the answer of a diagnosis and who releases it; None leaves its chapter out
    titled : writes a person's name beside the id by which a text names them
    """
    from toolkit.recording.folder import ReportDetails

    style = style or Style()
    report = ReportedTest(
        result=result,
        record=record,
        findings=tuple(
            (*result.reduced.findings, *result.characteristics.findings) if findings is None else findings
        ),
        issued=issued or dt.datetime.now(tz=dt.UTC).date(),
        details=details or ReportDetails(),
        comparison=comparison,
        diagnosis=diagnosis,
        titled=titled,
    )
    content = REPORT.content(
        report,
        style,
        calibrations=(report.use,),
        title="",
        author=style.laboratory or report.info.operator or "Tire force and moment laboratory",
        identity=report_id(result, report.details),
        subject="Tire force and moment",
        issued=report.issued,
        people=_people(report),
    )
    return replace(content, title=str(content.values["report.title"].value))


def _people(report: ReportedTest) -> frozenset[str]:
    """Return what people wrote into the test and its report."""
    opinions = (text for opinion in report.details.opinions for text in (opinion.statement, opinion.basis))
    parts = (report.info, report.details)
    stated = (getattr(part, field.name) for part in parts for field in fields(part))
    texts = [text for text in (*stated, *opinions) if isinstance(text, str)]
    return frozenset((*texts, *map(report.titled, texts)))


def report_id(result: TestResult, details: ReportDetails | None = None) -> str:
    """Return an id made from the inputs: the same recordings and calibration give the same id.

    A report that replaces another one has an id of its own, although it rests on the same inputs; that of a
    draft says so.
    """
    reduced = result.reduced
    parts = sorted({c.file_sha256 for c in reduced.conditions})
    if details is not None and details.amends:
        parts += [details.amends, details.amendment or ""]
    digest = sha256_bytes("\n".join([reduced.info.name, reduced.calibration.sha256, *parts]).encode())
    date = "".join(ch for ch in (reduced.info.date or "") if ch.isdigit())
    draft = DRAFT if reduced.calibration.draft else ""
    return "-".join(part for part in (draft, "TR", date, digest[:8].upper()) if part)


def _has_any(report: ReportedTest, table: WideTable, *, summarised: bool = False) -> bool:
    """Tell whether a characteristic of a table has a value; ``summarised``: one that the summary has."""
    names = {column.name for column in columns(table) if column.summary is not None or not summarised}
    rows = report.result.characteristics.rows
    return any(row.name in names and row.estimate is not None for row in rows)


def _pull(report: ReportedTest, _style: Style) -> bool:
    return _has_any(report, PULL, summarised=True)


def _verified(report: ReportedTest, _style: Style) -> bool:
    return not (report.use.unverified or report.use.draft)


def _reverse(report: ReportedTest, _style: Style) -> bool:
    return any(condition.rotation == "reverse" for condition in report.used)


def _impossible(report: ReportedTest, _style: Style) -> bool:
    return bool(report.result.reduced.impossible)


def _simulated_mark(report: ReportedTest, _style: Style) -> str | None:
    if not report.info.simulated:
        return None
    return f"{SIMULATED}: made by simulation, not a measurement of a tire."


def _draft_mark(report: ReportedTest, _style: Style) -> str | None:
    return f"Calibration {report.use.id}: {report.use.status}." if report.use.draft else None


def _unverified_mark(report: ReportedTest, _style: Style) -> str | None:
    if not report.use.unverified:
        return None
    return (
        f"{UNVERIFIED}: {report.use.id} is a legacy import; its coefficients are not reproduced from "
        "reference data."
    )


def _impossible_mark(report: ReportedTest, _style: Style) -> str | None:
    rules = dict.fromkeys(finding.rule for finding in report.result.reduced.impossible)
    if not rules:
        return None
    return (
        f"{IMPOSSIBLE}: no tire has the forces or moments of this test ({', '.join(rules)}, see the "
        "findings); they must not be used."
    )


_when, _mark = REPORT.condition, REPORT.mark
CONDITIONS = (
    _when("simulated", "the data are simulated", lambda report, _: report.info.simulated),
    _when("measured", "the data are measured", lambda report, _: not report.info.simulated),
    _when("unverified", "the calibration record is a legacy import", lambda report, _: report.use.unverified),
    _when(
        "draft",
        "the calibration record was not approved and in force on the test's date",
        lambda report, _: report.use.draft,
    ),
    _when("impossible", "values of the test are such as no tire has", _impossible),
    _when("verified", "the calibration record reproduces from its stored data", _verified),
    _when("pull", "both directions of rotation gave a pull characteristic", _pull),
    _when(
        "no_pull",
        "there is no pull characteristic, for instance for want of a reversed run",
        lambda report, style: not _pull(report, style),
    ),
    _when("reverse", "the test has reversed runs", _reverse),
    _when(
        "stiffness", "a cornering or aligning stiffness exists", lambda report, _: _has_any(report, STIFFNESS)
    ),
    _when("no_findings", "the test has no findings", lambda report, _: not report.findings),
    _mark("simulated", "if.simulated simulated", _simulated_mark),
    _mark("draft", "calibration.status", _draft_mark),
    _mark("unverified", "if.unverified calibration.status", _unverified_mark),
    _mark("impossible", "if.impossible", _impossible_mark),
)
