"""Amended reports of an audit: a test replayed with the record in force, naming the report it replaces."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from toolkit.audit.archive import ArchiveAudit
    from toolkit.audit.linked import Linked, RestingReport
    from toolkit.errors import ToolkitError
    from toolkit.lab.tire_tests.resolve import Basis, Resolved
    from toolkit.report.deliver import Delivered, Job

FOLDER = "reports"


@dataclass(frozen=True, slots=True, kw_only=True)
class Amended:
    """A report that replaces another one, or why there is none."""

    replaces: str
    test: str
    outcome: Delivered | ToolkitError

    def as_dict(self) -> dict[str, Any]:
        """Return the report under the keys of the answer."""
        from toolkit.errors import ToolkitError

        outcome = self.outcome
        keys: dict[str, Any] = {"replaces": self.replaces, "test": self.test}
        if isinstance(outcome, ToolkitError):
            return keys | {"docx": None, "pdf": None, "error": outcome.as_dict()}
        return keys | {"docx": outcome.docx, "pdf": outcome.pdf, "error": None}


def amend(
    linked: Linked, audited: ArchiveAudit, target: Path, basis: Basis, *, step: Callable[[str], None]
) -> tuple[Amended, ...]:
    """Make the amended report of each report with a manifest that rests on another record than that in force.

    They are written to ``reports/`` of the folder, each in a folder named after the report that it replaces.
    A test with a file whose cells were changed, or may have been, has none: it would be computed from them.

    Raises
    ------
    TemplateError, RenderError
        the template cannot be used, or LibreOffice is missing
    """
    from toolkit.errors import ToolkitError
    from toolkit.lab.answers import file_name
    from toolkit.lab.home import home_template
    from toolkit.lab.tire_tests.resolve import resolve_test
    from toolkit.report.deliver import deliver_all
    from toolkit.report.word.package import read_template

    pairs = list(_wanted(linked))
    if not pairs:
        return ()
    archive, unfit = audited.archive, _unfit(audited)
    template = read_template(home_template("org.docx", basis.home))
    jobs: list[Job] = []
    failed: dict[int, ToolkitError] = {}
    for index, (past, test) in enumerate(pairs):
        try:
            if test in unfit:
                raise unfit[test]
            resolved = resolve_test(archive / test, basis)
            out = target / FOLDER / file_name(f"{past.id}-{test}", otherwise=f"report-{index + 1}")
            jobs.append(_job(past, resolved, archive / test, template, out))
        except ToolkitError as error:
            failed[index] = error
        step(past.report)
    # A test of past years may lack what today's template asks for: it prints a visible mark.
    outcomes = iter(deliver_all(jobs, allow_missing=True) if jobs else ())
    return tuple(
        Amended(
            replaces=past.id or past.report, test=test, outcome=failed[i] if i in failed else next(outcomes)
        )
        for i, (past, test) in enumerate(pairs)
    )


def _unfit(audited: ArchiveAudit) -> dict[str, ToolkitError]:
    """Return the tests that cannot be computed from their cells, each with its first file that says so."""
    from toolkit.audit.corrected import DISPUTED, disagreement
    from toolkit.audit.day import CONTRADICTED, of_two_days
    from toolkit.audit.sides import disputed
    from toolkit.errors import RecordingError

    unfit: dict[str, ToolkitError] = {}
    apart = of_two_days(audited.files.plain())
    for plain in audited.files.plain():
        test = plain["test"]
        if test is None or test in unfit:
            continue
        if plain["path"] in apart:
            unfit[test] = RecordingError(
                "the day of the test is contradicted",
                where=audited.shown(test),
                got=f"{plain['path']}: {apart[plain['path']]}",
                expected="recordings of the test alone",
                next_step="put the file back into its own test, or correct the date, and audit again",
                rule=CONTRADICTED,
            )
            continue
        if not disputed(plain):
            continue
        unfit[test] = RecordingError(
            "the test cannot be computed again from its cells",
            where=audited.shown(test),
            got=f"{plain['path']}: {disagreement(plain)}",
            expected="cells as they were recorded",
            next_step="restore the file as the acquisition program wrote it and audit again, or amend the "
            "report by hand",
            rule=DISPUTED,
        )
    return unfit


def _wanted(linked: Linked) -> Iterator[tuple[RestingReport, str]]:
    for past in linked.reports:
        if past.id is not None and past.to_amend:
            yield from ((past, test) for test in sorted(past.tests))


def _job(past: RestingReport, resolved: Resolved, test: Path, template: Any, out: Path) -> Job:
    from toolkit.lab.tire_tests.handover import details_of, provenance
    from toolkit.report.deliver import Job
    from toolkit.report.style import read_style, style_file
    from toolkit.report.test.content import build_content

    use = resolved.result.reduced.calibration
    why = (
        f"computed again with {use.id}, the calibration in force on the day of the test; the report that "
        f"this one replaces rests on {', '.join(past.calibrations) or 'another one'}"
    )
    content = build_content(
        resolved.result,
        resolved.record,
        findings=resolved.findings,
        style=read_style(style_file(template.path)),
        details=replace(details_of(test, None), amends=past.id, amendment=why),
    )
    return Job(template=template, content=content, out=out, provenance=provenance(resolved, test))
