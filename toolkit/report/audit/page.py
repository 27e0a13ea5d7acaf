"""The audit as one HTML file that opens without a network: mailable and archivable."""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolkit.audit.since_good import Drift, DriftedFile, DriftedTest
from toolkit.calibration.records.use import CalibrationUse, mark_of
from toolkit.characteristics.catalogue import summary
from toolkit.recording.marks import OWN_OUTPUT
from toolkit.report.audit.svg import rows_of, timeline
from toolkit.report.content import signature_text
from toolkit.report.pages.kit import Column, Table, number, page_parts, table
from toolkit.units import printed

if TYPE_CHECKING:
    from markupsafe import Markup

    from toolkit.audit.archive import ArchiveAudit
    from toolkit.audit.linked import Linked, RestingReport
    from toolkit.audit.timeline import Timeline, Trace
    from toolkit.findings import Finding

MOST_ROWS = 20_000
"""Beyond so many files the table leaves out those that are right, and says so."""

_PLACES, _TESTS = 25, 60
_FILES = (
    Column(title="file"),
    Column(title="grade", kind="grade"),
    Column(title="computed by"),
    Column(title="how"),
    Column(title="in force"),
    Column(title="test date", kind="date"),
    Column(title="ΔFy max [N]", kind="number"),
    Column(title="ΔMz max [N·m]", kind="number"),
    Column(title="reports"),
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AuditView:
    """What the page shows. ``rules``: rule id -> what it means and what to do; ``headline``: its first line.

    ``uses``: the records in force by which repairs were computed.
    """

    made: ArchiveAudit
    rules: Mapping[str, Mapping[str, str]]
    timelines: Sequence[Timeline]
    traces: Sequence[Trace]
    linked: Linked | None = None
    drift: Drift | None = None
    drifted: Sequence[DriftedFile] = ()
    drifted_tests: Sequence[DriftedTest] = ()
    uses: tuple[CalibrationUse, ...] = ()
    headline: str = ""


def write_page(path: Path, view: AuditView) -> None:
    """Write the page; it is long, and never held as a whole."""
    with path.open("w", encoding="utf-8", errors="replace") as stream:
        stream.writelines(page(view))


def page(view: AuditView) -> Iterator[str]:
    """Yield the page in parts; the table's rows are never held as a whole."""
    return page_parts(
        Path(__file__).parent,
        keywords=OWN_OUTPUT,
        mark=mark_of(view.uses),
        signature=signature_text(view.uses),
        audit=view.made,
        headline=view.headline,
        timelines=((versions.instrument, timeline(versions)) for versions in view.timelines),
        file_columns=_FILES,
        file_rows=_file_rows(view),
        worst=(_WorstFile.of(trace) for trace in view.traces),
        most_tests=_TESTS,
        tests=_tests(view.made),
        estimates=list(islice(_estimates(view.made), _PLACES + 1)),
        most_estimates=_PLACES,
        coefficients=_coefficients,
        reports=None if view.linked is None else _reports(view.made, view.linked.reports),
        unlinked=() if view.linked is None else tuple(map(view.made.shown, view.linked.unknown)),
        drift=view.drift,
        drifted=sorted(view.drifted, key=lambda file: (file.date, file.path)),
        drifted_tests=view.drifted_tests,
        shares=_shares,
        findings=list(_findings(view)),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _WorstFile:
    """A file that changes much: its line of the answer, and its loads drawn row by row."""

    line: Mapping[str, Any]
    computed: str
    pictures: Sequence[Markup]

    @classmethod
    def of(cls, trace: Trace) -> _WorstFile:
        line = trace.plain
        computer = line["record"] or " or ".join(line["candidates"]) or "no record"
        return cls(
            line=line,
            computed=f"{computer}, {line['variant']}" if line["variant"] else computer,
            pictures=[
                rows_of(load, unit, trace.old[load], trace.new[load])
                for load, unit in (("FY", "N"), ("MZ", "N·m"))
                if load in trace.old
            ],
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class _RuleFindings:
    """The findings of one rule: how many, what it means, and the first of them."""

    rule: str
    count: int
    means: str
    do: str
    first: Sequence[Finding]


def _file_rows(view: AuditView) -> Iterator[tuple[object, ...]]:
    every_file = len(view.made.files) <= MOST_ROWS
    for line in view.made.files.plain():
        if not every_file and line["grade"] in ("exact", "rounding", "no_recording"):
            continue
        repair = line["repair"] or {}
        yield (
            line["path"],
            line["grade"],
            line["record"] or ", ".join(line["candidates"]) or None,
            line["variant"] or line["reason"],
            line["in_force"],
            line["date"],
            repair.get("FY_max_abs_N"),
            repair.get("MZ_max_abs_Nm"),
            ", ".join(view.linked.of_test(line["test"])) if view.linked is not None else None,
        )


def _tests(audit: ArchiveAudit) -> Table | None:
    """Return the tests that change most, and by how much."""
    changed = (test for test in audit.tests if test["not_clean"])
    worst = heapq.nlargest(_TESTS, changed, key=lambda test: float(test["FY_max_abs_N"]))
    if not worst:
        return None
    # A stiffness changes by a share of itself; what is near zero by nature, in its unit.
    characteristics = [
        (str(entry.summary), None if entry.scope == "direction" else printed(entry.printed_unit))
        for entry in summary()
    ]
    rows = [
        (
            audit.shown(test["test"]),
            test["date"],
            f"{test['not_clean']} of {test['files']}",
            *(_largest(test["effects"], name, percent=unit is None) for name, unit in characteristics),
        )
        for test in worst
    ]
    names = (f"{name.replace('_', ' ')} [{unit or '%'}]" for name, unit in characteristics)
    titles = ("test", "date", "files not right", *names)
    return table(titles, rows, numbers=range(2, len(titles)), dates=(1,))


def _largest(effects: Sequence[Mapping[str, Any]], name: str, *, percent: bool = False) -> str:
    changes = [
        100 * effect["change"] / abs(effect["old"]) if percent and effect["old"] else effect["change"]
        for effect in effects
        if effect["name"] == name
    ]
    text = f"{max(changes, key=abs):+.2f}" if changes else ""
    return "0.00" if text in ("+0.00", "-0.00") else text


def _estimates(audit: ArchiveAudit) -> Iterator[tuple[str, Mapping[str, Any]]]:
    for line in audit.files.plain():
        if line["estimate"] is not None:
            yield line["path"], line["estimate"]


def _coefficients(equation: Mapping[str, Any]) -> Table:
    rows = [
        (name, f"{term['value']:.6g}", *(number(term[end], ".6g", "open") for end in ("low", "high")))
        for name, term in equation["coefficients"].items()
    ]
    return table(("term", "estimate", "from", "to"), rows, numbers=(1, 2, 3))


def _reports(audit: ArchiveAudit, reports: Iterable[RestingReport]) -> Table:
    rows = [
        (
            report.report,
            ", ".join(sorted(report.linked_by)) or "nothing",
            ", ".join(map(audit.shown, sorted(report.tests))),
            f"{report.not_clean} of {report.files}",
        )
        for report in reports
    ]
    return table(("report", "linked by", "tests", "files not right"), rows, numbers=(3,))


def _shares(subject: str, drifted: Iterable[DriftedFile | DriftedTest]) -> Table:
    """Return what each file or test has of a drift, estimated by its day."""
    rows = [
        (
            row.test if isinstance(row, DriftedTest) else row.path,
            row.date,
            f"{row.share:.0%}",
            number(row.FY_N, ".2f"),
            number(row.MZ_Nm, ".3f"),
            _without(row) if isinstance(row, DriftedTest) else row.reason or "",
        )
        for row in drifted
    ]
    titles = (subject, "date", "share", "ΔFy max [N]", "ΔMz max [N·m]", "")
    return table(titles, rows, numbers=(2, 3, 4), dates=(1,))


def _without(test: DriftedTest) -> str:
    return f"without {test.left_out} of {test.files} files" if test.left_out else ""


def _findings(view: AuditView) -> Iterator[_RuleFindings]:
    counts = Counter(finding.rule for finding in view.made.findings)
    for rule, count in counts.most_common():
        explained = view.rules.get(rule, {})
        of_rule = (finding for finding in view.made.findings if finding.rule == rule)
        yield _RuleFindings(
            rule=rule,
            count=count,
            means=explained.get("means", ""),
            do=explained.get("do", ""),
            first=list(islice(of_rule, _PLACES)),
        )
