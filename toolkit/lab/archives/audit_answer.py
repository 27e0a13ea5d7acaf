"""What an audit says: the JSON document, whose long lists are iterators, and the text for people."""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NotRequired, TypedDict

from toolkit.audit.corrected import CorrectedCopy
from toolkit.audit.linked import Linked, RestingReport
from toolkit.audit.model import CLEAN
from toolkit.audit.one_file import ArchivedFile
from toolkit.audit.since_good import Drift, DriftedFile, DriftedTest
from toolkit.calibration.registry.registry import RefusedRecord, Registry
from toolkit.calibration.registry.standing import approved_after
from toolkit.declared.answers import entry_of
from toolkit.findings import FindingEntry
from toolkit.lab.answers import ErrorEntry, counted
from toolkit.lab.archives.audit_headline import Headline, headline
from toolkit.listing import one_line, table

if TYPE_CHECKING:
    import datetime as dt

    from toolkit.audit.archive import ArchiveAudit
    from toolkit.lab.archives.amended import Amended


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


class FailedLoad(TypedDict):
    """A load that failed its check."""

    load: str
    unit: str
    max_error: float
    tolerance: float


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
    tests: list[DriftedTest]
    files: list[DriftedFile]


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
    approved_later: Annotated[
        Mapping[str, str],
        "records in force by an approval after known_at, which serve where no earlier one does: its day",
    ]
    heads: Annotated[Mapping[str, str], "of each instrument's ledger"]
    findings: list[FindingEntry]
    reports: NotRequired[Annotated[list[RestingReport], "with --reports"]]
    report_unknown: NotRequired[Annotated[list[str], "tests that no report rests on"]]
    since_good: NotRequired[Annotated[SinceGood, "with --since-good"]]
    repaired: NotRequired[Annotated[list[CorrectedCopy], "with --repair"]]
    amended: NotRequired[Annotated[list[AmendedReport], "with --repair and --reports"]]
    written: Annotated[list[str], "files"]
    timing: AuditTiming


_SHOWN, _SETTINGS, _PATH = 40, 10, 40
_HOW = 3  # its column
_TROUBLES = ("unreadable-folder", "registry-damaged", "ledger-time")  # what no row of a file can tell


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AuditOutcome:
    """An audit and what was asked for besides; None where it was not."""

    made: ArchiveAudit
    linked: Linked | None
    drift: Drift | None
    drifted: tuple[DriftedFile, ...]
    drifted_tests: tuple[DriftedTest, ...]
    copies: tuple[CorrectedCopy, ...] | None
    amended: tuple[Amended, ...] = ()
    approved_later: Mapping[str, dt.date] = field(default_factory=dict)


def approved_later(audit: ArchiveAudit, registry: Registry) -> dict[str, dt.date]:
    """Return the records in force on the tests' days whose approvals lie after the day of knowledge."""
    used = {plain["in_force"] for plain in audit.files.plain() if plain["in_force"]}
    days = {name: registry.status(name, known_at=audit.known_at).approved_later for name in sorted(used)}
    return {name: day for name, day in days.items() if day is not None}


def payload_of(answer: AuditOutcome) -> dict[str, Any]:
    """Return the JSON document; what there may be many of are iterators."""
    audit = answer.made
    payload: dict[str, Any] = {
        "archive": audit.archive,
        "known_at": audit.known_at.isoformat(),
        "headline": headline(audit),
        "files": files_of(answer),
        "summary": {"files": len(audit.files), "grades": dict(audit.grades), "undated": audit.undated},
        "tests": _tests(answer),
        "refused_records": audit.refused,
        "approved_later": {name: day.isoformat() for name, day in answer.approved_later.items()},
        "heads": dict(audit.heads),
        "findings": (finding.as_dict() for finding in audit.findings),
    }
    if answer.linked is not None:
        payload["reports"] = answer.linked.reports
        payload["report_unknown"] = list(answer.linked.unknown)
    if answer.drift is not None:
        failed = answer.drift.failed
        payload["since_good"] = entry_of(
            SinceGood,
            answer.drift,
            failed=failed.session_record,
            failed_date=failed.date.isoformat(),
            record_in_use=failed.record,
            loads=[entry_of(FailedLoad, load) for load in failed.loads],
            tests=answer.drifted_tests,
            files=answer.drifted,
        )
    if answer.copies is not None:
        payload["repaired"] = answer.copies
        payload["amended"] = [report.as_dict() for report in answer.amended]
    return payload


