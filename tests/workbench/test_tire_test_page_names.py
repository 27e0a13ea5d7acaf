"""Names of tests, folders and recordings that are hostile to pages and addresses stay text on every page."""

from __future__ import annotations

import html
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import BrowserContext, expect

from tests.workbench.conftest import ROOT, Served, serving
from tests.workbench.test_app import opened, settled
from toolkit.lab.desk.holdings import holding_id
from toolkit.lab.laboratory import open_laboratory

NAMES = (
    "<script>window.hit=1</script>",
    "\"' onmouseover=window.hit=1 x='",
    "a%2Fb%00?q=#x&y",
    " two  words ",
    "\u202erevo\u2066",
    "x" * 200,
    "{{ 7*7 }}",
)

TEST = 'schema = 1\nmachine = "m15-virtual"\ndate = 2026-03-17\nspecial = "<b onclick=1>"\n'


@pytest.fixture(scope="module")
def named(tmp_path_factory: pytest.TempPathFactory, virtual_test: Path) -> Iterator[Served]:
    """A server of a home whose tests and recordings have such names, with an audit of them."""
    home = tmp_path_factory.mktemp("named") / "lab"
    shutil.copytree(ROOT / "calibrations", home / "calibrations")
    first, *others = NAMES
    for name in NAMES:
        (home / "tests" / name).mkdir(parents=True)
        (home / "tests" / name / "test.toml").write_text(TEST)
    folder = home / "tests" / first
    for path, name in zip(sorted(virtual_test.glob("*.xlsx")), others, strict=False):
        shutil.copy(path, folder / f"{name}.xlsx")
    open_laboratory(calibrations=home / "calibrations").audit_archive(
        home / "tests", out=home / "audits" / "all"
    )
    with serving(home) as bench:
        yield bench


def _paths() -> list[str]:
    audit = holding_id("audits/all")
    tests = [holding_id(f"tests/{name}") for name in NAMES]
    return [
        "/tests", "/tests/windows", "/tests/window/0?q=", "/tests/windows?q=%3Cscript%3E", "/audits/list",
        *(f"/audit/{audit}{part}" for part in ("", "/part/answer", "/windows", "/window/0")),
        *(f"/test/{one}" for one in tests), *(f"/test/{one}/part/results" for one in tests),
    ]  # fmt: skip


def test_no_name_is_markup(named: Served) -> None:
    shown = ""
    for path in _paths():
        answer = named.page(path)
        assert answer.status in (200, 400), path  # 400: a test without a recording has no results
        for raw in ("<script>window", "' onmouseover=window.hit", "\"' onmouse", ">49<", "<b onclick"):
            assert raw not in answer.body, (path, raw)
        shown += answer.body
    assert "&lt;script&gt;window.hit=1" in shown
    assert "a%2Fb%00?q=#x&amp;y" in html.unescape(shown).replace("&y", "&amp;y")


def test_every_link_of_the_list_leads_to_its_test(named: Served) -> None:
    links = re.findall(r'href="([^"]*/test/[^"]*)"', named.page("/tests/window/0?q=").body)
    assert len(set(links)) == len(NAMES)
    for link in set(links):
        assert named.ask(html.unescape(link)).status == 200, link


def test_a_browser_runs_nothing_of_a_name_and_stays_in_its_width(
    browser: BrowserContext, named: Served
) -> None:
    messages: list[str] = []
    page = opened(browser, named, [], messages)
    for path in ("/tests", f"/test/{holding_id(f'tests/{NAMES[0]}')}", f"/audit/{holding_id('audits/all')}"):
        page.goto(f"{named.guard.origin}{named.place}{path}")
        settled(page)
        page.mouse.wheel(0, 5_000)  # rows of a long table are filled where they are seen
        expect(page.locator("body")).to_contain_text("<script>window.hit=1</script>", timeout=15_000)
        assert page.evaluate("window.hit") is None
        assert page.evaluate("document.documentElement.scrollWidth <= window.innerWidth"), path
    assert messages == []
    page.close()
