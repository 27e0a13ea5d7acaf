"""Tests, archives and jobs in a real browser: switches, hover, keys, accessibility, no other host."""

from __future__ import annotations

import dataclasses
import json
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import BrowserContext, Page, expect

from tests.report.diagnosis.test_answer import ANSWER as WHOLE
from tests.workbench.conftest import ROOT, Served, serving
from tests.workbench.test_app import DARK_PHONE, LIGHT, objections, opened, settled
from toolkit.declared import json_value
from toolkit.lab.desk.holdings import holding_id
from toolkit.lab.desk.jobs import Job, write_job
from toolkit.lab.laboratory import example, open_laboratory

ONE, FEW, AUDIT, MANY = map(holding_id, ("tests/one", "tests/few", "audits/one", "audits/many"))

DIAGNOSIS = holding_id("diagnoses/cell")
ANSWER = json_value(dataclasses.replace(WHOLE, complete=False)) | {
    "schema": 1,
    "draft_reasons": ["the calibration is not approved"],
}
"""An answer that has one of everything that a page shows otherwise seldom."""
LOST = "20260101T000000-00000001"


@pytest.fixture(scope="module")
def working(tmp_path_factory: pytest.TempPathFactory, virtual_test: Path) -> Iterator[Served]:
    """A home with one test."""
    home = tmp_path_factory.mktemp("working") / "lab"
    shutil.copytree(ROOT / "calibrations", home / "calibrations")
    shutil.copytree(virtual_test, home / "tests" / "one")
    # One real file of five load blocks: few marks for what looks at every mark of a page.
    (home / "tests" / "few").mkdir()
    shutil.copy(example("fig4_4"), home / "tests" / "few")
    (home / "tests" / "few" / "test.toml").write_text('schema = 1\nmachine = "m15"\ndate = 2019-05-31\n')
    open_laboratory(calibrations=home / "calibrations").audit_archive(
        home / "tests" / "few", out=home / "audits" / "one"
    )
    _many(home / "audits" / "one" / "audit.jsonl", home / "audits" / "many")
    shutil.copytree(ROOT / "report_templates", home / "report_templates", ignore=_but_one)
    (home / "diagnoses" / "cell" / "predictions").mkdir(parents=True)
    (home / "diagnoses" / "cell" / "diagnosis.json").write_text(json.dumps(ANSWER))
    (home / "diagnoses" / "cell" / "predictions" / "r.csv").write_text(
        "t,F_nominal,F_refitted\n0,1,2\n1,3,4\n"
    )
    (home / "jobs" / LOST).mkdir(parents=True)
    lost = Job(kind="audit", title="archive", words=("audit", "archive"), started="2026-01-01T00:00:00Z")
    write_job(home / "jobs" / LOST, lost)
    with serving(home) as bench:
        yield bench


def _but_one(_folder: str, names: list[str]) -> list[str]:
    return [name for name in names if name not in ("org.docx", "org.toml")]


def _many(lines: Path, out: Path) -> None:
    """Write an answer of 10 000 files: each of the few that were audited many times, under another name."""
    head, *few = lines.read_text().splitlines()
    out.mkdir()
    with (out / "audit.jsonl").open("w") as stream:
        stream.write(head + "\n")
        for number in range(10_000):
            line = few[number % len(few)]
            stream.write(line.replace('{"path": "', f'{{"path": "{number:05}/', 1) + "\n")


def at(page: Page, bench: Served, path: str) -> None:
    page.goto(f"{bench.guard.origin}{bench.place}{path}")
    settled(page)


LOOKS = {
    "/tests": (LIGHT, DARK_PHONE),
    f"/test/{FEW}": (LIGHT, DARK_PHONE),
    f"/beside?left={FEW}&right={FEW}&right_record=m15-r1": (DARK_PHONE,),
    "/audits": (DARK_PHONE,),
    f"/audit/{AUDIT}": (LIGHT, DARK_PHONE),
    f"/audit/{AUDIT}/file/0": (LIGHT, DARK_PHONE),
    "/jobs": (LIGHT,),
    "/templates": (LIGHT,),
    f"/test/{FEW}/report": (DARK_PHONE,),
    "/diagnoses": (DARK_PHONE,),
    f"/diagnosis/{DIAGNOSIS}": (LIGHT, DARK_PHONE),
    f"/job/{LOST}": (DARK_PHONE,),
}


