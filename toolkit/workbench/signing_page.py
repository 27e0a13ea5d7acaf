"""What waits for signatures: its file, the answers that come back, the SSH agent of this computer's user.

No key comes here. A signature is made where its key is, by `toolkit sign` or by an SSH agent; the agent is
that of whoever runs the server, and signs only where nobody else reaches the server.
"""

from __future__ import annotations

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response

from toolkit.calibration.registry.registry import ID
from toolkit.errors import ConfigError, ToolkitError
from toolkit.lab.desk.pending import Pending, add_answer, drop_request, pending_request, sign_by_agent
from toolkit.workbench.bench import Bench, waiting
from toolkit.workbench.page import Routes, as_file
from toolkit.workbench.record_page import record_page
from toolkit.workbench.session_page import session_page


def request_file(request: Request) -> Response:
    """Return the file of a request, as `--request` writes it."""
    _, pending = _waiting(request)
    return as_file(pending.request.text, "application/json", f"{pending.id}.request.json")


def answered(request: Request) -> Response:
    """Take the file that `toolkit sign` wrote."""
    bench, pending = _waiting(request)
    uploads = request.state.files.get("answer", ())
    try:
        if len(uploads) != 1:
            raise ConfigError(
                "no answer was chosen", where="answer", got=f"{len(uploads)} files",
                expected="the file that toolkit sign wrote", next_step="choose it; nothing was changed",
                rule="usage",
            )  # fmt: skip
        entered = add_answer(bench.home, bench.registry, pending.id, uploads[0].data, uploads[0].name)
    except ToolkitError as error:
        return _refused(request, pending, error)
    return _onward(bench, pending, entered=entered)


def agent_signed(request: Request) -> Response:
    """Let the agent sign by the key of the person who was chosen."""
    bench, pending = _waiting(request)
    try:
        if not bench.is_own:
            raise ConfigError(
                "the agent of the server's user signs for that user alone", where="SSH agent",
                got="a workbench that other computers reach", expected="the answer of toolkit sign",
                next_step="sign the request's file on your own computer; nothing was signed",
                rule="signing-key",
            )  # fmt: skip
        person = request.state.form.get("person", "")
        entered = sign_by_agent(bench.home, bench.registry, pending.id, person)
    except ToolkitError as error:
        return _refused(request, pending, error)
    return _onward(bench, pending, entered=entered)


def dropped(request: Request) -> Response:
    """Drop a request; also one whose file is damaged."""
    bench: Bench = request.app.state.bench
    name = request.path_params["request"]
    state = waiting(bench, name)
    if state["pending"] is None and state["unreadable"] is None:
        raise HTTPException(404)
    drop_request(bench.home, name)
    return RedirectResponse(f"{bench.keys.place}/{_home_of(name)}", 303)


def _waiting(request: Request) -> tuple[Bench, Pending]:
    bench: Bench = request.app.state.bench
    pending = pending_request(bench.home, bench.registry, request.path_params["request"])
    if pending is None:
        raise HTTPException(404)
    return bench, pending


def _onward(bench: Bench, pending: Pending, *, entered: bool) -> Response:
    place = f"record/{pending.request.body['id']}" if entered else _home_of(pending.id)
    return RedirectResponse(f"{bench.keys.place}/{place}", 303)


def _refused(request: Request, pending: Pending, error: ToolkitError) -> Response:
    refused = session_page if _home_of(pending.id).startswith("session") else record_page
    return refused(request, pending.id, status=400, refused=error)


def _home_of(name: str) -> str:
    """Return the page on which a request waits: that of a record, or of the draft of a session."""
    return f"record/{name}" if ID.match(name) else f"session/{name}"


ROUTES: Routes = (
    ("GET", "/request/{request}", request_file),
    ("POST", "/request/{request}/answer", answered),
    ("POST", "/request/{request}/sign", agent_signed),
    ("POST", "/request/{request}/drop", dropped),
)
