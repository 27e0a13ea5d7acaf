"""What a hostile page, a foreign name and another user of the computer get from the workbench: nothing."""

from __future__ import annotations

import pytest

from tests.workbench.conftest import Served
from toolkit.workbench.guard import HEADERS, LARGEST_FORM

RECORD = "/record/cell-r7"
APPROVAL = {"in_force_from": "2024-03-01", "checked_by": "B"}


def test_the_printed_address_lets_in_and_nothing_else_does(served: Served) -> None:
    path = served.guard.address.removeprefix(served.guard.origin)
    answer = served.ask(path, Cookie=None)
    assert answer.status == 200
    cookie = answer.headers["set-cookie"]
    assert all(part in cookie for part in ("HttpOnly", "SameSite=strict", f"Path={served.place}"))
    assert "Domain" not in cookie
    assert served.page("/", Cookie=cookie.partition(";")[0]).status == 200
    # Opened by a page of another site: the browser says so, and the address itself is what counts.
    assert served.ask(path, Cookie=None, Sec_Fetch_Site="cross-site").status == 200
    for wrong in ("", "?key=", "?key=wrong", f"?key={served.guard.keys.entry}&key=wrong"):
        refused = served.ask(f"{served.place}/open{wrong}", Cookie=None)
        assert (refused.status, "set-cookie" in refused.headers) == (403, False)


@pytest.mark.parametrize("cookie", [None, "", "toolkit=", "toolkit=wrong", "other=x", "toolkit=\u00e9"])
def test_without_its_cookie_a_browser_sees_nothing(served: Served, cookie: str | None) -> None:
    for path in ("/", "/records", RECORD, "/static/htmx.js", "/agenda/candidates"):
        answer = served.page(path, Cookie=cookie)
        assert answer.status == 401
        assert "cell" not in answer.body


@pytest.mark.parametrize("host", [
    "evil.example", "evil.example:{port}", "localhost:{port}", "127.0.0.1", "127.0.0.1:1", "[::1]:{port}",
    "127.0.0.1:{port}.evil.example", "",
])  # fmt: skip
def test_a_name_that_was_made_to_lead_here_is_refused(served: Served, host: str) -> None:
    # DNS rebinding: the page of evil.example asks its own name, which by now leads to this computer.
    answer = served.page("/", Host=host.format(port=served.port))
    assert answer.status in (400, 421)
    assert "cell" not in answer.body
    assert (
        served.ask(served.guard.address.removeprefix(served.guard.origin), Host="evil.example").status == 421
    )


def test_another_place_is_no_page(served: Served) -> None:
    for path in ("/", "/open", "/records", "/0123456789abcdef/", f"{served.place}x/", "/static/htmx.js"):
        assert served.ask(path).status == 404


@pytest.mark.parametrize("origin", [
    None, "null", "https://evil.example", "http://127.0.0.1:1", "http://localhost:{port}", "https://127.0.0.1:{port}",
])  # fmt: skip
def test_a_form_of_another_page_decides_nothing(own: Served, origin: str | None) -> None:
    # Even a page that knows the form key and has the cookie: another port of this computer is same-site.
    stated = origin and origin.format(port=own.port)
    assert own.send(f"{RECORD}/decide/approve", APPROVAL, Origin=stated).status == 403
    assert own.registry.status("cell-r7").state == "candidate"


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
def test_what_the_browser_says_another_page_asked_is_refused(served: Served, site: str) -> None:
    assert served.page("/", Sec_Fetch_Site=site).status == 403
    assert served.page("/", Sec_Fetch_Site="same-origin").status == 200


def test_a_form_without_its_key_decides_nothing(own: Served) -> None:
    path = f"{own.place}{RECORD}/decide/approve"
    for body in (
        "",
        "in_force_from=2024-03-01&checked_by=B",
        "form_key=&checked_by=B",
        "form_key=wrong",
        "%",
    ):
        assert own.ask(path, "POST", body).status in (400, 403)
    assert own.send(f"{RECORD}/decide/approve", APPROVAL, Content_Type="text/plain").status == 415
    assert own.send(f"{RECORD}/decide/approve", APPROVAL, Cookie=None).status == 401
    assert own.send(f"{RECORD}/decide/approve", APPROVAL | {"reason": "x" * LARGEST_FORM}).status == 413
    assert own.page(f"{RECORD}/decide/approve").status == 405
    assert own.registry.status("cell-r7").state == "candidate"


@pytest.mark.parametrize("method", ["PUT", "DELETE", "PATCH", "OPTIONS", "TRACE", "CONNECT"])
def test_other_methods_are_not_answered(served: Served, method: str) -> None:
    assert served.ask(f"{served.place}/", method).status == 405


@pytest.mark.parametrize("path", [
    "/record/..%2f..%2fetc%2fpasswd", "/record/../../etc/passwd", "/record/cell-r99", "/record/cell-r7%00",
    "/record/cell-r7/../../../etc", "/record/%2e%2e-r1", "/record/..-r1", "/record/.hidden-r1",
    "/record/sessions-r1", "/record/cell-r7/part/..", "/record/cell-r7/part/%2e%2e%2fgates",
    "/agenda/..%2fwork",
    "/agenda/secret",
    "/static/..%2fworkbench.js", "/static/../app.py", "/static/vendored.toml",
    "/static/%2fetc%2fpasswd",
    "/static/",
    "/record/cell-r7/part/part_gates.html", "//etc/passwd",
])  # fmt: skip
def test_no_address_names_a_file(served: Served, path: str) -> None:
    answer = served.page(path)
    assert answer.status == 404
    assert "root:" not in answer.body


def test_every_answer_forbids_other_hosts_scripts_in_pages_and_frames(served: Served) -> None:
    for answer in (
        served.page("/"), served.page(RECORD), served.page("/nothing"), served.page("/", Cookie=None),
        served.page("/static/htmx.js"), served.ask("/", Host="evil.example"),
    ):  # fmt: skip
        assert HEADERS.items() <= answer.headers.items()
        policy = answer.headers["content-security-policy"]
        assert policy.startswith("default-src 'none'")
        assert "unsafe" not in policy
        assert "http" not in policy
        assert "access-control-allow-origin" not in answer.headers
        assert "server" not in answer.headers
    assert served.page("/").headers["cache-control"] == "no-store"


def test_keys_are_not_shown_by_what_prints_them(served: Served) -> None:
    keys = served.guard.keys
    assert keys.entry not in repr(keys)
    assert keys.cookie not in served.page(RECORD).body
    assert keys.entry not in served.page(RECORD).body
    assert len({keys.entry, keys.cookie, keys.form, keys.place}) == 4
