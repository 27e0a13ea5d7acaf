"""A calibration session: typed or dropped, tried while it is typed, then entered.

What is tried is what `calibrate --dry-run` tries, in a copy of the instrument's registry; its parts are those
of a record's page, asked of that copy.
"""

from __future__ import annotations

import contextlib
import datetime as dt
import json
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, RedirectResponse, Response

from toolkit.calibration.session.session_file import SessionFile
from toolkit.days import parse_day
from toolkit.errors import ConfigError, ToolkitError
from toolkit.lab.desk import drafts
from toolkit.lab.desk.pending import decide
from toolkit.lab.desk.statements import statement_groups, with_statement
from toolkit.lab.desk.tried_drafts import copied_draft
from toolkit.lab.desk.versions import Origin, StaleError
from toolkit.lab.records.decisions import Order
from toolkit.trust.requested import Requested
from toolkit.workbench.bench import Bench, waiting
from toolkit.workbench.page import Instead, Routes, fragment, is_part, page
from toolkit.workbench.record_page import PARTS
from toolkit.workbench.stale import new_page, stale


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
    drafts.check_statements(session, bench.today)
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
        groups=statement_groups(draft.session, SessionFile), page_id=new_page(),
        faults=drafts.statement_faults(draft.session, bench.today),
        people=bench.registry.people().history.now is not None,
        refused=None if refused is None else refused.as_dict(), **waiting(bench, draft_id),
    )  # fmt: skip


def save(request: Request) -> Response:
    """Keep what was typed, if it was made from the version that is kept; say which version it is now.

    ``statements`` are entries as their fields have them, each a key and a text, set in the typed text.
    """
    bench, draft_id = _requested(request)
    form = request.state.form
    before = drafts.open_draft(bench.home, draft_id)
    try:
        with bench.versions.changing(_folder(bench, draft_id), Origin.of(form)) as is_newest:
            if is_newest:
                _save(bench, draft_id, form)
    except StaleError as error:
        return _stale(request, draft_id, error)
    draft = drafts.open_draft(bench.home, draft_id)
    if not is_part(request):
        return _to(bench, f"session/{draft_id}")
    fields = "" if draft.session == _stated(form, before.session) else fragment(
        request, "part_statements", draft=draft, groups=statement_groups(draft.session, SessionFile),
        pending=None,
    )  # fmt: skip
    return JSONResponse({
        "version": draft.version, "session": draft.session, "fields": fields,
        "faults": drafts.statement_faults(draft.session, bench.today),
    })  # fmt: skip


def rehearse(request: Request) -> Response:
    """Try a draft as it is kept: what `calibrate --dry-run` says, and every part of a record's page.

    Nothing of the form is read and nothing of the draft is written: a copy is tried, of the version that the
    answer names.
    """
    from toolkit.calibration.control.calibrate import rehearsed
    from toolkit.calibration.records.use import UNSIGNED
    from toolkit.lab.records.session_answer import NOT_ENTERED, candidate_payload
    from toolkit.lab.signatures.sealing import standards_of

    bench, draft_id = _requested(request)
    with ExitStack() as stack:
        with bench.versions.held(_folder(bench, draft_id)):
            draft = drafts.open_draft(bench.home, draft_id)
            path = stack.enter_context(copied_draft(bench.home, draft_id))
        try:
            with rehearsed(path, bench.registry, standards=standards_of(bench.home)) as (copy, candidate):
                state = copy.status(candidate.record.id).state if candidate.existing else NOT_ENTERED
                signature = UNSIGNED if state == NOT_ENTERED else copy.signature(candidate.record.id)
                payload = candidate_payload(candidate, state, signature)
                inner = Bench(bench.home, copy, bench.keys)
                parts = {name: _part(request, inner, name, candidate.record.id) for name in PARTS}
        except ToolkitError as error:
            drafts.as_of_draft(error, path, bench.home, draft_id)
            return page(
                request, "part_untried", error=error.as_dict(), faults=drafts.faults_of(error, draft),
                version=draft.version,
            )  # fmt: skip
    return page(request, "part_rehearsal", answer=payload, parts=parts, version=draft.version)


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
        with bench.versions.changing(_folder(bench, draft_id), Origin.of(request.state.form)):
            drafts.add_files(bench.home, draft_id, uploads)
    except StaleError as error:
        return _stale(request, draft_id, error)
    except ToolkitError as error:
        return session_page(request, draft_id, status=400, refused=error)
    return _to(bench, f"session/{draft_id}")


