"""The gate of the workbench: every request passes it before any page is asked.

A server on the loopback interface is reached by every page that the person's browser has open, and by every
other user of the computer. What keeps them out:

- the **Host** of a request is the address that was printed: a name that was made to lead here is refused;
- a **place**, a random first part of every path. Cookies do not know ports: without it the cookie would go to
  whatever else listens on this computer;
- a **key** in the address that was printed, exchanged for a cookie that no script reads (``HttpOnly``) and
  that the browser sends from our own pages alone (``SameSite=Strict``);
- what changes something needs the **Origin** of our pages and the **form key** that stands in them.

A handler sees a form only as ``request.state.form``, its files as ``request.state.files``, after these
checks: none can be forgotten.
"""

from __future__ import annotations

import secrets
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from hmac import compare_digest
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import HTMLResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from toolkit.errors import ConfigError
from toolkit.workbench.forms import FILES_TYPE, FORM_TYPE, read_form
from toolkit.workbench.page import bare_page

LARGEST_FORM = 4 << 20
"""Bytes of a form: names, a reason, the rows of a session that somebody types."""
LARGEST_UPLOAD = 32 << 20
"""Bytes of a form with files, all in memory; each file is held against the limit of its own form as well."""

ENTRANCE = "/open"
COOKIE = "toolkit"
HEADERS: Mapping[str, str] = {
    "content-security-policy": "; ".join((
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "img-src 'self' data:",
        "connect-src 'self'",
        "form-action 'self'",
        "base-uri 'none'",
        "frame-ancestors 'none'",
    )),
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), geolocation=(), microphone=(), payment=(), usb=()",
    # Not "no-referrer": with it a browser says "Origin: null" when our own form is sent.
    "referrer-policy": "same-origin",
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
}  # fmt: skip
"""Of every answer: no other host is asked, no script or style stands in a page, no page frames ours."""


def _random() -> str:
    return secrets.token_urlsafe(32)


@dataclass(frozen=True, slots=True, kw_only=True)
class Keys:
    """What one run of the server shares with its person alone.

    ``entry`` stands in the printed address, ``cookie`` in the browser, ``form`` in our forms; ``place``
    begins every path.
    """

    entry: str = field(default_factory=_random, repr=False)
    cookie: str = field(default_factory=_random, repr=False)
    form: str = field(default_factory=_random, repr=False)
    place: str = field(default_factory=lambda: "/" + secrets.token_hex(8))


@dataclass(frozen=True, slots=True)
class _Refusal:
    status: int
    reason: str


