"""What an audit says: the JSON document, whose long lists are iterators, and the text for people."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from toolkit.audit.model import CLEAN
from toolkit.lab.answers import table

if TYPE_CHECKING:
    from toolkit.audit.archive import ArchiveAudit
    from toolkit.audit.corrected import Copy
    from toolkit.audit.linked import Linked
    from toolkit.audit.since_good import Drift, DriftedFile, DriftedTest
    from toolkit.lab.amended import Amended

_SHOWN, _SETTINGS = 40, 10


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AuditAnswer:
    """An audit and what was asked for besides; None where it was not."""

    made: ArchiveAudit
    linked: Linked | None
    drift: Drift | None
    drifted: tuple[DriftedFile, ...]
    drifted_tests: tuple[DriftedTest, ...]
    copies: tuple[Copy, ...] | None
    amended: tuple[Amended, ...] = ()


def payload_of(told: AuditAnswer) -> dict[str, Any]:
    """Return the JSON document; what there may be many of are iterators."""
    made = told.made
    found: dict[str, Any] = {
        "archive": made.archive,
        "known_at": made.known_at.isoformat(),
        "files": files_of(told),
        "summary": {"files": len(made.files), "grades": dict(made.grades), "undated": made.undated},
        "tests": _tests(told),
        "refused_records": [{"id": r.id, "rule": r.rule, "reason": r.reason} for r in made.refused],
        "heads": dict(made.heads),
        "findings": (finding.as_dict() for finding in made.findings),
    }
    if told.linked is not None:
        found["reports"] = [one.as_dict() for one in told.linked.reports]
        found["report_unknown"] = list(told.linked.unknown)
    if told.drift is not None:
        found["since_good"] = {
            **told.drift.as_dict(),
            "tests": [one.as_dict() for one in told.drifted_tests],
            "files": [one.as_dict() for one in told.drifted],
        }
    if told.copies is not None:
        found["repaired"] = [one.as_dict() for one in told.copies]
        found["amended"] = [one.as_dict() for one in told.amended]
    return found


def files_of(told: AuditAnswer) -> Iterator[dict[str, Any]]:
    """Yield every file's result; with the reports of its test where reports were asked about."""
    for one in told.made.files.plain():
        if told.linked is not None:
            one["reports"] = told.linked.of_test(one["test"])
        yield one


def _tests(told: AuditAnswer) -> Iterator[dict[str, Any]]:
    for one in told.made.tests:
        if told.linked is not None:
            one["reports"] = told.linked.of_test(one["test"])
        yield one


def text_of(told: AuditAnswer) -> str:
    """Return the answer for people."""
    from toolkit.reduction.physics import RULES

    made = told.made
    rows = list(_rows(made))
    bad = len(made.files) - made.grades["exact"] - made.grades["rounding"]
    header = ["file", "grade", "computed by", "how", "in force", "dFY [N]", "dMZ [N·m]"]
    lines = [table(header, rows, align="<<<<<>>")] if rows else []
    if bad > len(rows):
        lines.append(f"... and {bad - len(rows)} more; --json tells all of them")
    counted = ", ".join(f"{count} {grade}" for grade, count in made.grades.items() if count)
    lines += ["", f"{len(made.files)} files: {counted or 'none'}; known at {made.known_at.isoformat()}"]
    notes = Counter(one.rule for one in made.findings if one.level == "note")
    if notes:
        lines.append("also: " + ", ".join(f"{count} {rule}" for rule, count in sorted(notes.items())))
    impossible = {one.where for one in made.findings if one.rule in RULES}
    if impossible:
        some = ", ".join(sorted(impossible)[:3]) + (", ..." if len(impossible) > 3 else "")
        lines.append(f"Fy or Mz that no tire has, in files: {len(impossible)} ({some}); --json tells why")
    settings = Counter(one.message for one in made.findings if one.rule == "test-toml")
    lines += [f"{count} files: {said}" for said, count in settings.most_common(_SETTINGS)]
    if len(settings) > _SETTINGS:
        lines.append(f"... and {len(settings) - _SETTINGS} more of test.toml; --json tells all of them")
    lines += [f"refused record {one.id}: {one.reason}" for one in made.refused]
    lines += [f"head of {name}: {head}" for name, head in made.heads]
    return "\n".join([*lines, *_asked(told)])


def _asked(told: AuditAnswer) -> Iterator[str]:
    if told.linked is not None:
        yield ""
        for one in told.linked.reports:
            why = f"to be amended, {one.not_clean} of {one.files} files are not right"
            why = why if one.to_amend else "stands"
            tests = ", ".join(sorted(one.tests))
            yield f"report {one.report} ({tests}): {why}" if one.files else f"report unknown: {one.report}"
        if told.linked.unknown:
            yield f"report unknown: {len(told.linked.unknown)} tests, {', '.join(told.linked.unknown[:10])}"
    if told.drift is not None:
        drift = told.drift
        yield ""
        yield drift.told
        yield (
            f"since {drift.good} ({drift.good_date}) {len(told.drifted)} files were recorded; an estimate of "
            "the effect, interpolated by days:"
        )
        rows = [
            [t.test, t.date.isoformat(), f"{t.share:.0%}", str(t.files),
             "" if t.FY_N is None else f"{t.FY_N:.2f}", "" if t.MZ_Nm is None else f"{t.MZ_Nm:.3f}",
             f"without {t.left_out} files, see --json" if t.left_out else ""]
            for t in told.drifted_tests[:_SHOWN]
        ]  # fmt: skip
        yield table(["test", "date", "share", "files", "dFY [N]", "dMZ [N·m]", ""], rows, align="<<>>>><")
        if len(told.drifted_tests) > len(rows):
            yield f"... and {len(told.drifted_tests) - len(rows)} more; --json tells all of them"
    if told.copies is not None:
        made = [one for one in told.copies if one.sha256 is not None]
        yield f"{len(made)} corrected copies"
        yield from (f"no copy of {one.path}: {one.reason}" for one in told.copies if one.sha256 is None)
        for done in told.amended:
            made_of = done.as_dict()
            yield f"{made_of['pdf'] or 'NO REPORT: ' + str(done.outcome)} replaces {done.replaces}"


def _rows(made: ArchiveAudit) -> Iterator[list[str]]:
    shown = 0
    for one in made.files.plain():
        if one["grade"] in CLEAN:
            continue
        if shown == _SHOWN:
            return
        shown += 1
        repair = one["repair"] or {"FY_max_abs_N": None, "MZ_max_abs_Nm": None}
        FY, MZ = repair["FY_max_abs_N"], repair["MZ_max_abs_Nm"]
        yield [
            one["path"],
            one["grade"],
            one["record"] or ", ".join(one["candidates"]),
            one["variant"] or one["reason"] or "",
            one["in_force"] or "",
            "" if FY is None else f"{FY:.1f}",
            "" if MZ is None else f"{MZ:.2f}",
        ]
