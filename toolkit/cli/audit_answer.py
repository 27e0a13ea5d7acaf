"""The answer of `toolkit audit`: the JSON document, the text for people, and the files of ``--out``."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolkit.audit.model import CLEAN
from toolkit.cli.console import table

if TYPE_CHECKING:
    from toolkit.audit.archive import ArchiveAudit
    from toolkit.audit.corrected import Copy
    from toolkit.audit.linked import Linked
    from toolkit.audit.since_good import Drift, DriftedFile, DriftedTest
    from toolkit.calibration.records.use import CalibrationUse
    from toolkit.calibration.registry.registry import Registry
    from toolkit.cli.audit_amend import Amended
    from toolkit.report.word.package import Template

PAGE, LINES = "audit.html", "audit.jsonl"
_SHOWN, _WORST, _SETTINGS = 40, 6, 10


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Answer:
    """An audit and what was asked for besides; None where it was not."""

    made: ArchiveAudit
    linked: Linked | None
    drift: Drift | None
    drifted: tuple[DriftedFile, ...]
    drifted_tests: tuple[DriftedTest, ...]
    copies: tuple[Copy, ...] | None
    amended: tuple[Amended, ...] = ()


def payload_of(told: Answer) -> dict[str, Any]:
    """Return the JSON document; what there may be many of are iterators."""
    made = told.made
    found: dict[str, Any] = {
        "archive": made.archive,
        "known_at": made.known_at.isoformat(),
        "files": _files(told),
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


def _files(told: Answer) -> Iterator[dict[str, Any]]:
    for one in told.made.files.plain():
        if told.linked is not None:
            one["reports"] = told.linked.of_test(one["test"])
        yield one


def _tests(told: Answer) -> Iterator[dict[str, Any]]:
    for one in told.made.tests:
        if told.linked is not None:
            one["reports"] = told.linked.of_test(one["test"])
        yield one


def write_folder(out: Path, told: Answer, registry: Registry, template: Template | None) -> tuple[Path, ...]:
    """Write the page for people, the lines for machines and, by a template, the summary; return them.

    Raises
    ------
    OutputError
        the folder cannot be written to
    TemplateError, RenderError
        the summary cannot be made; the page and the lines are there
    """
    from toolkit.audit.timeline import timelines
    from toolkit.audit.traces import traces
    from toolkit.cli.explain import rules_catalogue
    from toolkit.files import atomic_path
    from toolkit.recording.marks import GENERATOR, OWN_OUTPUT
    from toolkit.report.audit.page import AuditView, write_page

    with atomic_path(out / LINES) as temporary, temporary.open("wb") as lines:
        head = {"generator": GENERATOR, "marks": OWN_OUTPUT, "schema": 1, "kind": "audit"}
        lines.write(json.dumps({**head, "known_at": told.made.known_at.isoformat()}).encode() + b"\n")
        linked = told.linked is not None
        files = (json.dumps(one).encode() for one in _files(told)) if linked else told.made.files.raw()
        lines.writelines(one + b"\n" for one in files)
    view = AuditView(
        made=told.made,
        rules=rules_catalogue(),
        timelines=timelines(told.made, registry),
        traces=tuple(traces(told.made, registry, _WORST)),
        linked=told.linked,
        drift=told.drift,
        drifted=told.drifted,
        drifted_tests=told.drifted_tests,
        uses=_uses(told, registry),
    )
    write_page(out / PAGE, view)
    if template is None:
        return out / PAGE, out / LINES
    from toolkit.report.audit.content import build_audit_content
    from toolkit.report.deliver import deliver
    from toolkit.report.style import read_style, style_file

    content = build_audit_content(view, read_style(style_file(template.path)))
    done = deliver(template, content, out, name="audit")
    return out / PAGE, out / LINES, done.docx, done.pdf


def _uses(told: Answer, registry: Registry) -> tuple[CalibrationUse, ...]:
    """Return the records in force by which the changes of the files were computed."""
    from toolkit.calibration.records.use import CalibrationUse

    wanted = {one["in_force"] for one in told.made.files.plain() if one["repair"] is not None}
    records = [registry.load(one) for one in sorted(wanted)]
    return tuple(CalibrationUse(id=r.id, sha256=r.sha256, unverified=not r.verified) for r in records)


def write_table(target: Path, told: Answer) -> Path:
    """Write the results of all files as a Parquet table; return it.

    Raises
    ------
    ConfigError, OutputError
        see `toolkit.audit.parquet.write_parquet`
    """
    from toolkit.audit.parquet import write_parquet

    write_parquet(target, _files(told), known_at=told.made.known_at, reports=told.linked is not None)
    return target


def text_of(told: Answer) -> str:
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


def _asked(told: Answer) -> Iterator[str]:
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