class Guard:
    """ASGI middleware around the pages. ``origin`` is the one that was printed, as http://127.0.0.1:8731.

    ``is_open`` tells at each request whether its person is still let in.
    """

    def __init__(
        self, app: ASGIApp, *, origin: str, keys: Keys, is_open: Callable[[], bool] = lambda: True
    ) -> None:
        self.app, self.origin, self.keys, self.is_open = app, origin, keys, is_open
        self.authority = origin.partition("://")[2]

    @property
    def address(self) -> str:
        """The address that opens the workbench; whoever has it is let in."""
        return f"{self.origin}{self.keys.place}{ENTRANCE}?key={self.keys.entry}"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request: refuse it, let the person in, or pass it on."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        if scope["type"] != "http":  # no page of ours asks for a web socket
            await send({"type": "websocket.close", "code": 1008})
            return
        guarded = _with_headers(send)
        headers = Headers(scope=scope)
        refusal = self._address_refusal(scope, headers)
        if refusal is None and scope["path"] == self.keys.place + ENTRANCE:
            await self._entrance(scope)(scope, receive, guarded)
            return
        refusal = refusal or self._person_refusal(scope, headers)
        if refusal is None and scope["method"] == "POST":
            refusal = await self._read_form(scope, headers, receive)
        if refusal is not None:
            await _page(refusal.status, refusal.reason)(scope, receive, guarded)
            return
        await self.app(scope, receive, guarded)

    def _address_refusal(self, scope: Scope, headers: Headers) -> _Refusal | None:
        if headers.getlist("host") != [self.authority]:
            return _Refusal(421, "This is not the address of the workbench.")
        if scope["method"] not in ("GET", "HEAD", "POST"):
            return _Refusal(405, "The workbench does not answer this method.")
        if not scope["path"].startswith(self.keys.place + "/"):
            return _Refusal(404, "There is no such page.")
        if not self.is_open():
            return _Refusal(401, "This person is let in no more: the laboratory's people changed.")
        return None

    def _person_refusal(self, scope: Scope, headers: Headers) -> _Refusal | None:
        if headers.get("sec-fetch-site", "none") not in ("same-origin", "none"):
            return _Refusal(403, "Another page asked for this; only the workbench's own pages may.")
        if not compare_digest(_cookie(headers).encode(), self.keys.cookie.encode()):
            return _Refusal(401, "This browser is not let in. Open the address that 'toolkit open' printed.")
        if scope["method"] == "POST" and headers.getlist("origin") != [self.origin]:
            return _Refusal(403, "Another page sent this; only the workbench's own pages may.")
        return None

    async def _read_form(self, scope: Scope, headers: Headers, receive: Receive) -> _Refusal | None:
        """Read the form of a request into its state; what has no key of our pages is refused."""
        content_type = headers.get("content-type", "")
        kind = content_type.partition(";")[0].strip().lower()
        if kind not in (FORM_TYPE, FILES_TYPE):
            return _Refusal(415, "The workbench takes forms alone.")
        body = bytearray()
        more = True
        while more:
            message: Message = await receive()
            if message["type"] != "http.request":
                return _Refusal(400, "The form did not arrive whole.")
            body += message.get("body", b"")
            more = message.get("more_body", False)
            if len(body) > (LARGEST_FORM if kind == FORM_TYPE else LARGEST_UPLOAD):
                return _Refusal(413, "The form is too large.")
        try:
            form = read_form(bytes(body), content_type)
        except ValueError:
            return _Refusal(400, "The form cannot be read.")
        except ConfigError as error:
            return _Refusal(400, f"{error.where}: {error.what}. Go back and write it again: {error.got}")
        if not compare_digest(form.fields.pop("form_key", "").encode(), self.keys.form.encode()):
            return _Refusal(403, "The form is not one of this run of the workbench. Load its page again.")
        scope.setdefault("state", {}).update(form=form.fields, files=form.files)
        return None

    def _entrance(self, scope: Scope) -> HTMLResponse:
        keys = parse_qs(scope["query_string"].decode("latin-1")).get("key", [])
        if scope["method"] != "GET" or len(keys) != 1:
            return _page(403, "This address lacks its key.")
        if not compare_digest(keys[0].encode(), self.keys.entry.encode()):
            return _page(403, "This key is of another run of the workbench.")
        # No redirect: the browser would still count it as asked by whoever opened the address, and keep the
        # cookie back. The page that follows is asked by our own.
        response = HTMLResponse(bare_page("way_in", address=f"{self.keys.place}/"))
        response.set_cookie(
            COOKIE, self.keys.cookie, path=self.keys.place, httponly=True, samesite="strict",
            secure=self.origin.startswith("https:"),
        )  # fmt: skip
        return response


class Doors:
    """The guards of several people, each at the place of its own keys: no cookie is sent to another's."""

    def __init__(self, guards: Sequence[Guard]) -> None:
        self.guards = {guard.keys.place: guard for guard in guards}
        self.closed = guards[0]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on to the guard of its place; any of them refuses what has none."""
        place = "/" + scope.get("path", "").lstrip("/").partition("/")[0]
        await self.guards.get(place, self.closed)(scope, receive, send)


def _cookie(headers: Headers) -> str:
    try:
        morsel = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
    except CookieError:
        return ""
    return "" if morsel is None else morsel.value


def _page(status: int, reason: str) -> HTMLResponse:
    return HTMLResponse(bare_page("refused", reason=reason), status)


def _with_headers(send: Send) -> Send:
    async def guarded(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            headers.update(HEADERS)
            headers.setdefault("cache-control", "no-store")
        await send(message)

    return guarded
