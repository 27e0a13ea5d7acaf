"""The answer of `audit`, as types: files, tests, reports, what a failed check throws into doubt, copies."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, NotRequired, TypedDict

from toolkit.findings import FindingEntry
from toolkit.lab.document_answer_types import ErrorEntry
from toolkit.lab.record_answer_types import RefusedRecord, Repair, Segment, SkippedRecord


class CauseCount(TypedDict):
    """A cause of wrong values, and in how many files."""

    cause: str
    files: int


Headline = TypedDict(
    "Headline",
    {
        "sentence": str,
        "files": int,
        "wrong": Annotated[int, "files with values that the record in force changes"],
        "FY_max_abs_N": Annotated[float, "largest change"],
        "MZ_max_abs_Nm": Annotated[float, "largest change"],
        "causes": list[CauseCount],
        "from": Annotated[str | None, "first month with a wrong file"],
        "to": Annotated[str | None, "last one"],
        "unjudged": Annotated[int, "files whose change cannot be computed"],
        "unreadable": int,
        "impossible": Annotated[int, "files besides the wrong ones with an Fy or Mz that no tire has"],
    },
)
Headline.__doc__ = "What an archive holds, in a sentence and in numbers."


class ArchivedCondition(TypedDict):
    """The mean of a load block of a file, and what the record in force changes."""

    first_row: int
    last_row: int
    SA_deg: float | None
    FZ_N: float | None
    FY_N: float | None
    MZ_Nm: float | None
    FY_change_N: float | None
    MZ_change_Nm: float | None
    step_SA_deg: Annotated[float | None, "slip angle of the protocol's step"]
    step_FZ_N: Annotated[float | None, "load of the protocol's step"]


class ArchivedNote(TypedDict):
    """What a person should know of a file."""

    rule: str
    message: str


class ArchivedFile(TypedDict):
    """A file of an archive: which calibration computed it, and what the right one changes."""

    path: Annotated[str, "relative to the archive"]
    sha256: str | None
    size: int | None
    instrument: str | None
    date: str | None
    test: Annotated[str | None, "folder of its test.toml"]
    rotation: str | None
    to_SAE: Annotated[Mapping[str, int] | None, "sign of each channel on the way to SAE axes"]
    own_protocol: bool
    rows: int | None
    grade: Annotated[str, "exact, rounding, stale, sign_variant, column_swap, ambiguous, unknown, ..."]
    record: str | None
    variant: Annotated[str | None, "how the record was changed: E5 negative in FY, MZ"]
    issued: Annotated[bool | None, "whether the coefficients were those of the certificate"]
    candidates: Annotated[list[str], "of an ambiguous file"]
    segments: list[Segment]
    in_force: Annotated[str | None, "the record in force on the date of the test"]
    repair: Repair | None
    conditions: list[ArchivedCondition]
    estimate: Annotated[Mapping[str, Any] | None, "of an unknown calibration: what the digits prove of it"]
    skipped: list[SkippedRecord]
    reason: Annotated[str | None, "why it cannot be read or judged"]
    test_toml: Annotated[str | None, "what is wrong with its test.toml"]
    units: Annotated[Mapping[str, str] | None, "of its channels"]
    values_sha256: str | None
    modified: Annotated[str | None, "day on which a file without a date was last written"]
    notes: list[ArchivedNote]
    reports: NotRequired[Annotated[list[str], "that rest on its test"]]


class Grades(TypedDict):
    """How many files of an archive have each grade."""

    files: int
    grades: Mapping[str, int]
    undated: int


class ChangedCharacteristic(TypedDict):
    """What the right calibration makes of a characteristic."""

    load_N: float
    name: str
    rotation: str | None
    unit: str
    old: float | None
    new: float | None
    change: float | None


class ArchivedTest(TypedDict):
    """A test of an archive."""

    test: str
    instrument: str | None
    date: str | None
    files: int
    not_clean: Annotated[int, "files that are neither exact nor within rounding"]
    FY_max_abs_N: float | None
    MZ_max_abs_Nm: float | None
    effects: list[ChangedCharacteristic]
    reports: NotRequired[Annotated[list[str], "that rest on it"]]


class RestingReport(TypedDict):
    """A report that rests on files of the archive."""

    report: str
    id: Annotated[str | None, "of its manifest"]
    linked_by: list[str]
    calibrations: Annotated[list[str], "that it names"]
    tests: list[str]
    files: int
    not_clean: int
    in_force: Annotated[list[str], "records in force on the days of its tests"]
    to_amend: bool


class FailedLoad(TypedDict):
    """A load that failed its check."""

    load: str
    unit: str
    max_error: float
    tolerance: float


class DriftedConditions(TypedDict):
    """The share of the change in a load block."""

    first_row: int
    last_row: int
    FY_N: float
    MZ_Nm: float


class DriftedFileEntry(TypedDict):
    """A recording since the last good check: its share of the days, and its share of the change."""

    path: str
    date: str
    share: float
    FY_max_abs_N: float | None
    MZ_max_abs_Nm: float | None
    conditions: list[DriftedConditions]
    reason: Annotated[str | None, "why nothing could be computed"]


class DriftedTestEntry(TypedDict):
    """A test since the last good check."""

    test: str
    date: str
    share: float
    files: int
    left_out: Annotated[int, "files of which nothing could be computed"]
    FY_max_abs_N: float | None
    MZ_max_abs_Nm: float | None


class SinceGood(TypedDict):
    """What was measured since the last good check."""

    instrument: str
    good: Annotated[str, "record of the last good check"]
    good_date: str
    failed: Annotated[str, "session that failed"]
    failed_date: str
    record_in_use: str
    later_good: list[str]
    loads: list[FailedLoad]
    tests: list[DriftedTestEntry]
    files: list[DriftedFileEntry]


class CorrectedCopy(TypedDict):
    """A corrected copy of a file."""

    path: str
    replaces_sha256: str
    sha256: str | None
    record: str | None
    record_sha256: str | None
    reason: Annotated[str | None, "why there is none"]
    unverified: bool
    draft: bool
    draft_reasons: list[str]


class AmendedReport(TypedDict):
    """A report that replaces another one, or why there is none."""

    replaces: str
    test: str
    docx: Path | None
    pdf: Path | None
    error: ErrorEntry | None


class AuditTiming(TypedDict):
    """How long the audit took."""

    seconds: float
    files_per_second: float | None
    reused: Annotated[int, "files whose answer an earlier audit had"]


class AuditAnswer(TypedDict):
    """Which calibration computed the files of an archive."""

    archive: Path
    known_at: str
    headline: Headline
    files: list[ArchivedFile]
    summary: Grades
    tests: list[ArchivedTest]
    refused_records: list[RefusedRecord]
    heads: Annotated[Mapping[str, str], "of each instrument's ledger"]
    findings: list[FindingEntry]
    reports: NotRequired[Annotated[list[RestingReport], "with --reports"]]
    report_unknown: NotRequired[Annotated[list[str], "tests that no report rests on"]]
    since_good: NotRequired[Annotated[SinceGood, "with --since-good"]]
    repaired: NotRequired[Annotated[list[CorrectedCopy], "with --repair"]]
    amended: NotRequired[Annotated[list[AmendedReport], "with --repair and --reports"]]
    written: Annotated[list[str], "files"]
    timing: AuditTiming
