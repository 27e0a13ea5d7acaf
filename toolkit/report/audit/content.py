"""An audit's summary as a document: its texts, tables and picture, each declared with what builds it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

from toolkit.audit.model import NOT_IDENTIFIED, TELLS, Grade
from toolkit.audit.sides import disputed
from toolkit.files import sha256_bytes
from toolkit.report.content import Curve, Plot, ReportContent
from toolkit.report.document import Document, Rows
from toolkit.report.style import Style
from toolkit.version import __version__

if TYPE_CHECKING:
    from toolkit.audit.archive import ArchiveAudit
    from toolkit.report.audit.page import AuditView

_RIGHT = ("exact", "rounding")
_MOST_TESTS, _MOST_REPORTS = 25, 40


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """An audit with what its texts and its picture count over all files.

    ``right`` and ``wrong`` are of the files that could be read; of ``repaired`` a record in force is known,
    which changes Fy by ``FY`` [N] and Mz by ``MZ`` [N·m] at most. ``years`` has right and wrong by year.
    """

    view: AuditView
    name: str
    heads: str
    right: int
    wrong: int
    repaired: int
    disputed: int
    FY: float
    MZ: float
    years: Mapping[int, list[int]]

    @property
    def id(self) -> str:
        """Identification: the same archive, registry and day of knowledge give the same."""
        audit = self.view.made
        key = f"{self.name}|{audit.known_at}|{self.heads}|{dict(audit.grades)}"
        return f"AUDIT-{audit.known_at.isoformat()}-{sha256_bytes(key.encode())[:8]}"

    @property
    def unreadable(self) -> int:
        """Files that could not be read."""
        return self.view.made.grades["unreadable"]


def _summary(view: AuditView) -> Summary:
    FY = MZ = 0.0
    right = wrong = repaired = unsettled = 0
    years: dict[int, list[int]] = {}
    for file in view.made.files.plain():
        clean = file["grade"] in _RIGHT
        right += clean
        if file["grade"] == "no_recording" or disputed(file):
            unsettled += disputed(file)
            continue
        wrong += not clean and file["grade"] != "unreadable"
        if file["date"] is not None and file["grade"] != "unreadable":
            years.setdefault(int(file["date"][:4]), [0, 0])[not clean] += 1
        if not clean and file["repair"] is not None:
            repaired += 1
            FY = max(FY, file["repair"]["FY_max_abs_N"] or 0.0)
            MZ = max(MZ, file["repair"]["MZ_max_abs_Nm"] or 0.0)
    return Summary(
        view=view,
        name=view.made.archive.absolute().name,
        heads=", ".join(f"{instrument} {head}" for instrument, head in view.made.heads),
        right=right, wrong=wrong, repaired=repaired, disputed=unsettled, FY=FY, MZ=MZ, years=years,
    )  # fmt: skip


AUDIT: Document[Summary] = Document(
    name="audit", family="audit", package=__package__, required=("tk:audit.heads",)
)


def build_audit_content(view: AuditView, style: Style | None = None) -> ReportContent:
    """Return what the template of an audit's summary can ask for."""
    style, summary = Style(), _summary(view)
    return AUDIT.content(
        summary,
        style,
        calibrations=view.uses,
        title=f"Audit of the archive {summary.name}",
        identity=summary.id,
        subject="Audit of an archive of recordings",
        issued=view.made.known_at,
    )


def audit_plots(audit: ArchiveAudit) -> dict[str, Plot]:
    """Return the figures of an audit by name; none where the files are of one year."""
    from toolkit.report.audit.page import AuditView

    view = AuditView(made=audit, rules={}, timelines=(), traces=())
    return AUDIT.plots(_summary(view), Style())


