"""One owner of what is typed: fields, windows and the results below them, in a real browser."""

from __future__ import annotations

import re
from pathlib import Path
from urllib.parse import parse_qs

from playwright.sync_api import BrowserContext, Page, Request, expect

from tests.cli.test_calibration_control import session
from tests.workbench.conftest import Served
from tests.workbench.test_app import opened
from tests.workbench.test_app_tasks import looked_at, photographed
from tests.workbench.test_session_page import dropped, typed
from toolkit.lab.desk.drafts import open_draft


def draft_page(browser: BrowserContext, bench: Served, draft: str) -> Page:
    opened(browser, bench, [], []).close()
    page = browser.new_page()
    page.goto(f"{bench.guard.origin}{bench.place}/session/{draft}")
    expect(page.locator("#rehearsal [data-version]")).to_be_visible(timeout=60_000)
    return page


def judged(page: Page) -> str:
    return str(page.locator("#rehearsal [data-version]").get_attribute("data-version"))


def test_a_field_is_kept_and_what_is_judged_is_what_stands_there(
    browser: BrowserContext, own: Served, tmp_path: Path
) -> None:
    draft = dropped(own, session(tmp_path / "new", 2025, 0.1))
    page = draft_page(browser, own, draft)
    sent: list[dict[str, list[str]]] = []

    def seen(request: Request) -> None:
        if request.url.endswith("/rehearse"):
            sent.append(parse_qs(request.post_data or ""))

    page.on("request", seen)
    older = page.locator("#older")
    for operator in ("R1", "R2"):
        before = judged(page)
        page.locator("#statements [data-key=operator]").fill(operator)
        # As long as something newer is judged, the results say that they are not of it.
        expect(older).to_be_visible()
        expect(older).to_contain_text(before[:8])
        expect(older).to_be_hidden(timeout=60_000)
        page.wait_for_load_state("networkidle")
        kept = open_draft(own.home, draft)
        assert f'operator = "{operator}"' in kept.session
        assert judged(page) == kept.version
        assert f"version {kept.version[:8]}" in page.locator("#kept").inner_text()
    assert all(set(form) == {"form_key"} for form in sent), "a rehearsal brings no text that it could write"
    # Typed into two fields and the text in one breath: nothing undoes the other.
    page.locator("#statements [data-key=operator]").fill("Both")
    page.locator("#statements [data-key='cells.S.serial']").fill("4711")
    page.get_by_text("Statements of the session").click()
    text = page.locator("textarea[name=session]")
    expect(text).to_have_value(re.compile('"Both"'))
    expect(text).to_have_value(re.compile('"4711"'))
    text.press("Control+End")
    text.press_sequentially("# and a remark")
    page.close()
    for _ in range(100):
        if "# and a remark" in open_draft(own.home, draft).session:
            break
        browser.pages[0].wait_for_timeout(50)
    kept = open_draft(own.home, draft)
    assert all(words in kept.session for words in ('"Both"', '"4711"', "# and a remark"))


def test_a_field_and_the_page_closed_at_once_loses_nothing(
    browser: BrowserContext, own: Served, tmp_path: Path
) -> None:
    draft = dropped(own, session(tmp_path / "new", 2025, 0.1))
    page = draft_page(browser, own, draft)
    page.locator("#statements [data-key=operator]").fill("Last Words")
    page.goto(f"{own.guard.origin}{own.place}/records")
    for _ in range(100):
        if "Last Words" in open_draft(own.home, draft).session:
            break
        page.wait_for_timeout(50)
    assert 'operator = "Last Words"' in open_draft(own.home, draft).session
    page.close()


def test_the_later_of_two_windows_is_told_and_chooses(
    browser: BrowserContext, own: Served, tmp_path: Path
) -> None:
    draft = dropped(own, session(tmp_path / "new", 2025, 0.1))
    first, second = draft_page(browser, own, draft), draft_page(browser, own, draft)
    first.locator("#statements [data-key=operator]").fill("AAA")
    expect(first.locator("#older")).to_be_hidden(timeout=60_000)
    expect(first.locator("textarea[name=session]")).to_have_value(re.compile("AAA"))
    second.locator("#statements [data-key='cells.S.serial']").fill("BBB")
    conflict = second.locator("#conflict [data-rule=stale]")
    expect(conflict).to_be_visible(timeout=30_000)
    expect(conflict.locator("[data-side=kept] mark").filter(has_text="AAA")).to_have_count(1)
    expect(conflict.locator("[data-side=typed] mark").filter(has_text="BBB")).to_have_count(1)
    kept = open_draft(own.home, draft).session
    assert "AAA" in kept
    assert "BBB" not in kept
    photographed(second, "conflict")
    looked_at(second, "conflict")
    conflict.get_by_role("button", name="Replace it by what you typed").click()
    expect(second.locator("#statements [data-key='cells.S.serial']")).to_have_value("BBB")
    assert "AAA" not in open_draft(own.home, draft).session
    # Entered in one window, the other says where it is now, and takes no more.
    expect(second.locator("#rehearsal [data-version]")).to_be_visible(timeout=60_000)
    second.get_by_role("button", name="Enter the session").click()
    second.wait_for_url("**/record/cell-r8")
    first.locator("#statements [data-key=operator]").fill("Too Late")
    ended = first.locator("#conflict [data-ended=cell-r8]")
    expect(ended).to_contain_text("entered as cell-r8", timeout=30_000)
    looked_at(first, "ended")
    first.reload()
    expect(first.locator("[data-ended=cell-r8]")).to_be_visible()
    looked_at(first, "ended page")
    first.close()
    second.close()


def test_what_is_typed_is_what_is_entered(browser: BrowserContext, own: Served, tmp_path: Path) -> None:
    draft = dropped(own, session(tmp_path / "new", 2025, 0.1))
    assert "version" in typed(own, draft)
    page = draft_page(browser, own, draft)
    page.locator("#statements [data-key=operator]").fill("At The Button")
    page.get_by_role("button", name="Enter the session").click()
    page.wait_for_url("**/record/cell-r8")
    assert "At The Button" in (own.home / "sessions" / "cell-r8" / "SESSION.toml").read_text()
    page.close()
