"""An audit of an archive: every file, the drift since a good record, corrected copies, amended reports.

`Audit` is what a notebook sees of it: what `Laboratory.audit_archive` returns.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolkit.lab.archives.audit_answer import AuditOutcome, approved_later, files_of
from toolkit.lab.archives.audit_headline import headline
from toolkit.lab.faces import Face, Facts

if TYPE_CHECKING:
    import pandas as pd

    from toolkit.audit.since_good import DriftedFile
    from toolkit.calibration.records.use import CalibrationUse
    from toolkit.calibration.registry.registry import Registry
    from toolkit.findings import Finding
    from toolkit.lab.archives.amended import Amended
    from toolkit.lab.tire_tests.resolve import Basis
    from toolkit.report.content import Plot
    from toolkit.report.word.package import Template

    Stage = Callable[[int | None, str], AbstractContextManager[Callable[[str], None]]]

PAGE, LINES = "audit.html", "audit.jsonl"
_WORST = 6  # traces that the page draws


@dataclass(frozen=True, slots=True, kw_only=True)
class AuditOrder:
    """What an audit is asked for; None where it is not.

    ``reports`` links reports of past years; ``since_good`` is the record of the last good as-found;
    ``repair`` takes corrected copies, ``out`` the page and the lines, by ``template`` a summary too.
    """

    archive: Path
    basis: Basis
    workers: int = 1
    scheduler: str | None = None
    out: Path | None = None
    reports: Path | None = None
    since_good: str | None = None
    repair: Path | None = None
    template: Path | None = None
    parquet: Path | None = None


def audit(order: AuditOrder, *, stage: Stage | None = None) -> tuple[AuditOutcome, tuple[Path, ...]]:
    """Return the answer of an audit, and the files that were written.

    Raises
    ------
    ToolkitError
        the archive, the registry or a folder cannot be used: told before any file is read
    """
    from toolkit.audit.archive import audit_archive, inventory
    from toolkit.audit.corrected import check_target, write_copies
    from toolkit.audit.linked import link, read_reports
    from toolkit.audit.serial import check_parquet, write_parquet
    from toolkit.audit.since_good import drift_since, drifted_files, drifted_tests
    from toolkit.lab.archives.amended import amend
    from toolkit.lab.home import open_registry

    stage = stage or _silent
    registry = open_registry(order.basis.calibrations, order.basis.home)
    names = inventory(order.archive)
    unread: list[Finding] = []
    past = None if order.reports is None else read_reports(order.reports, unread)
    drift = None if order.since_good is None else drift_since(registry, order.since_good)
    if order.repair is not None:
        check_target(order.archive, order.repair)
    if order.parquet is not None:
        check_parquet(order.parquet)
    opened = None
    if order.template is not None:
        from toolkit.report.word.package import read_template

        opened = read_template(order.template)
    with stage(len(names.files), "audit") as step:
        results = audit_archive(
            order.archive, registry, known_at=order.basis.known_at, workers=order.workers,
            scheduler=order.scheduler, step=step, names=names, out=order.out,
        )  # fmt: skip
        results = replace(results, findings=(*results.findings, *unread))
    drifted: tuple[DriftedFile, ...] = ()
    if drift is not None:
        with stage(None, "since the last good one") as step:
            files = drifted_files(
                results, registry, drift, workers=order.workers, scheduler=order.scheduler, step=step
            )
            drifted = tuple(sorted(files, key=lambda file: file.path))
    copies = None
    if order.repair is not None:
        with stage(None, "corrected copies") as step:
            copies = write_copies(results, registry, order.repair, draft=order.basis.draft, step=step)
    linked = None if past is None else link(results, past)
    amended: tuple[Amended, ...] = ()
    if order.repair is not None and linked is not None:
        with stage(None, "amended reports") as step:
            amended = amend(linked, results, order.repair, order.basis, step=step)
    answer = AuditOutcome(
        made=results,
        linked=linked,
        drift=drift,
        drifted=drifted,
        drifted_tests=drifted_tests(results, drifted),
        copies=copies,
        amended=amended,
        approved_later=approved_later(results, registry),
    )
    written = () if order.out is None else write_folder(order.out, answer, registry, opened)
    if order.parquet is not None:
        write_parquet(order.parquet, files_of(answer), known_at=results.known_at, reports=linked is not None)
        written = (*written, order.parquet)
    return answer, written


@contextlib.contextmanager
def _silent(_total: int | None, _title: str) -> Iterator[Callable[[str], None]]:
    yield lambda _text: None


def write_folder(
    out: Path, answer: AuditOutcome, registry: Registry, template: Template | None
) -> tuple[Path, ...]:
    """Write the page for people, the lines for machines and, by a template, the summary; return them.

    Raises
    ------
    OutputError
        the folder cannot be written to
    TemplateError, RenderError
        the summary cannot be made; nothing was changed but the results of single files, which are used again
    """
    from toolkit.audit.timeline import timelines, traces
    from toolkit.lab.rules import rules_catalogue
    from toolkit.publication import publication
    from toolkit.recording.marks import GENERATOR, OWN_OUTPUT
    from toolkit.report.audit.page import AuditView, write_page

    view = AuditView(
        made=answer.made,
        rules=rules_catalogue(),
        timelines=timelines(answer.made.files.plain(), registry, answer.made.known_at),
        traces=tuple(traces(answer.made, registry, _WORST)),
        linked=answer.linked,
        drift=answer.drift,
        drifted=answer.drifted,
        drifted_tests=answer.drifted_tests,
        uses=_uses(answer, registry),
        headline=headline(answer.made).sentence,
    )
    with publication(out) as stage:
        with (stage / LINES).open("wb") as lines:
            head: dict[str, object] = {
                "generator": GENERATOR,
                "marks": OWN_OUTPUT,
                "schema": 1,
                "kind": "audit",
            }
            head |= {
                "known_at": answer.made.known_at.isoformat(),
                "archive": str(answer.made.archive.absolute()),
            }
            lines.write(json.dumps(head).encode() + b"\n")
            linked = answer.linked is not None
            files = (
                (json.dumps(line).encode() for line in files_of(answer))
                if linked
                else answer.made.files.raw()
            )
            lines.writelines(line + b"\n" for line in files)
        write_page(stage / PAGE, view)
        if template is None:
            return out / PAGE, out / LINES
        from toolkit.report.audit.content import build_audit_content
        from toolkit.report.deliver import deliver
        from toolkit.report.style import read_style, style_file

        content = build_audit_content(view, read_style(style_file(template.path)))
        summary = deliver(template, content, out, name="audit", stage=stage)
        return out / PAGE, out / LINES, summary.docx, summary.pdf


def _uses(answer: AuditOutcome, registry: Registry) -> tuple[CalibrationUse, ...]:
    """Return the records in force by which the changes of the files were computed."""
    from toolkit.calibration.records.use import CalibrationUse

    ids = {file["in_force"] for file in answer.made.files.plain() if file["repair"] is not None}
    records = [registry.load(record_id) for record_id in sorted(ids)]
    return tuple(
        CalibrationUse(
            id=r.id, sha256=r.sha256, unverified=not r.verified, signature=registry.signature(r.id)
        )
        for r in records
    )


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class Audit(Face):
    """Which calibration computed each file of an archive, and what it changes; ``written`` lie in ``out``."""

    result: AuditOutcome
    written: tuple[Path, ...]

    @property
    def grades(self) -> dict[str, int]:
        """How many files have each grade."""
        return dict(self.result.made.grades)

    @property
    def clean(self) -> bool:
        """Whether nothing asks for a person's attention."""
        return self.result.made.clean

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What should be known about the archive."""
        return self.result.made.findings

    def to_dataframe(self) -> pd.DataFrame:
        """Return one file a row: path, grade, record, variant, the change by the record in force."""
        import pandas as pd

        rows = []
        for file in self.result.made.files.plain():
            repair: dict[str, Any] = file["repair"] or {"FY_max_abs_N": None, "MZ_max_abs_Nm": None}
            keys = ("path", "date", "grade", "record", "variant", "in_force", "reason")
            rows.append({key: file[key] for key in keys} | repair)
        return pd.DataFrame(rows)

    def _facts(self) -> Facts:
        audit = self.result.made
        return {
            "archive": audit.archive,
            "files": f"{len(audit.files)} files",
            "grades": ", ".join(f"{count} {grade}" for grade, count in audit.grades.items() if count),
            "known at": f"known at {audit.known_at.isoformat()}",
        }

    def _plots(self) -> Mapping[str, Plot]:
        from toolkit.report.audit.content import audit_plots
        from toolkit.report.content import Curve, Plot

        counts = {grade: count for grade, count in self.grades.items() if count}
        bars = Curve(
            label="files", x=tuple(map(float, range(len(counts)))), y=tuple(map(float, counts.values())),
            style="bars", notes=tuple(map(str, counts.values())),
        )  # fmt: skip
        counted = ", ".join(f"{count} {grade}" for grade, count in counts.items())
        grades = Plot(
            name="grades", x_label="", y_label="files", curves=(bars,), names=tuple(counts),
            caption="Files by grade.", alt=f"Files by grade: {counted}.",
        )  # fmt: skip
        return {"grades": grades} | audit_plots(self.result.made)