def _conclusion(summary: Summary, _style: Style) -> str:
    if summary.right + summary.wrong + summary.disputed == 0:
        text = "The archive has no file that could be read as a recording."
    elif summary.wrong == 0 and summary.disputed:
        text = ""  # what is right stands in the table of grades
    elif summary.wrong == 0:
        text = f"All {summary.right} files that could be read carry the values of the record in force."
    else:
        text = (
            f"Of {len(summary.view.made.files)} files, {summary.right} carry the Fy and Mz of the record "
            f"that was in force on the day of their test, and {summary.wrong} do not. "
        ) + (
            f"By that record Fy changes by up to {summary.FY:.1f} N and Mz by up to {summary.MZ:.2f} N·m."
            if summary.repaired
            else "By how much cannot be told: for none of them a record in force on its day is known."
        )
    if summary.disputed:
        many = "files disagree with their cells" if summary.disputed > 1 else "file disagrees with its cells"
        text += (
            f" {summary.disputed} {many}, which were changed, or may have been: nothing is computed there."
        )
    if summary.unreadable:
        many = (
            "files could not be read and are" if summary.unreadable > 1 else "file could not be read and is"
        )
        text += f" {summary.unreadable} {many} set aside."
    return text.strip()


def _reports_text(summary: Summary, _style: Style) -> str | None:
    linked = summary.view.linked
    if linked is None:
        return None
    return (
        f"{len(linked.reports)} reports were looked at; {sum(report.to_amend for report in linked.reports)} "
        "of them rest on other values than those of the record in force. "
        f"For {len(linked.unknown)} tests the report is unknown."
    )


def _since_good(summary: Summary, _style: Style) -> str | None:
    drift, drifted = summary.view.drift, summary.view.drifted
    if drift is None:
        return None
    largest = max((file.FY_N or 0.0 for file in drifted), default=0.0)
    return (
        f"{drift.failed.session_record} of {drift.failed.date} found {drift.failed.record} out of tolerance. "
        f"Since {drift.good} of {drift.good_date}, {len(drifted)} files were recorded; the interpolated "
        f"effect on Fy is up to {largest:.2f} N."
    )


def _refused(summary: Summary, _style: Style) -> str | None:
    return "; ".join(f"{record.id}: {record.reason}" for record in summary.view.made.refused) or None


VALUES = (
    AUDIT.text(
        "id",
        "identification of the audit, made from its archive, its registry and its day of knowledge",
        lambda summary, _: summary.id,
    ),
    AUDIT.text("title", "title", lambda summary, _: f"Audit of the archive {summary.name}"),
    AUDIT.text("archive", "name of the archive's folder", lambda summary, _: summary.name),
    AUDIT.date("known_at", "day of knowledge", lambda summary, _: summary.view.made.known_at),
    AUDIT.number("files", "files of the archive", lambda summary, _: len(summary.view.made.files)),
    AUDIT.number(
        "right", "files whose Fy and Mz are those of the record in force", lambda summary, _: summary.right
    ),
    AUDIT.number("not_right", "the other files that could be read", lambda summary, _: summary.wrong),
    AUDIT.number("unreadable", "files that could not be read", lambda summary, _: summary.unreadable),
    AUDIT.number("undated", "files without a test date", lambda summary, _: summary.view.made.undated),
    AUDIT.number(
        "largest_FY", "largest change of Fy of any row", lambda summary, _: summary.FY, unit="N", spec=".1f"
    ),
    AUDIT.number(
        "largest_MZ", "largest change of Mz of any row", lambda summary, _: summary.MZ, unit="N*m", spec=".2f"
    ),
    AUDIT.text("conclusion", "what the audit found, in one paragraph", _conclusion),
    AUDIT.text(
        "heads",
        "instruments and the heads of their ledgers",
        lambda summary, _: summary.heads or "no instrument",
    ),
    AUDIT.text("refused", "records that were left out, with the reason", _refused),
    AUDIT.text("since_good", "what a failed as-found session touches, where it was asked for", _since_good),
    AUDIT.text("reports", "what is known of the reports, where it was asked for", _reports_text),
    AUDIT.text("software", "program and version that made the audit", lambda *_: f"toolkit {__version__}"),
    AUDIT.condition(
        "reports_to_amend",
        "a report rests on files that are not right",
        lambda summary, _: any(_to_amend(summary)),
    ),
    AUDIT.condition(
        "all_right",
        "every file is right",
        lambda summary, _: summary.wrong + summary.unreadable + summary.disputed == 0,
    ),
)


