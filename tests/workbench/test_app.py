"""The pages in a real browser: no request elsewhere, nothing that axe objects to, the keyboard."""

from __future__ import annotations

from pathlib import Path

import axe_playwright_python
import pytest
from playwright.sync_api import BrowserContext, Page, expect

from tests.workbench.conftest import Served, serving

AXE = (Path(axe_playwright_python.__file__).parent / "axe.min.js").read_text()
LIGHT = ("light", 1280)
DARK_PHONE = ("dark", 390)
LOOKS = {
    "/": (LIGHT, DARK_PHONE), "/records": (DARK_PHONE,), "/record/cell-r7": (LIGHT, DARK_PHONE),
    "/record/m15-r1": (LIGHT,), "/nothing": (LIGHT,),
}  # fmt: skip
"""What is looked at how: each page in one look at least, those with cards and charts in both."""


def opened(browser: BrowserContext, bench: Served, requests: list[str], messages: list[str]) -> Page:
    page = browser.new_page()
    page.on("request", lambda request: requests.append(request.url))
    page.on("console", lambda message: messages.append(message.text))
    page.on("pageerror", lambda error: messages.append(str(error)))
    page.goto(bench.guard.address)
    page.wait_for_url(f"{bench.guard.origin}{bench.place}/")
    return page


def settled(page: Page) -> None:
    expect(page.locator(".waiting")).to_have_count(0, timeout=60_000)


def objections(page: Page) -> list[str]:
    """Return what axe objects to; it is put in past the policy that forbids such scripts."""
    page.evaluate(AXE)
    found: list[str] = page.evaluate(
        "axe.run().then(r => r.violations.map(v => v.id + ': ' + v.nodes.map(n => n.html).join(' | ')))"
    )
    return found


def test_every_page_is_accessible_in_light_dark_and_phone_width_and_asks_no_other_host(
    browser: BrowserContext, served: Served
) -> None:
    requests: list[str] = []
    messages: list[str] = []
    page = opened(browser, served, requests, messages)
    for path, looks in LOOKS.items():
        page.goto(f"{served.guard.origin}{served.place}{path}")
        for scheme, width in looks:
            page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
            page.set_viewport_size({"width": width, "height": 900})
            settled(page)
            assert objections(page) == [], (path, scheme, width)
            wide = page.evaluate("document.documentElement.scrollWidth")
            assert wide <= width, (path, width)
    assert {url.split("/")[2] for url in requests if not url.startswith("data:")} == {served.guard.authority}
    # The page that is missing is the one message; a script or style that the policy forbids would be another.
    assert [text for text in messages if "404" not in text] == []
    page.close()


def test_a_record_is_approved_by_the_keyboard_alone(browser: BrowserContext, own: Served) -> None:
    page = opened(browser, own, [], [])
    settled(page)
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.className") == "skip"
    page.keyboard.press("Enter")
    link = page.get_by_role("link", name="cell-r7")
    for _ in range(30):
        if link.evaluate("element => element === document.activeElement"):
            break
        page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    page.wait_for_url("**/record/cell-r7")
    settled(page)
    assert page.locator(".curves canvas").count() == 2
    page.get_by_label("Checked by").focus()
    page.keyboard.type("B")
    page.keyboard.press("Enter")
    page.wait_for_selector('[data-status="approved"]')
    assert own.registry.status("cell-r7").checked_by == "B"
    page.close()


def test_a_page_of_another_port_reads_and_decides_nothing(
    browser: BrowserContext, own: Served, tmp_path: Path
) -> None:
    # Another port of this computer is the same site to cookies: the hardest of the pages in another tab.
    import http.server
    import threading

    target = f"{own.guard.origin}{own.place}/record/cell-r7"
    hostile = (
        f'<form id="f" method="post" action="{target}/decide/discard"><input name="by" value="X">'
        f'<input name="reason" value="x"><input name="form_key" value="{own.guard.keys.form}"></form>'
        f'<img src="{target}">'
    )

    class Hostile(http.server.BaseHTTPRequestHandler):
        cookies: list[str] = []  # noqa: RUF012

        def do_GET(self) -> None:
            self.cookies.append(self.headers.get("Cookie", ""))
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(hostile.encode())

        def log_message(self, *_words: object) -> None:
            pass

    opened(browser, own, [], []).close()
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Hostile)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    page = browser.new_page()
    page.goto(f"http://127.0.0.1:{server.server_port}/")
    read = page.evaluate(
        "url => fetch(url, {credentials: 'include'}).then(r => r.text()).catch(e => 'refused')", target
    )
    assert read == "refused"
    page.evaluate("document.getElementById('f').submit()")
    page.wait_for_url("**/decide/discard")
    assert "only the workbench's own pages" in page.content()
    assert own.registry.status("cell-r7").state == "candidate"
    assert not any("toolkit=" in cookie for cookie in Hostile.cookies)
    server.shutdown()
    server.server_close()
    page.close()


@pytest.mark.parametrize(
    ("language", "title"),
    [("de", "Was heute zu entscheiden ist"), ("fr", "Ce qui demande une décision aujourd'hui")],
)
def test_an_empty_home_in_other_languages_and_on_paper(
    browser: BrowserContext, tmp_path: Path, language: str, title: str
) -> None:
    (tmp_path / "new" / "calibrations").mkdir(parents=True)
    with serving(tmp_path / "new") as bench:
        page = opened(browser, bench, [], [])
        page.set_extra_http_headers({"Accept-Language": language})
        page.reload()
        settled(page)
        assert page.locator("h1").inner_text() == title
        assert page.locator("html").get_attribute("lang") == language
        assert objections(page) == []
        page.emulate_media(media="print")
        assert not page.locator("header").is_visible()
        page.close()
