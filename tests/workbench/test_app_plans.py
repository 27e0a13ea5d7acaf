"""A plan, made in a real browser by the keyboard, and every kind of plan in light, dark and phone width."""

from __future__ import annotations

import pytest
from playwright.sync_api import BrowserContext, expect

from tests.workbench.conftest import Served
from tests.workbench.test_app import opened, settled
from tests.workbench.test_app_tasks import looked_at, photographed
from tests.workbench.test_plan_page import planned

__all__ = ["planned"]


def test_an_interval_is_planned_by_the_keyboard(browser: BrowserContext, own: Served) -> None:
    page = opened(browser, own, [], [])
    page.get_by_role("link", name="Plans", exact=True).focus()
    page.keyboard.press("Enter")
    page.wait_for_url("**/plans")
    settled(page)
    looked_at(page, "plans")
    photographed(page, "plans")
    form = page.locator("form", has_text="When to calibrate again")
    form.get_by_label("Instrument").focus()
    page.keyboard.type("cell")
    page.keyboard.press("Tab")
    page.keyboard.type("0.9")
    page.keyboard.press("Enter")
    page.wait_for_url("**/job/*")
    expect(page.locator("[data-state]").first).not_to_have_attribute("data-state", "running", timeout=120_000)
    page.get_by_role("link", name="See what it made").click()
    page.wait_for_url("**/plan/*")
    settled(page)
    expect(page.locator("[data-plan]")).to_contain_text("days")
    assert page.locator(".curves canvas").count() == 1
    page.close()


@pytest.mark.campaign("a plan of every kind for its look alone: one is made by the keyboard in every run")
def test_every_kind_of_plan_is_accessible_in_light_dark_and_phone_width(
    browser: BrowserContext, planned: tuple[Served, dict[str, str]]
) -> None:
    bench, ids = planned
    messages: list[str] = []
    page = opened(browser, bench, [], messages)
    for kind, plan_id in ids.items():
        page.goto(f"{bench.guard.origin}{bench.place}/plan/{plan_id}")
        settled(page)
        looked_at(page, kind)
        photographed(page, f"plan-{kind}")
    assert messages == []
    page.close()
