"""Long work: what runs and what ran, its progress, its log, its end when somebody asks for it."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from starlette.exceptions import HTTPException
from starlette.responses import RedirectResponse, Response

from toolkit.errors import ConfigError
from toolkit.lab.desk.holdings import archives_of, holding_id
from toolkit.lab.desk.jobs import Kind as JobKind
from toolkit.lab.desk.jobs import SeenJob, cancel_job, job_of, jobs_of, log_of, start_job
from toolkit.workbench.page import Routes, page

if TYPE_CHECKING:
    from starlette.requests import Request

    from toolkit.workbench.bench import Bench

MOST_JOBS = 100
AUDITS, REPAIRED = "audits", "repaired"
"""Folders of the home into which jobs write."""


def jobs(request: Request) -> Response:
    """Return the jobs of the home, the newest first, and what can be started."""
    bench: Bench = request.app.state.bench
    works = [job for _, job in zip(range(MOST_JOBS), jobs_of(bench.home), strict=False)]
    return page(request, "jobs", jobs=works, archives=archives_of(bench.home))


def job(request: Request) -> Response:
    """Return a job's page."""
    return _shown(request, "job")


def state(request: Request) -> Response:
    """Return a job as it stands now: its page asks for this while it runs."""
    return _shown(request, "part_job")


def _shown(request: Request, template: str) -> Response:
    bench, work = _requested(request)
    return page(request, template, seen=work, result=_result(bench, work), log=log_of(bench.home, work.id))


def cancel(request: Request) -> Response:
    """Ask for the end of a job."""
    bench, work = _requested(request)
    cancel_job(bench.home, work.id)
    return _to_job(bench, work.id)


def start_audit(request: Request) -> Response:
    """Start the audit of a folder of the home; one that was ended before goes on."""
    bench: Bench = request.app.state.bench
    archive = archives_of(bench.home).get(request.state.form.get("archive", ""))
    if archive is None:
        raise HTTPException(404)
    words = ("audit", f"./{archive}", "--out", f"{AUDITS}/{archive}", "--home", ".")
    return _started(bench, "audit", archive, words)


def start_repair(request: Request) -> Response:
    """Start the writing of corrected copies of an audited archive, by somebody who agreed to it."""
    bench: Bench = request.app.state.bench
    audit_id = request.path_params["audit"]
    audited = bench.audited(audit_id)
    if audited is None:
        raise HTTPException(404)
    place = bench.holdings().places["audit"][audit_id]
    if request.state.form.get("consent") != "yes":
        raise ConfigError(
            "nobody agreed to the corrected copies", where=place, got="no consent",
            expected="the box of the form, ticked", next_step="tick it; nothing was written", rule="usage",
        )  # fmt: skip
    if audited.archive is None:
        raise ConfigError(
            "the answer does not say where its archive is", where=place, got="an answer of an older version",
            expected="an answer of this version", next_step="run the audit again", rule="archive",
        )  # fmt: skip
    words = (
        "audit", str(audited.archive), "--out", f"./{place}", "--known-at", audited.known_at.isoformat(),
        "--repair", f"{REPAIRED}/{os.path.basename(place)}", "--home", ".",  # noqa: PTH119  a text, not a path
    )  # fmt: skip
    return _started(bench, "repair", place, words)


def _started(bench: Bench, kind: JobKind, title: str, words: tuple[str, ...]) -> Response:
    return _to_job(bench, start_job(bench.home, kind=kind, title=title, words=words))


def _to_job(bench: Bench, job_id: str) -> Response:
    return RedirectResponse(f"{bench.keys.place}/job/{job_id}", 303)


def _result(bench: Bench, work: SeenJob) -> str | None:
    """Return the address of what a job wrote, below the place; None where there is none yet."""
    words = work.job.words
    if work.state == "running":
        return None
    if work.job.kind in ("audit", "repair") and "--out" in words[:-1]:
        holding = holding_id(os.path.normpath(words[words.index("--out") + 1]))
        return f"/audit/{holding}" if bench.path_of("audit", holding) is not None else None
    if work.job.kind in ("preview", "report"):
        holding = holding_id(work.job.title)
        return f"/test/{holding}/report" if bench.path_of("test", holding) is not None else None
    if work.job.kind == "diagnosis" and "--out" in words[:-1]:
        holding = holding_id(os.path.normpath(words[words.index("--out") + 1]))
        return f"/diagnosis/{holding}" if bench.path_of("diagnosis", holding) is not None else None
    if work.job.kind == "plan" and "--out" in words[:-1]:
        holding = holding_id(os.path.normpath(words[words.index("--out") + 1]))
        return f"/plan/{holding}" if bench.path_of("plan", holding) is not None else None
    return None


def _requested(request: Request) -> tuple[Bench, SeenJob]:
    bench: Bench = request.app.state.bench
    work = job_of(bench.home, request.path_params["job"])
    if work is None:
        raise HTTPException(404)
    return bench, work


ROUTES: Routes = (
    ("POST", "/audit/{audit}/repair", start_repair),
    ("GET", "/jobs", jobs),
    ("POST", "/jobs/audit", start_audit),
    ("GET", "/job/{job}", job),
    ("GET", "/job/{job}/state", state),
    ("POST", "/job/{job}/cancel", cancel),
)