def files_of(answer: AuditOutcome) -> Iterator[dict[str, Any]]:
    """Yield every file's result; with the reports of its test where reports were asked about."""
    for file in answer.made.files.plain():
        if answer.linked is not None:
            file["reports"] = answer.linked.of_test(file["test"])
        yield file


def _tests(answer: AuditOutcome) -> Iterator[dict[str, Any]]:
    for test in answer.made.tests:
        if answer.linked is not None:
            test["reports"] = answer.linked.of_test(test["test"])
        yield test


def text_of(answer: AuditOutcome, *, width: int = 80) -> str:
    """Return the answer for people, the headline first; tables fit ``width`` characters."""
    from toolkit.reduction.physics import RULES

    audit = answer.made
    rows = list(_rows(audit))
    bad = len(audit.files) - sum(audit.grades[grade] for grade in (*CLEAN, "no_recording"))
    lines = [*textwrap.wrap(headline(audit).sentence + ".", width), ""]
    lines += _table(rows, width) if rows else []
    if bad > len(rows):
        lines.append(f"... and {bad - len(rows)} more; --json tells all of them")
    grades = ", ".join(f"{count} {grade}" for grade, count in audit.grades.items() if count)
    lines += _no_recordings(audit, width)
    lines += ["", f"{len(audit.files)} files: {grades or 'none'}; known at {audit.known_at.isoformat()}"]
    for name, day in answer.approved_later.items():
        lines += textwrap.wrap(f"{name}: {approved_after(day, audit.known_at)}", width)
    notes = Counter(finding.rule for finding in audit.findings if finding.level == "note")
    if notes:
        lines.append("also: " + ", ".join(f"{count} {rule}" for rule, count in sorted(notes.items())))
    impossible = {finding.where for finding in audit.findings if finding.rule in RULES}
    if impossible:
        places = one_line(", ".join(sorted(impossible)[:3])) + (", ..." if len(impossible) > 3 else "")
        text = f"Fy or Mz that no tire has, in files: {len(impossible)} ({places}); --json tells why"
        lines += textwrap.wrap(text, width)
    settings = Counter(finding.message for finding in audit.findings if finding.rule == "test-toml")
    lines += [
        one_line(f"{counted(count, 'file')}: {message}") for message, count in settings.most_common(_SETTINGS)
    ]
    if len(settings) > _SETTINGS:
        lines.append(f"... and {len(settings) - _SETTINGS} more of test.toml; --json tells all of them")
    troubles = [f"{f.where}: {f.message}" for f in audit.findings if f.rule in _TROUBLES]
    lines += [one_line(text) for text in troubles[:_SETTINGS]]
    if len(troubles) > _SETTINGS:
        lines.append(
            f"... and {len(troubles) - _SETTINGS} more of folders and ledgers; --json tells all of them"
        )
    lines += [f"refused record {record.id}: {record.reason}" for record in audit.refused]
    lines += [f"head of {name}: {head}" for name, head in audit.heads]
    return "\n".join([*lines, *_asked(answer, width)])


def _table(rows: list[list[str]], width: int) -> list[str]:
    """Return the table of files; what is the same for all of them, or too long for it, stands below it."""
    header, align = ["file", "grade", "computed by", "how", "in force", "dFY [N]", "dMZ [N·m]"], "<<<<<>>"
    reasons = list(dict.fromkeys(row[_HOW] for row in rows if row[_HOW]))
    below: list[str] = []
    if len(reasons) > 1 and len(table(header, rows, align=align).partition("\n")[0]) > width:
        # A reason without its middle is none: in its place stands its number.
        numbers = {reason: str(number) for number, reason in enumerate(reasons, start=1)}
        rows = [[*row[:_HOW], numbers.get(row[_HOW], ""), *row[_HOW + 1 :]] for row in rows]
        for reason, number in numbers.items():
            below += textwrap.wrap(
                one_line(reason), width, initial_indent=f"{number:>3}  ", subsequent_indent=5 * " "
            )
        below = ["how:", *below]
    constant = [
        len(rows) > 1 and side == "<" and len({row[at] for row in rows}) == 1 for at, side in enumerate(align)
    ]
    columns = [at for at, alone in enumerate(constant) if not alone]
    cells = [[row[at] for at in columns] for row in rows]
    # A name that is cut can be neither read nor searched for; only the longest paths and reasons are.
    longest = max(len(row[0]) for row in rows)
    whole = {"grade", "computed by", "in force", *(["file"] if longest <= _PATH else [])}
    lines = [
        table(
            [header[at] for at in columns],
            cells,
            align="".join(align[at] for at in columns),
            width=width,
            whole=[place for place, at in enumerate(columns) if header[at] in whole],
        )
    ]
    common = [f"{header[at]} {rows[0][at]}" for at, alone in enumerate(constant) if alone and rows[0][at]]
    lines += textwrap.wrap(f"all of them: {', '.join(common)}", width) if common else []
    return lines + below