def test_the_pages_are_accessible_and_ask_no_other_host(browser: BrowserContext, working: Served) -> None:
    requests: list[str] = []
    messages: list[str] = []
    page = opened(browser, working, requests, messages)
    for path, looks in LOOKS.items():
        for scheme, width in looks:
            page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
            page.set_viewport_size({"width": width, "height": 900})
            at(page, working, path)
            assert objections(page) == [], (path, scheme, width)
            assert page.evaluate("document.documentElement.scrollWidth") <= width, (path, width)
    assert {url.split("/")[2] for url in requests if not url.startswith("data:")} == {working.guard.authority}
    assert messages == []
    page.close()


@pytest.mark.campaign("a look in the browser: every number of a page is one of its command in every run")
def test_a_value_is_told_with_U_under_the_pointer_and_by_the_keys(
    browser: BrowserContext, working: Served
) -> None:
    page = opened(browser, working, [], [])
    page.set_viewport_size({"width": 1280, "height": 900})
    at(page, working, f"/test/{ONE}")
    chart = page.locator('.curves[data-name="FY"]')
    readout = page.locator("figure").first.locator("output")
    chart.focus()
    page.keyboard.press("ArrowRight")
    first = readout.inner_text()
    assert "forward" in first
    assert "FY = " in first
    assert "±" in first
    told = readout.get_attribute("data-value")
    drawn = chart.evaluate("element => JSON.parse(element.dataset.curves).series[0]")
    assert float(told or "nan") == drawn["y"][0]
    page.keyboard.press("ArrowRight")
    assert float(readout.get_attribute("data-value") or "nan") == drawn["y"][1]
    over = chart.locator(".u-over").bounding_box()
    assert over is not None
    page.mouse.move(over["x"] + over["width"] / 2, over["y"] + over["height"] / 2)
    assert readout.inner_text() != first
    page.close()


def test_a_load_is_switched_off_in_every_chart_and_in_the_download(
    browser: BrowserContext, working: Served
) -> None:
    page = opened(browser, working, [], [])
    page.set_viewport_size({"width": 1280, "height": 900})
    at(page, working, f"/test/{ONE}")
    page.locator('input[name="load"][value="0"]').uncheck()
    page.locator('input[name="rotation"][value="reverse"]').uncheck()
    chart = page.locator('.curves[data-name="gough"]')
    chart.focus()
    page.keyboard.press("ArrowRight")
    told = page.locator("figure").nth(2).locator("output").inner_text()
    assert "forward" in told
    lightest = page.locator('input[name="load"][value="0"]').get_attribute("data-load")
    assert f"{float(lightest or 0):.0f}" not in told.split(",")[0]
    with page.expect_download() as downloaded:
        page.get_by_role("button", name="Download what is shown (CSV)").click()
    lines = Path(downloaded.value.path()).read_text().splitlines()
    assert lines
    assert not any(",reverse," in line for line in lines)
    page.close()


def test_ten_thousand_files_scroll_to_their_end_and_only_what_is_seen_is_asked(
    browser: BrowserContext, working: Served
) -> None:
    requests: list[str] = []
    page = opened(browser, working, requests, [])
    page.set_viewport_size({"width": 1280, "height": 900})
    at(page, working, f"/audit/{MANY}")
    page.get_by_label("Order").select_option("path")
    expect(page.locator("#list a[href*='order=path']").first).to_be_attached(timeout=60_000)
    page.locator(".scroll").last.evaluate("element => element.scrollIntoView({ block: 'center' })")
    expect(page.get_by_role("link", name="00000/")).to_be_visible(timeout=60_000)
    page.locator(".scroll").last.evaluate("element => { element.scrollTop = element.scrollHeight; }")
    expect(page.get_by_role("link", name="09999/")).to_be_visible(timeout=60_000)
    asked = [url for url in requests if "/window/" in url]
    assert len(asked) < 12
    page.get_by_label("Find files").fill("07777/")
    expect(page.locator('[data-count="files"]')).to_have_text("1", timeout=60_000)
    page.close()
