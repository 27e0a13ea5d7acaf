"""A calibration session: typed or dropped, tried while it is typed, then entered.

What is tried is what `calibrate --dry-run` tries, in a copy of the instrument's registry; its parts are those
of a record's page, asked of that copy.
"""

from __future__ import annotations

import datetime as dt
from typing import TYPE_CHECKING, Any

from starlette.exceptions import HTTPException
from starlette.responses import RedirectResponse, Response

from toolkit.calibration.session.session_file import SessionFile
from toolkit.days import parse_day
from toolkit.errors import ConfigError, ToolkitError
from toolkit.lab.desk import drafts
from toolkit.lab.desk.pending import decide
from toolkit.lab.desk.statements import statement_groups, with_statement
from toolkit.lab.records.decisions import Order
from toolkit.trust.requested import Requested
from toolkit.workbench.bench import Bench, waiting
from toolkit.workbench.page import fragment, page
from toolkit.workbench.record_page import PARTS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from starlette.requests import Request

    from toolkit.workbench.page import Routes


def sessions(request: Request) -> Response:
    """Return the sessions that are being typed, and the forms that begin one."""
    return _sessions(request)


def _sessions(
    request: Request,
    *,
    status: int = 200,
    refused: ToolkitError | None = None,
    typed: Mapping[str, str] | None = None,
) -> Response:
    bench: Bench = request.app.state.bench
    return page(
        request, "sessions", status=status, drafts=drafts.drafts(bench.home), typed=typed or {},
        instruments=bench.registry.instruments(), today=bench.today.isoformat(),
        refused=None if refused is None else refused.as_dict(),
    )  # fmt: skip


def begin(request: Request) -> Response:
    """Begin a session: from files, from the last session of an instrument, or from its columns."""
    bench: Bench = request.app.state.bench
    form = {name: value.strip() for name, value in request.state.form.items()}
    try:
        session, tables = _begun(bench, request.state.files, form)
        draft_id = drafts.begin_draft(bench.home, session, tables)
    except ToolkitError as error:
        return _sessions(request, status=400, refused=error, typed=form)
    return _to(bench, f"session/{draft_id}")


def _begun(bench: Bench, files: Mapping[str, Any], form: Mapping[str, str]) -> tuple[str, dict[str, bytes]]:
    if form.get("from") == "files":
        uploads = [(upload.name, upload.data) for upload in files.get("files", ())]
        session, tables = drafts.dropped_files(uploads)
        if session is None:
            raise _unstated(
                "files", ", ".join(name for name, _ in uploads) or "no file", "SESSION.toml among them"
            )
        return session, tables
    for key in ("instrument", "operator"):
        if not form.get(key):
            raise _unstated(key, "nothing", "a name")
    day, operator = _day(form.get("date", "")), form["operator"]
    if form["instrument"] in bench.registry.instruments() and not form.get("indications"):
        session, header = drafts.next_session(bench.registry, form["instrument"], day=day, operator=operator)
    else:
        session, header = drafts.new_session(
            instrument=form["instrument"], indications=form.get("indications", ""),
            loads=form.get("loads", ""), day=day, operator=operator,
        )  # fmt: skip
    return session, {drafts.GRIDS["data"]: header.encode()}


def session(request: Request) -> Response:
    """Return a draft: its statements, its tables, and a place for what a dry run says."""
    _, draft_id = _requested(request)
    return session_page(request, draft_id)


def session_page(
    request: Request, draft_id: str, *, status: int = 200, refused: ToolkitError | None = None
) -> Response:
    """Return the page of a draft; ``refused`` is told at its end."""
    bench: Bench = request.app.state.bench
    return page(
        request, "session", status=status, draft=(draft := drafts.open_draft(bench.home, draft_id)),
        groups=statement_groups(draft.session, SessionFile), oob=False,
        people=bench.registry.people().history.now is not None,
        refused=None if refused is None else refused.as_dict(), **waiting(bench, draft_id),
    )  # fmt: skip


def save(request: Request) -> Response:
    """Save what was typed, and say nothing."""
    bench, draft_id = _requested(request)
    _save(bench, draft_id, request.state.form)
    return Response(status_code=204)


def state(request: Request) -> Response:
    """Save what was typed with one statement as its field has it; return the text of the statements."""
    bench, draft_id = _requested(request)
    form = dict(request.state.form)
    if waiting(bench, draft_id)["pending"] is None:
        form["session"] = with_statement(
            form.get("session", "").replace("\r\n", "\n"),
            SessionFile,
            form.get("key", ""),
            form.get("value", ""),
        )
        _save(bench, draft_id, form)
    answer = page(
        request, "part_statement_text", draft=drafts.open_draft(bench.home, draft_id), pending=None
    )  # fmt: skip
    answer.headers["hx-trigger"] = "stated"
    return answer