def _no_recordings(audit: ArchiveAudit, width: int) -> list[str]:
    names = [file["path"] for file in audit.files.plain() if file["grade"] == "no_recording"]
    if not names:
        return []
    text = one_line(", ".join(names[:_SETTINGS])) + (", ..." if len(names) > _SETTINGS else "")
    return ["", *textwrap.wrap(f"no recordings: {text}", width, break_long_words=False)]


def _asked(answer: AuditOutcome, width: int) -> Iterator[str]:
    if answer.linked is not None:
        yield ""
        for report in answer.linked.reports:
            why = f"to be amended, {report.not_clean} of {report.files} files are not right"
            why = why if report.to_amend else "stands"
            if report.disputed:
                why += f"; in {report.disputed} of {report.files} files the cells are changed, or may be"
            if report.alike is not None:
                why += f"; {report.alike} tests have the name that it gives, and nothing says which it is"
            tests = ", ".join(answer.made.shown(test) for test in sorted(report.tests))
            yield one_line(
                f"report {report.report} ({tests}): {why}"
                if report.files
                else f"report unknown: {report.report}"
            )
        if answer.linked.unknown:
            unknown = answer.linked.unknown
            first = ", ".join(answer.made.shown(test) for test in unknown[:10])
            yield one_line(f"report unknown: {counted(len(unknown), 'test')}, {first}")
    if answer.drift is not None:
        drift = answer.drift
        yield ""
        yield drift.statement
        yield (
            f"since {drift.good} ({drift.good_date}) {len(answer.drifted)} files were recorded; an estimate "
            "of the effect, interpolated by days:"
        )
        rows = [
            [t.test, t.date.isoformat(), f"{t.share:.0%}", str(t.files),
             "" if t.FY_N is None else f"{t.FY_N:.2f}", "" if t.MZ_Nm is None else f"{t.MZ_Nm:.3f}",
             f"without {t.left_out} files, see --json" if t.left_out else ""]
            for t in answer.drifted_tests[:_SHOWN]
        ]  # fmt: skip
        yield table(
            ["test", "date", "share", "files", "dFY [N]", "dMZ [N·m]", ""], rows, align="<<>>>><", width=width
        )
        if len(answer.drifted_tests) > len(rows):
            yield f"... and {len(answer.drifted_tests) - len(rows)} more; --json tells all of them"
    if answer.copies is not None:
        written = [copy for copy in answer.copies if copy.sha256 is not None]
        yield f"{len(written)} corrected copies"
        yield from (
            one_line(f"no copy of {copy.path}: {copy.reason}")
            for copy in answer.copies
            if copy.sha256 is None
        )
        for amended in answer.amended:
            pdf = amended.as_dict()["pdf"]
            yield one_line(f"{pdf or f'NO REPORT: {amended.outcome}'} replaces {amended.replaces}")


def _rows(audit: ArchiveAudit) -> Iterator[list[str]]:
    listed = 0
    for file in audit.files.plain():
        if file["grade"] in (*CLEAN, "no_recording"):
            continue
        if listed == _SHOWN:
            return
        listed += 1
        repair = file["repair"] or {"FY_max_abs_N": None, "MZ_max_abs_Nm": None}
        FY, MZ = repair["FY_max_abs_N"], repair["MZ_max_abs_Nm"]
        yield [
            file["path"],
            file["grade"],
            file["record"] or ", ".join(file["candidates"]),
            file["variant"] or file["reason"] or "",
            file["in_force"] or "",
            "" if FY is None else f"{FY:.1f}",
            "" if MZ is None else f"{MZ:.2f}",
        ]
