"""A report of a test: its pages as they will print, the holes that nothing fills, and its issue."""

from __future__ import annotations

import threading
from pathlib import Path

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response

from toolkit.errors import ConfigError, ToolkitError
from toolkit.files import sha256_bytes
from toolkit.inputs import TEMPLATE_FILE, read_input
from toolkit.lab.desk.holdings import holding_id
from toolkit.lab.desk.jobs import start_job
from toolkit.lab.desk.previews import (
    preview_pdf,
    preview_words,
    read_preview,
    report_words,
    template_findings,
    template_pages,
    template_print,
    templates_of,
)
from toolkit.lab.desk.uploads import hand_in_template
from toolkit.lab.desk.versions import Origin, StaleError, version_of
from toolkit.lab.home import TEMPLATES
from toolkit.workbench.bench import Bench, holding
from toolkit.workbench.page import Routes, page
from toolkit.workbench.stale import new_page, stale

STEPS = ("preview", "issue")
_DRAWING = threading.Lock()  # a browser asks for all pages at once


def report(request: Request) -> Response:
    """Return the page: the templates to choose from, and a place for the preview."""
    bench, test_id, place_of = _requested(request)
    return page(
        request, "report", test_id=test_id, place_of=place_of, choices=templates_of(bench.home, "report"),
        people=bench.registry.people().history.now is not None,
    )  # fmt: skip


def part(request: Request) -> Response:
    """Return the preview that was made last, page by page, and the form that issues it."""
    bench, test_id, place_of = _requested(request)
    preview = read_preview(bench.home, test_id)
    names = {name: chosen for chosen, name in templates_of(bench.home).items()}
    used = None if preview is None else preview.manifest["template"]["name"]
    return page(
        request, "part_report", test_id=test_id, place_of=place_of, preview=preview, used=used,
        chosen=names.get(str(used)), people=bench.registry.people().history.now is not None,
    )  # fmt: skip


def picture(request: Request) -> Response:
    """Return a page of the preview as a picture."""
    from toolkit.report.word.preview import page_picture

    bench, test_id, _ = _requested(request)
    pdf = preview_pdf(bench.home, test_id)
    number = request.path_params["number"]
    if pdf is None or number < 1:
        raise HTTPException(404)
    with _DRAWING:
        return Response(page_picture(pdf, number), media_type="image/png")


def start(request: Request) -> Response:
    """Start the job that makes the preview, or that issues the report."""
    bench, test_id, place_of = _requested(request)
    step, form = request.path_params["step"], request.state.form
    template = templates_of(bench.home, "report").get(form.get("template", ""))
    if step not in STEPS or template is None:
        raise HTTPException(404)
    if step == "preview":
        job = start_job(
            bench.home, kind="preview", title=place_of, words=preview_words(place_of, template, test_id)
        )
    else:
        if bench.registry.people().history.now is not None:
            raise ConfigError(
                "people are enrolled here: a report is issued by their keys", where=place_of,
                got="an issue without a signature", expected="the command that the page shows",
                next_step="run it where the key is; nothing was issued", rule="not-signed",
            )  # fmt: skip
        words = report_words(place_of, template, allow_missing=form.get("holes") == "yes")
        job = start_job(bench.home, kind="report", title=place_of, words=words)
    return RedirectResponse(f"{bench.keys.place}/job/{job}", 303)


def templates(request: Request) -> Response:
    """Return the templates of the home, and a place for what is wrong with each."""
    return _templates(request)


def _templates(request: Request, *, status: int = 200, refused: ToolkitError | None = None) -> Response:
    bench: Bench = request.app.state.bench
    return page(
        request, "templates", status=status, choices=templates_of(bench.home), page_id=new_page(),
        version=version_of(bench.home / TEMPLATES),
        refused=None if refused is None else refused.as_dict(),
    )  # fmt: skip


def take(request: Request) -> Response:
    """Take a template from the browser; what `template check` says of it stands on its page."""
    bench: Bench = request.app.state.bench
    uploads = [(upload.name, upload.data) for upload in request.state.files.get("files", ())]
    folder, form = bench.home / TEMPLATES, request.state.form
    is_replaced = form.get("replace") == "yes"
    # What replaces nothing needs no version: another file of its name refuses it.
    origin = Origin.of(form if is_replaced else {"version": version_of(folder)})
    try:
        with bench.versions.changing(folder, origin):
            name = hand_in_template(bench.home, uploads, replace=is_replaced)
    except StaleError as error:
        typed = {name: data for name, data in uploads if (folder / name).is_file()}
        kept = {name: read_input(folder / name, TEMPLATE_FILE) for name in typed}
        return stale(
            request, error, look="templates", kept={name: _described(data) for name, data in kept.items()},
            typed={name: _described(data) for name, data in typed.items()},
        )  # fmt: skip
    except ToolkitError as error:
        return _templates(request, status=400, refused=error)
    return RedirectResponse(f"{bench.keys.place}/templates#{holding_id(f'{TEMPLATES}/{name}')}", 303)


def _described(data: bytes) -> str:
    return f"SHA-256 {sha256_bytes(data)}\n{len(data)} bytes"


def check(request: Request) -> Response:
    """Return what `template check` says of a template."""
    _, template = _template(request)
    return page(
        request, "part_template", template_id=request.path_params["template"],
        findings=template_findings(template),
    )  # fmt: skip


def template_sheets(request: Request) -> Response:
    """Return the pages of a template, with each finding at its place."""
    bench, template = _template(request)
    return page(
        request, "part_template_pages", template_id=request.path_params["template"],
        printed=template_pages(bench.home, template),
    )  # fmt: skip


def template_picture(request: Request) -> Response:
    """Return a page of a template as a picture."""
    from toolkit.report.word.preview import page_picture

    bench, template = _template(request)
    with _DRAWING:
        picture = page_picture(template_print(bench.home, template), max(1, request.path_params["number"]))
    return Response(picture, media_type="image/png")


def _template(request: Request) -> tuple[Bench, Path]:
    bench: Bench = request.app.state.bench
    name = templates_of(bench.home).get(request.path_params["template"])
    if name is None:
        raise HTTPException(404)
    return bench, bench.home / TEMPLATES / name


def _requested(request: Request) -> tuple[Bench, str, str]:
    bench, test_id, _ = holding(request, "test")
    return bench, test_id, bench.holdings().places["test"][test_id]


ROUTES: Routes = (
    ("GET", "/test/{test}/report", report),
    ("GET", "/test/{test}/report/part", part),
    ("GET", "/test/{test}/report/page/{number:int}.png", picture),
    ("POST", "/test/{test}/report/{step}", start),
    ("GET", "/templates", templates),
    ("POST", "/templates", take),
    ("GET", "/template/{template}/check", check),
    ("GET", "/template/{template}/pages", template_sheets),
    ("GET", "/template/{template}/page/{number:int}.png", template_picture),
)