def enter(request: Request) -> Response:
    """Enter the session as `calibrate` does; where people are enrolled request it."""
    bench, draft_id = _requested(request)
    try:
        with bench.versions.changing(_folder(bench, draft_id), Origin.of(request.state.form)):
            _save(bench, draft_id, request.state.form)
            order = Order(action="enter", session=drafts.session_file(bench.home, draft_id))
            candidate = decide(bench.home, bench.registry, draft_id, order)
            drafts.keep_session(bench.home, draft_id, candidate.record.id)
    except Requested:
        return _to(bench, f"session/{draft_id}#decision")
    except StaleError as error:
        return _stale(request, draft_id, error)
    except ToolkitError as error:
        return session_page(request, draft_id, status=400, refused=error)
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
    try:
        with bench.versions.changing(_folder(bench, draft_id), Origin.of(request.state.form)):
            drafts.drop_draft(bench.home, draft_id)
    except StaleError as error:
        return _stale(request, draft_id, error)
    return _to(bench, "session")


def _save(bench: Bench, draft_id: str, form: Mapping[str, str]) -> None:
    if waiting(bench, draft_id)["pending"] is not None:
        return  # what is signed must stay what was requested
    if "session" in form:
        grids = {key: form[key] for key in drafts.GRIDS if key in form}
        drafts.save_draft(bench.home, draft_id, _stated(form, form["session"]), grids)


def _stated(form: Mapping[str, str], text: str) -> str:
    """Return a text of the statements with the entries of the fields that were changed."""
    text = text.replace("\r\n", "\n")
    for key, typed in _statements(form):
        text = with_statement(text, SessionFile, key, typed)
    return text


def _statements(form: Mapping[str, str]) -> list[tuple[str, str]]:
    try:
        return [(str(key), str(typed)) for key, typed in json.loads(form.get("statements") or "[]")]
    except (ValueError, TypeError) as error:
        raise ConfigError(
            "the changed fields cannot be read", where="statements", got=form.get("statements"),
            expected="a list of keys with their texts", next_step="load the page again; nothing was written",
            rule="usage",
        ) from error  # fmt: skip


def _stale(request: Request, draft_id: str, error: StaleError) -> Response:
    """Return both texts of a change that was made from an older version; nothing of either is lost."""
    bench, _ = _requested(request)
    form = request.state.form
    kept = drafts.open_draft(bench.home, draft_id)
    typed = kept.texts | {kept.names[key]: form[key] for key in drafts.GRIDS if form.get(key)}
    if "session" in form:
        with contextlib.suppress(ToolkitError):
            typed[drafts.SESSION] = _stated(form, form["session"])
    hidden = {key: form[key] for key in ("session", *drafts.GRIDS, "statements") if key in form}
    return stale(
        request, error, kept=kept.texts, typed=typed, again=f"session/{draft_id}/save",
        look=f"session/{draft_id}", hidden=hidden | {"version": kept.version},
    )  # fmt: skip


def _folder(bench: Bench, draft_id: str) -> Path:
    return drafts.session_file(bench.home, draft_id).parent


def _requested(request: Request) -> tuple[Bench, str]:
    bench: Bench = request.app.state.bench
    draft_id = request.path_params["draft"]
    if draft_id not in drafts.draft_ids(bench.home):
        ended = drafts.ended_draft(bench.home, draft_id)
        if ended is None:
            raise HTTPException(404)
        raise Instead(_told_the_end(request, draft_id, ended))
    return bench, draft_id


def _told_the_end(request: Request, draft_id: str, ended: drafts.Ended) -> Response:
    """Return what became of a draft that is no longer there, with what was typed and not kept."""
    form = getattr(request.state, "form", {})
    typed = {key: form[key] for key in ("session", *drafts.GRIDS) if form.get(key)}
    return page(
        request, "part_ended" if is_part(request) else "ended", status=410, draft_id=draft_id, ended=ended,
        typed={} if is_part(request) else typed,
    )  # fmt: skip


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
    ("POST", "/session/{draft}/rehearse", rehearse),
    ("POST", "/session/{draft}/files", add_files),
    ("POST", "/session/{draft}/enter", enter),
    ("POST", "/session/{draft}/discard", discard),
)
