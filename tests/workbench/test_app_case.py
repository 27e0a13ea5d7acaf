"""A case that is built in a real browser from recordings alone, and diagnosed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import BrowserContext, Page, expect

from tests.workbench.conftest import Served, serving
from tests.workbench.test_app import opened, settled
from tests.workbench.test_app_tasks import looked_at, photographed
from tests.workbench.test_app_work import ended
from tests.workbench.test_diagnosis_page import CASE_FILES
from toolkit.lab.home import make_home


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Served]:
    """An empty home."""
    make_home(tmp_path / "home")
    with serving(tmp_path / "home") as served:
        yield served


def stated(page: Page, **entries: str) -> None:
    """State entries in their fields, and wait until each is kept."""
    for name, text in entries.items():
        field = page.locator(f"[data-key='{name.replace('__', '.')}']")
        with page.expect_response(lambda response: response.url.endswith("/state")):
            if field.evaluate("element => element.tagName") == "SELECT":
                field.select_option(text)
            else:
                field.fill(text)


def added(page: Page, table: str, name: str) -> None:
    form = page.locator(f"form:has(input[name=table][value='{table}'])").first
    choice = form.locator("[name=name]")
    if choice.evaluate("element => element.tagName") == "SELECT":
        choice.select_option(name)
    else:
        choice.fill(name)
    form.get_by_role("button", name="Add").click()
    expect(page.locator(f"[data-group='{table}.{name}']")).to_be_visible()


@pytest.mark.campaign("a whole work in the browser: every run holds the page of a case by its requests")
def test_a_case_is_built_of_recordings_a_simulation_and_columns(
    browser: BrowserContext, bench: Served, tmp_path: Path
) -> None:
    for name, data in CASE_FILES:
        (tmp_path / name).write_bytes(data)
    page = opened(browser, bench, [], [])
    page.get_by_role("link", name="Diagnoses", exact=True).click()
    settled(page)
    looked_at(page, "diagnoses")
    photographed(page, "diagnoses")
    page.locator("input[name=recordings]").set_input_files([tmp_path / "r0.csv", tmp_path / "r1.csv"])
    page.get_by_label("Kind of simulation").select_option("python")
    page.get_by_label("Files of the simulation").set_input_files([tmp_path / "sim.py"])
    page.get_by_role("button", name="Build the case").click()
    page.wait_for_url("**/case/*")
    # The one file of the simulation stands in its entry; no header of these recordings names a channel.
    expect(page.locator("[data-key='simulation.path']")).to_have_value("sim.py")
    expect(page.locator("#trial")).to_contain_text("channels", timeout=30_000)
    photographed(page, "case-begun")
    for column, role in (("L", "input"), ("F", "output")):
        added(page, "recording.channels", column)
        stated(page, **{f"recording__channels__{column}__unit": "N"})
        stated(page, **{f"recording__channels__{column}__role": role})
    stated(page, recording__channels__F__sd="0,4")
    added(page, "simulation.parameters", "gain")
    for key, text in (("value", "1"), ("unit", "1"), ("sd", "0.001")):
        stated(page, **{f"simulation__parameters__gain__{key}": text})
    # The simulation answers as it is declared: F = gain L, far off where the load is large.
    left = page.locator("[data-rmse=F] data")
    expect(left).to_be_visible(timeout=30_000)
    assert float(left.get_attribute("value") or "nan") > 10
    looked_at(page, "case")
    photographed(page, "case")
    # A wrong unit is told by the reader, at once, with what may stand there.
    stated(page, recording__channels__L__unit="Newt")
    expect(page.locator("#trial")).to_contain_text("recording.channels.L.unit", timeout=30_000)
    stated(page, recording__channels__L__unit="N")
    expect(left).to_be_visible(timeout=30_000)
    # No field leads out of the case.
    stated(page, title="/etc/hostname")
    expect(page.locator("#refused")).to_contain_text("/etc/hostname")
    stated(page, title="A cell that is not linear")
    expect(page.locator("#refused")).to_be_empty()
    page.get_by_role("button", name="Diagnose", exact=True).click()
    ended(page)
    page.locator("main a[href*='/diagnosis/']").first.click()
    expect(page.locator("[data-verdict=named]")).to_be_visible()
    expect(page.locator("[data-effect=nonlinearity]")).to_be_visible()
    page.close()