def rehearse(request: Request) -> Response:
    """Save what was typed and try it: what `calibrate --dry-run` says, and every part of a record's page."""
    from toolkit.calibration.control.calibrate import rehearsed
    from toolkit.calibration.records.use import UNSIGNED
    from toolkit.lab.records.session_answer import NOT_ENTERED, candidate_payload
    from toolkit.lab.signatures.sealing import standards_of

    bench, draft_id = _requested(request)
    if request.headers.get("hx-request") != "true":
        _save(bench, draft_id, request.state.form)
        return _to(bench, f"session/{draft_id}")
    before = drafts.open_draft(bench.home, draft_id).session
    try:
        _save(bench, draft_id, request.state.form)
        path = drafts.session_file(bench.home, draft_id)
        with rehearsed(path, bench.registry, standards=standards_of(bench.home)) as (copy, candidate):
            state = copy.status(candidate.record.id).state if candidate.existing else NOT_ENTERED
            signature = UNSIGNED if state == NOT_ENTERED else copy.signature(candidate.record.id)
            payload = candidate_payload(candidate, state, signature)
            inner = Bench(bench.home, copy, bench.keys)
            parts = {name: _part(request, inner, name, candidate.record.id) for name in PARTS}
    except ToolkitError as error:
        draft = drafts.open_draft(bench.home, draft_id)
        return page(
            request, "part_untried", error=error.as_dict(), faults=drafts.faults_of(error, draft),
            statements=_restated(request, draft, before),
        )  # fmt: skip
    statements = _restated(request, drafts.open_draft(bench.home, draft_id), before)
    return page(request, "part_rehearsal", answer=payload, parts=parts, statements=statements)


def _restated(request: Request, draft: drafts.Draft, before: str) -> str:
    """Return the fields anew where somebody changed the text of the statements itself."""
    if draft.session == before:
        return ""
    return fragment(
        request, "part_statements", draft=draft, groups=statement_groups(draft.session, SessionFile),
        oob=True, pending=None,
    )  # fmt: skip


def _part(request: Request, bench: Bench, name: str, record_id: str) -> str:
    """Return a part of the page; one that cannot be computed says why, and keeps none of the others."""
    try:
        return fragment(request, f"part_{name}", record_id=record_id, **PARTS[name](bench, record_id))
    except ToolkitError as error:
        return fragment(request, "part_error", error=error.as_dict())


def add_files(request: Request) -> Response:
    """Put files beside the session, or in its place."""
    bench, draft_id = _requested(request)
    uploads = [(upload.name, upload.data) for upload in request.state.files.get("files", ())]
    try:
        drafts.add_files(bench.home, draft_id, uploads)
    except ToolkitError as error:
        return session_page(request, draft_id, status=400, refused=error)
    return _to(bench, f"session/{draft_id}")


def enter(request: Request) -> Response:
    """Enter the session as `calibrate` does; where people are enrolled request it."""
    bench, draft_id = _requested(request)
    try:
        _save(bench, draft_id, request.state.form)
        order = Order(action="enter", session=drafts.session_file(bench.home, draft_id))
        candidate = decide(bench.home, bench.registry, draft_id, order)
    except Requested:
        return _to(bench, f"session/{draft_id}#decision")
    except ToolkitError as error:
        return session_page(request, draft_id, status=400, refused=error)
    drafts.keep_session(bench.home, draft_id, candidate.record.id)
    return _to(bench, f"record/{candidate.record.id}")


def discard(request: Request) -> Response:
    """Remove a draft that nobody entered."""
    bench, draft_id = _requested(request)
    if waiting(bench, draft_id)["pending"] is not None:
        error = ConfigError(
            "its entry waits for signatures", where=draft_id, got="a draft that was requested",
            expected="a draft that nobody is asked to sign",
            next_step="drop the request first; nothing was removed", rule="request",
        )  # fmt: skip
        return session_page(request, draft_id, status=400, refused=error)
    drafts.drop_draft(bench.home, draft_id)
    return _to(bench, "session")


def _save(bench: Bench, draft_id: str, form: Mapping[str, str]) -> None:
    if waiting(bench, draft_id)["pending"] is not None:
        return  # what is signed must stay what was requested
    if "session" in form:
        grids = {key: form[key] for key in drafts.GRIDS if key in form}
        drafts.save_draft(bench.home, draft_id, form["session"], grids)


def _requested(request: Request) -> tuple[Bench, str]:
    bench: Bench = request.app.state.bench
    draft_id = request.path_params["draft"]
    if draft_id not in drafts.draft_ids(bench.home):
        raise HTTPException(404)
    return bench, draft_id


def _to(bench: Bench, place: str) -> Response:
    return RedirectResponse(f"{bench.keys.place}/{place}", 303)


def _day(text: str) -> dt.date:
    try:
        return parse_day(text)
    except ValueError as error:
        raise _unstated("date", text or "nothing", "YYYY-MM-DD") from error


def _unstated(where: str, got: str, expected: str) -> ConfigError:
    return ConfigError(
        "a session cannot begin like this", where=where, got=got, expected=expected,
        next_step="state it; nothing was written", rule="usage",
    )  # fmt: skip


ROUTES: Routes = (
    ("GET", "/session", sessions),
    ("POST", "/session", begin),
    ("GET", "/session/{draft}", session),
    ("POST", "/session/{draft}/save", save),
    ("POST", "/session/{draft}/state", state),
    ("POST", "/session/{draft}/rehearse", rehearse),
    ("POST", "/session/{draft}/files", add_files),
    ("POST", "/session/{draft}/enter", enter),
    ("POST", "/session/{draft}/discard", discard),
)
