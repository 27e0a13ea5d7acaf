"""A case that is put together in the browser: recordings, a kind of simulation, and its statements as fields.

Its code reads what the server's user reads: like a case that is handed in, it comes from this computer alone.
"""

from __future__ import annotations

import threading
from pathlib import Path
from urllib.parse import quote

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response

from toolkit.diagnosis.case.reader import CaseFile
from toolkit.errors import ToolkitError
from toolkit.lab.desk import built_case
from toolkit.lab.desk.holdings import CASE, holding_id
from toolkit.lab.desk.statements import with_statement
from toolkit.lab.desk.versions import Origin, StaleError, version_of
from toolkit.workbench.bench import Bench, holding
from toolkit.workbench.diagnosis_page import diagnoses_page
from toolkit.workbench.page import Routes, is_part, page
from toolkit.workbench.stale import new_page, stale

_ANSWERING = threading.Lock()  # one simulation at a time


def begin(request: Request) -> Response:
    """Begin a case from recordings and a kind of simulation."""
    bench: Bench = request.app.state.bench
    if not bench.is_own:
        raise HTTPException(404)
    recordings, own_files = (
        [(upload.name, upload.data) for upload in request.state.files.get(field, ())]
        for field in ("recordings", "own")
    )
    try:
        place_of = built_case.begin_case(
            bench.home, request.state.form.get("kind", ""), recordings, own_files
        )
    except ToolkitError as error:
        return diagnoses_page(request, status=400, refused=error)
    bench.holdings(again=True)
    return _to(bench, holding_id(place_of))


def case(request: Request) -> Response:
    """Return the page: the statements of the case, its files, and a place for what its simulation says."""
    return _case(request)


def _case(request: Request, *, status: int = 200, refused: ToolkitError | None = None) -> Response:
    bench, case_id, folder = _requested(request)
    return page(
        request, "case", status=status, case_id=case_id, built=built_case.open_case(folder),
        place_of=bench.holdings().places["case"][case_id], version=version_of(folder), page_id=new_page(),
        refused=None if refused is None else refused.as_dict(),
    )  # fmt: skip


def state(request: Request) -> Response:
    """Keep a statement as its field has it; say nothing but that it is kept, and as which version."""
    bench, case_id, folder = _requested(request)
    form = request.state.form
    key, typed = form.get("key", ""), form.get("value", "")
    try:
        with bench.versions.changing(folder, Origin.of(form)):
            is_other = built_case.state_entry(folder, key, typed)
    except StaleError as error:
        kept = built_case.open_case(folder).text
        return stale(
            request, error, kept={CASE: kept}, typed={CASE: with_statement(kept, CaseFile, key, typed)},
            look=f"case/{case_id}", again=f"case/{case_id}/state",
            hidden={"key": key, "value": typed, "version": version_of(folder)},
        )  # fmt: skip
    if not is_part(request):
        return _to(bench, case_id)
    answer = page(request, "part_version", version=version_of(folder))
    answer.headers["hx-refresh" if is_other else "hx-trigger"] = "true" if is_other else "stated"
    return answer


def change(request: Request) -> Response:
    """Add a channel, a run or a parameter, leave one out, or put files beside the case."""
    bench, case_id, folder = _requested(request)
    form = request.state.form
    try:
        with bench.versions.changing(folder, Origin.of(form)):
            _change(request, folder)
    except StaleError as error:
        return stale(request, error, look=f"case/{case_id}")
    except ToolkitError as error:
        return _case(request, status=400, refused=error)
    return _to(bench, case_id, form.get("table", ""))


def _change(request: Request, folder: Path) -> None:
    form = request.state.form
    match request.path_params["step"]:
        case "add":
            built_case.add_entry(folder, form.get("table", ""), form.get("name", ""))
        case "drop":
            built_case.drop_entry(folder, form.get("table", ""))
        case "files":
            uploads = request.state.files.get("files", ())
            built_case.add_files(folder, [(upload.name, upload.data) for upload in uploads])
        case _:
            raise HTTPException(404)


def trial(request: Request) -> Response:
    """Return what the simulation says as it is declared, beside the recordings."""
    bench, _, folder = _requested(request)
    with _ANSWERING:
        answer = built_case.trial_of(folder, bench.home)
    return page(request, "part_trial", answer=answer)


def _requested(request: Request) -> tuple[Bench, str, Path]:
    bench, case_id, folder = holding(request, "case")
    if not bench.is_own or not built_case.is_open(bench.home, bench.holdings().places["case"][case_id]):
        raise HTTPException(404)
    return bench, case_id, folder


def _to(bench: Bench, case_id: str, table: str = "") -> Response:
    return RedirectResponse(f"{bench.keys.place}/case/{case_id}#{quote(table)}", 303)


ROUTES: Routes = (
    ("POST", "/case", begin),
    ("GET", "/case/{case}", case),
    ("POST", "/case/{case}/state", state),
    ("POST", "/case/{case}/trial", trial),
    ("POST", "/case/{case}/change/{step}", change),
)
