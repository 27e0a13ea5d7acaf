"""Make reports and hand them over: staged, verified, then published in their output folders.

Several reports are converted in one call of LibreOffice, whose start is paid for once.

With each goes one manifest: what went in, what came out, and the hash of the content.
"""

from __future__ import annotations

import contextlib
import json
import shutil
import tempfile
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from toolkit.errors import RenderError, ToolkitError
from toolkit.files import sha256_bytes, sha256_file
from toolkit.inputs import PDF_FILE, read_input
from toolkit.publication import publication
from toolkit.recording.marks import GENERATOR, refuse_original
from toolkit.report.content import Plot, ReportContent
from toolkit.report.drawer import Drawer
from toolkit.report.figures import Picture
from toolkit.report.word.chart import with_alternatives
from toolkit.report.word.fill import Survey, fill, survey
from toolkit.report.word.filled import Filled
from toolkit.report.word.office import Office
from toolkit.report.word.package import Template
from toolkit.report.word.toc_pages import Printed, print_copies
from toolkit.report.word.verify import Check, verify_docx, verify_pdf

Step = Callable[[str], None]
Writer = Callable[[Path], object]
Issue = Callable[[Path, Sequence[Path], int, str, Mapping[str, Any] | None], Mapping[str, Any]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """One report to make.

    Attributes
    ----------
    template, content : the safe template and the report's content
    out, name : output folder, made where it does not exist, and the name of the two files in it
    companions : files that are handed over with the two, suffix to content (``.xml``)
    extras : further files by name, each with a function that writes it to the path it is given
    issue : issues the PDF in place, given the files that are handed over with it, its pages, the hash of
        what it says and what its manifest says, and returns the ledger's proof; None for a document that is
        not issued
    provenance : what the manifest of the hand-over names besides the outputs; None for no manifest
    stage : staging folder of a publication in ``out`` that the caller ends; None: one of its own
    """

    template: Template
    content: ReportContent
    out: Path
    name: str = "report"
    companions: Mapping[str, bytes] = field(default_factory=dict)
    extras: Mapping[str, Writer] = field(default_factory=dict)
    provenance: Mapping[str, Any] | None = None
    issue: Issue | None = None
    stage: Path | None = None

    def names(self) -> list[str]:
        """Return the names of every file that the job hands over."""
        documents = [f"{self.name}{suffix}" for suffix in (".docx", ".pdf", *self.companions)]
        return [*documents, *self.extras, *([MANIFEST] if self.provenance is not None else [])]


@dataclass(frozen=True, slots=True, kw_only=True)
class Delivered:
    """A delivered report; ``content_sha256`` is the same for the same inputs, whatever the day or the run.

    ``units`` are those of forces and of moments as they are printed. ``signature`` is its line of signatures,
    ``ledger`` the proof of its entry; None where it was not issued.
    """

    docx: Path
    pdf: Path
    companions: tuple[Path, ...] = ()
    extras: tuple[Path, ...] = ()
    manifest: Path | None = None
    pages: int
    checks: tuple[Check, ...]
    filled: Filled
    template_sha256: str
    content_sha256: str
    units: tuple[str, str]
    signature: str
    ledger: Mapping[str, Any] | None = None
    untranslated: tuple[str, ...] = ()

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a person should look at although the report was delivered."""
        lines = [f"{finding.rule}: {finding.message}" for finding in self.filled.lint]
        lines += [f"{check.name}: {check.message}" for check in self.checks if not check.ok]
        lines += [f"missing-value: {tag} prints a visible mark" for tag in self.filled.missing]
        if self.untranslated:
            lines += [
                f"untranslated: {len(self.untranslated)} finding(s) are printed in English, first: "
                f"{self.untranslated[0]}"
            ]
        lines += [
            f"mark-added: the template has no place for the mark {name!r}" for name in self.filled.marks_added
        ]
        return tuple(lines)


def deliver(
    template: Template,
    content: ReportContent,
    out: Path,
    *,
    office: Office | None = None,
    drawer: Drawer | None = None,
    name: str = "report",
    keep: bool = False,
    companions: Mapping[str, bytes] | None = None,
    issue: Issue | None = None,
    stage: Path | None = None,
    step: Step = lambda _text: None,
) -> Delivered:
    """Fill, convert, verify and deliver ``<name>.docx`` and ``<name>.pdf`` (see `deliver_all` and `Job`).

    Raises
    ------
    TemplateError, RenderError, OutputError
        nothing is left in the output folder then
    """
    job = Job(
        template=template, content=content, out=out, name=name, companions=companions or {}, issue=issue,
        stage=stage,
    )  # fmt: skip
    reports = deliver_all([job], office=office, drawer=drawer, keep=keep, step=step)
    if isinstance(reports[0], ToolkitError):
        raise reports[0]
    return reports[0]


def deliver_all(
    jobs: Sequence[Job],
    *,
    office: Office | None = None,
    drawer: Drawer | None = None,
    allow_missing: bool = False,
    keep: bool = False,
    step: Step = lambda _text: None,
) -> list[Delivered | ToolkitError]:
    """Make several reports, converted together; return each report or why there is none.

    Parameters
    ----------
    office, drawer : LibreOffice and the figures' workers prepared by the caller; default: LibreOffice of
        its own, figures drawn here
    allow_missing : print a visible mark for a value that a test has not
    keep : on failure leave what was made in ``rejected/`` of the folder
    """
    office = office or Office()
    with office, contextlib.ExitStack() as stack:
        # In the office's own folder, which goes away even after a kill -9.
        work = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="print-", dir=office.folder)))
        runs = [_Run(job=job, keep=keep) for job in jobs]
        office.expect(len(jobs))
        for run in runs:
            stack.callback(run.close)
            run.attempt(run.open)
        step("figures")
        pictures = _pictures(runs, drawer)
        step("document")
        for index, run in enumerate(runs):
            run.attempt(partial(run.fill, _Own(index, pictures), allow_missing))
        filled = [run for run in runs if run.filled is not None]
        step("PDF")
        documents = [run.filled for run in filled if run.filled is not None]
        with ThreadPoolExecutor(1) as pool:
            # Workbooks and tire files are written while LibreOffice works in its own process.
            waiting = [(run, pool.submit(run.attempt, run.write_extras)) for run in filled]
            printed = print_copies(documents, office, work)
            for _, job in waiting:
                job.result()
        step("verification")
        for run, copy in zip(filled, printed, strict=True):
            run.attempt(partial(run.finish, copy))
        return [run.result() for run in runs]


class _Own(dict[str, "Picture"]):
    """The pictures of one report among those of all, looked up when they are asked for."""

    def __init__(self, index: int, pictures: Mapping[str, Picture]) -> None:
        super().__init__()
        self.index, self.pictures = index, pictures

    def __missing__(self, name: str) -> Picture:
        return self.pictures[f"{self.index}/{name}"]

    def __contains__(self, name: object) -> bool:
        return f"{self.index}/{name}" in self.pictures


def _pictures(runs: Sequence[_Run], drawer: Drawer | None) -> Mapping[str, Picture]:
    from toolkit.report.figures import draw

    plots: dict[str, Plot] = {}
    for index, run in enumerate(runs):
        if run.error is None:
            run.attempt(run.survey)
            figures = () if run.surveyed is None else run.surveyed.figures
            plots |= {f"{index}/{name}": run.job.content.plots[name] for name in figures}
    return drawer.pictures(plots) if drawer else {name: draw(plot) for name, plot in plots.items()}


class _Run:
    """A job under way: its staging folder, what was filled, and the error that ended it."""

    def __init__(self, *, job: Job, keep: bool) -> None:
        self.job, self.keep = job, keep
        self.publication = contextlib.ExitStack()
        self.stage: Path | None = None
        self.surveyed: Survey | None = None
        self.filled: Filled | None = None
        self.checks: list[Check] = []
        self.error: ToolkitError | None = None
        self.delivered: Delivered | None = None

    def attempt(self, work: Callable[[], None]) -> None:
        """Do one step; an error ends this job and leaves the others alone."""
        if self.error is not None:
            return
        try:
            work()
        except (OSError, ToolkitError) as error:
            self.filled = None
            try:
                with self.publication:  # takes the staging away, and tells of a disk that is to blame
                    if self.keep and isinstance(error, RenderError) and self.stage is not None:
                        _reject(self.stage, self.job.out, self.job.name, str(error))
                    raise
            except ToolkitError as told:
                self.error = told

    def open(self) -> None:
        job = self.job
        self.stage = job.stage or self.publication.enter_context(publication(job.out))
        for name in job.names():
            refuse_original(job.out / name, suffix=Path(name).suffix)

    def close(self) -> None:
        """Take the staging of a report away that was not finished."""
        stop = RenderError("the report was not finished")
        self.publication.__exit__(type(stop), stop, None)

    def survey(self) -> None:
        # A template that cannot be used is refused before a figure is drawn.
        self.surveyed = survey(self.job.template, self.job.content, fonts=True)

    def fill(self, pictures: Mapping[str, Picture], allow_missing: bool) -> None:
        job = self.job
        filled = fill(
            job.template, job.content, pictures, allow_missing=allow_missing, surveyed=self.surveyed
        )
        self._file(".docx").write_bytes(filled.docx)
        self.checks += verify_docx(filled)
        self.filled = filled

    def write_extras(self) -> None:
        for name, writer in self.job.extras.items():
            writer(self._stage() / name)

    def finish(self, copy: Printed | RenderError) -> None:
        if isinstance(copy, RenderError):
            raise copy
        if self.filled is None:
            return
        job, docx, pdf = self.job, self._file(".docx"), self._file(".pdf")
        self.filled = replace(self.filled, docx=copy.docx)
        docx.write_bytes(copy.docx)
        shutil.move(copy.pdf, pdf)
        if self.filled.charts:
            pdf.write_bytes(with_alternatives(read_input(pdf, PDF_FILE), self.filled.charts))
        checks, pages = verify_pdf(pdf, self.filled)
        self.checks += checks
        _demand(self.checks)
        for suffix, data in job.companions.items():
            self._file(suffix).write_bytes(data)
        digest, names = content_hash(self.filled, job.template), job.names()
        outputs = [self._stage() / name for name in names if name != MANIFEST]
        said: Mapping[str, Any] | None = None
        if job.provenance is not None:
            said = statements(
                job.provenance, job.content, job.template, digest, missing=self.filled.missing
            )  # fmt: skip
        ledger: Mapping[str, Any] | None = None
        if job.issue is not None:
            ledger = job.issue(pdf, [file for file in outputs if file != pdf], pages, digest, said)
        if said is not None:
            text = manifest_json(said, outputs, ledger)
            (self._stage() / MANIFEST).write_text(text, encoding="utf-8")
        self.publication.close()
        targets = [job.out / name for name in names]
        last = 2 + len(job.companions)
        self.delivered = Delivered(
            docx=targets[0],
            pdf=targets[1],
            companions=tuple(targets[2:last]),
            extras=tuple(targets[last : last + len(job.extras)]),
            manifest=targets[-1] if job.provenance is not None else None,
            pages=pages,
            checks=tuple(self.checks),
            filled=self.filled,
            template_sha256=job.template.sha256,
            content_sha256=digest,
            units=(job.content.style.force, job.content.style.moment),
            signature=job.content.signature,
            ledger=ledger,
            untranslated=job.content.untranslated,
        )

    def result(self) -> Delivered | ToolkitError:
        if self.delivered is not None:
            return self.delivered
        return self.error or RenderError("the report was not finished", where=self.job.out)

    def _stage(self) -> Path:
        if self.stage is None:
            raise RenderError("the report has no staging folder", where=self.job.out)
        return self.stage

    def _file(self, suffix: str) -> Path:
        return self._stage() / f"{self.job.name}{suffix}"


def _demand(checks: list[Check]) -> None:
    failed = [check for check in checks if not check.ok and not check.warning]
    if failed:
        raise RenderError(
            "the report was not verified and is not delivered",
            where="PDF",
            got="; ".join(f"{check.name}: {check.message}" for check in failed),
            expected="every value, figure and font of the report in its PDF",
            rule="not-verified",
            next_step="look at the rejected files with --keep and correct the template at that place",
        )


def _reject(stage: Path, out: Path, name: str, reason: str) -> None:
    with publication(out / "rejected") as rejected:
        for suffix in (".docx", ".pdf"):
            file = stage / f"{name}{suffix}"
            if file.is_file():
                file.replace(rejected / file.name)
        (rejected / "reason.txt").write_text(reason + "\n")


MANIFEST = "manifest.json"
_OF_THE_DAY = ("tk:report.date",)


def content_hash(filled: Filled, template: Template) -> str:
    """Return the SHA-256 of what a report says: every printed value, cell, figure, and the template.

    Neither a .docx nor a PDF is the same byte for byte twice, so the content is hashed. The day of issue
    is left out, and so is what a run took: the same inputs give the same hash on another day. (A row of a
    table with such a value is hashed by its other values, not as a row of cells.)
    """
    passing = {*_OF_THE_DAY, *filled.of_the_run}
    printed = {
        "template": template.sha256,
        "values": [
            [entry.tag, entry.text, entry.part] for entry in filled.manifest if entry.tag not in passing
        ],
        "cells": [row for at, row in enumerate(filled.cells) if at not in filled.rows_of_the_run],
        "figures": [[tag, alt] for tag, alt in filled.figures],
        "pictures": filled.pictures,
        "contents": [[entry.text, entry.level] for entry in filled.contents.entries],
    }
    return sha256_bytes(json.dumps(printed, ensure_ascii=False, separators=(",", ":")).encode())


def statements(
    provenance: Mapping[str, Any],
    content: ReportContent,
    template: Template,
    digest: str,
    *,
    missing: Sequence[str] = (),
) -> Mapping[str, Any]:
    """Return what a manifest says beside its files: calibration, inputs and software, each with its SHA-256.

    ``provenance`` holds what the caller knows, the inputs and the software; ``missing`` are the tags that
    print a mark in place of a value.
    """
    return {
        "generator": GENERATOR,
        "schema": 1,
        "report": content.identity,
        "issued": content.issued,
        "content_sha256": digest,
        "template": {"name": template.path.name, "sha256": template.sha256},
        "draft": bool(content.draft_reasons),
        "draft_reasons": list(content.draft_reasons),
        "signature": content.signature,
        "calibrations": [calibration.as_dict() for calibration in content.calibrations],
        "missing": list(missing),
        **provenance,
    }


def manifest_json(
    said: Mapping[str, Any], outputs: Sequence[Path], ledger: Mapping[str, Any] | None = None
) -> str:
    """Return the manifest: what it says, the files with their SHA-256, the proof of what was issued."""
    files = [
        {"name": output.name, "sha256": sha256_file(output), "bytes": output.stat().st_size}
        for output in outputs
    ]
    return json.dumps({**said, "outputs": files, "ledger": ledger}, ensure_ascii=False, indent=2) + "\n"