@AUDIT.table(
    "audit_grades",
    "the grades: one row for each that occurs",
    """
    grade|grade
    files|number of files
    share|share of all files in percent
    meaning|what it means
    """,
)
def grades(summary: Summary, _style: Style) -> Rows:
    """Return the grades that occur, with their share."""
    files = max(len(summary.view.made.files), 1)
    for grade, count in cast("Mapping[Grade, int]", summary.view.made.grades).items():
        if count:
            meaning = TELLS[grade] if grade in NOT_IDENTIFIED else f"computed {TELLS[grade]}"
            yield grade, str(count), f"{100 * count / files:.1f}", meaning


@AUDIT.table(
    "audit_tests",
    "the tests that change most",
    """
    test|folder of the test
    date|date of the test
    files|files that are not right, of all
    FY|largest change of Fy of any row, N
    MZ|largest change of Mz of any row, N·m
    stiffness|largest change of the cornering stiffness, percent
    conicity|largest change of the conicity, N
    plysteer|largest change of the plysteer, N
    """,
)
def worst_tests(summary: Summary, _style: Style) -> Rows:
    """Return the tests whose Fy changes most, the largest change first."""
    worst: list[dict[str, Any]] = []
    for test in summary.view.made.tests:
        if test["not_clean"]:
            worst.append(test)
            worst = sorted(worst, key=lambda test: -test["FY_max_abs_N"])[:_MOST_TESTS]
    for test in worst:
        yield (
            summary.view.made.shown(test["test"]),
            test["date"],
            f"{test['not_clean']} of {test['files']}",
            f"{test['FY_max_abs_N']:.1f}",
            f"{test['MZ_max_abs_Nm']:.2f}",
            largest_change(test["effects"], "cornering_stiffness", percent=True),
            largest_change(test["effects"], "conicity"),
            largest_change(test["effects"], "plysteer"),
        )


def largest_change(effects: Sequence[Mapping[str, Any]], name: str, *, percent: bool = False) -> str | None:
    """Return the largest change of a characteristic over its loads as text; None where there is none."""
    changes = [
        100 * effect["change"] / abs(effect["old"]) if percent else effect["change"]
        for effect in effects
        if effect["name"] == name and (effect["old"] or not percent)
    ]
    return f"{max(changes, key=abs):+.2f}" if changes else None


def _to_amend(summary: Summary) -> Iterator[Any]:
    linked = summary.view.linked
    return (report for report in (linked.reports if linked is not None else ()) if report.to_amend)


@AUDIT.table(
    "audit_reports",
    "the reports that rest on files that are not right",
    """
    report|report
    linked_by|what links it to the archive
    tests|tests that it rests on
    files|files that are not right, of all
    """,
)
def reports(summary: Summary, _style: Style) -> Rows:
    """Return the reports to be amended."""
    for report in list(_to_amend(summary))[:_MOST_REPORTS]:
        yield (
            report.report,
            ", ".join(sorted(report.linked_by)),
            ", ".join(map(summary.view.made.shown, sorted(report.tests))),
            f"{report.not_clean} of {report.files}",
        )


@AUDIT.table(
    "audit_findings",
    "the findings by rule",
    """
    rule|rule, for 'toolkit explain'
    count|how often
    means|what it means
    do|what to do
    """,
)
def findings(summary: Summary, _style: Style) -> Rows:
    """Return how often each rule was found, and what it means."""
    rules = summary.view.rules
    for rule, count in Counter(finding.rule for finding in summary.view.made.findings).most_common():
        meaning = rules.get(rule, {})
        yield rule, str(count), meaning.get("means"), meaning.get("do")


@AUDIT.figures({"audit_years": "files by the year of their test: right, and not right"})
def years(summary: Summary, _style: Style) -> Iterator[Plot]:
    """Return the files by year, where the tests are of two years at least."""
    counts = summary.years
    if len(counts) < 2:
        return
    x = tuple(float(year) for year in sorted(counts))
    wrong = sum(count[1] for count in counts.values())
    yield Plot(
        name="audit_years",
        x_label="year of the test",
        y_label="files",
        curves=tuple(
            Curve(
                label=label, x=x, y=tuple(float(counts[int(year)][at]) for year in x), style="both", group=at
            )
            for at, label in enumerate(("right", "not right"))
        ),
        caption="Files by the year of their test.",
        alt=f"Files by the year of their test, {int(x[0])} to {int(x[-1])}: {wrong} are not right.",
    )
