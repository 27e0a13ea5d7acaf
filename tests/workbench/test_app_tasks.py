"""What people come for, done in a real browser from an empty home."""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import BrowserContext, Page, expect

from tests.cli.test_calibration_control import session
from tests.workbench.conftest import Served, serving
from tests.workbench.test_app import DARK_PHONE, LIGHT, objections, opened, settled
from toolkit.calibration.registry.registry import Registry
from toolkit.lab.home import make_home
from toolkit.lab.signatures.people import enrol_person, set_demand
from toolkit.trust.keys import open_signer
from toolkit.trust.people import Role
from toolkit.trust.requests import read_request

PEOPLE: dict[str, Role] = {"anna": "head", "dora": "checker", "carl": "operator"}
STATEMENTS = (
    'zero = "tared"\n[cells.S]\nresolution = 0.0000001\n[[polarity]]\nload = "FY"\n'
    'value = { value = 500, unit = "N" }\nindications = { S = { value = 1.01, unit = "mV/V" } }\n'
)


@pytest.fixture
def empty(tmp_path: Path) -> Iterator[Served]:
    """A home in which nothing was ever entered."""
    make_home(tmp_path / "home")
    with serving(tmp_path / "home") as bench:
        yield bench


def photographed(page: Page, name: str) -> None:
    """Keep pictures of a page in its three looks where somebody asked for them, to look at."""
    folder = os.environ.get("TOOLKIT_PICTURES")
    if not folder:
        return
    for look, scheme, width in (("light", "light", 1280), ("dark", "dark", 1280), ("phone", "light", 390)):
        page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
        page.set_viewport_size({"width": width, "height": 900})
        page.wait_for_timeout(300)
        page.screenshot(path=Path(folder) / f"{name}-{look}.png", full_page=True)
    page.emulate_media(media="print", color_scheme="light")
    page.screenshot(path=Path(folder) / f"{name}-print.png", full_page=True)
    page.emulate_media(media="screen", color_scheme="light")
    page.set_viewport_size({"width": 1280, "height": 900})


def looked_at(page: Page, name: str) -> None:
    """Judge a page in its looks: what axe objects to, and nothing wider than the window."""
    for scheme, width in (LIGHT, DARK_PHONE):
        page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
        page.set_viewport_size({"width": width, "height": 900})
        assert objections(page) == [], (name, scheme)
        assert page.evaluate("document.documentElement.scrollWidth") <= width, (name, width)
    page.emulate_media(color_scheme="light")
    page.set_viewport_size({"width": 1280, "height": 900})


def typed_session(page: Page, source: Path) -> None:
    """Type a session as a person does: its columns, then its rows from a spreadsheet with decimal commas."""
    page.get_by_role("link", name="Sessions", exact=True).click()
    new = page.locator("form", has_text="For a new instrument")
    new.get_by_label("Instrument").fill("cell")
    new.get_by_label("Date").fill("2025-03-01")
    new.get_by_label("Operator").fill("Carl Example")
    new.get_by_label("Indications").fill("S [mV/V]")
    new.get_by_label("Loads").fill("FY [N]")
    new.get_by_role("button", name="Begin").click()
    page.wait_for_url("**/session/draft-1")
    expect(page.locator("#rehearsal")).to_contain_text("no rows", timeout=30_000)
    page.get_by_text("Statements of the session").click()
    statements = page.locator("textarea[name=session]")
    statements.fill(statements.input_value().replace('zero = "included"\n', STATEMENTS))
    for name, table in (("data", "loads.csv"), ("check", "check.csv")):
        rows = source.with_name(table).read_text().replace(",", "\t").replace(".", ",")
        page.locator(f"#grid-{name} input").first.focus()
        page.evaluate(
            "text => { const data = new DataTransfer(); data.setData('text/plain', text);"
            "document.activeElement.dispatchEvent(new ClipboardEvent('paste', "
            "{clipboardData: data, bubbles: true, cancelable: true})); }",
            rows,
        )
    expect(page.locator("#rehearsal [data-record=cell-r1]")).to_be_visible(timeout=60_000)


@pytest.mark.campaign("a look in the browser: an approval by two keys goes the same way in every run")
def test_see_what_limits_U(browser: BrowserContext, empty: Served, tmp_path: Path) -> None:
    page = opened(browser, empty, [], [])
    typed_session(page, session(tmp_path / "s", 2025, 0.1))
    expect(page.locator("[data-part=budget] .curves canvas")).to_have_count(1)
    # A statement is typed in its field, and stands in the text.
    resolution = page.locator("[data-key='cells.S.resolution']")
    expect(resolution).to_have_value("1e-07")
    page.locator("[data-key=operator]").fill("Dora Example")
    expect(page.locator("textarea[name=session]")).to_have_value(re.compile('operator = "Dora Example"'))
    expect(page.locator("#rehearsal [data-record=cell-r1]")).to_be_visible(timeout=60_000)
    photographed(page, "session")
    looked_at(page, "session")
    # A slip of a cell is told at the cell, by row and column, and mended there.
    cell = page.locator("#grid-data").get_by_label("row 4, S [mV/V]")
    value = cell.input_value()
    cell.fill("0,2x")
    expect(cell).to_have_attribute("aria-invalid", "true", timeout=30_000)
    expect(page.locator("#fault")).to_contain_text("row 4")
    cell.fill(value)
    expect(cell).not_to_have_attribute("aria-invalid", "true", timeout=30_000)
    # The browser is closed in the middle of a number, and opened again.
    cell.fill("0,4242")
    page.close()
    page = opened(browser, empty, [], [])
    settled(page)
    page.get_by_role("link", name="cell 2025-03-01").click()
    cell = page.locator("#grid-data").get_by_label("row 4, S [mV/V]")
    expect(cell).to_have_value("0,4242")
    cell.fill(value)
    budget = page.locator("[data-part=budget]")
    expect(budget).to_be_visible(timeout=60_000)
    page.get_by_role("button", name="Enter the session").click()
    page.wait_for_url("**/record/cell-r1")
    settled(page)
    shares = page.locator("#budget + section .wide tbody tr")
    largest = max(
        (float(shares.nth(at).locator("data").last.get_attribute("value") or 0), shares.nth(at).inner_text())
        for at in range(shares.count())
    )
    # What limits U stands in the budget with its share; it is what `calibration budget` says.
    from toolkit.lab.records.budget import BudgetOrder, budget_answer

    answer, _, _ = budget_answer(empty.registry, "cell-r1", BudgetOrder())
    components = [c for c in answer["loads"]["FY"]["components"] if c["stated"]]
    limiting = max(components, key=lambda component: component["share"])
    assert limiting["name"] in largest[1]
    assert largest[0] == limiting["share"]
    page.close()


def test_approve_a_calibration_with_two_keys(
    browser: BrowserContext, empty: Served, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    keys = enrolled(empty, tmp_path / "keys")
    page = opened(browser, empty, [], [])
    typed_session(page, session(tmp_path / "s", 2025, 0.1))
    page.get_by_role("button", name="Request entry").click()
    page.wait_for_url("**/session/draft-1#decision")
    handed_in(page, keys / "carl", tmp_path)
    page.wait_for_url("**/record/cell-r1")
    settled(page)
    assert empty.registry.load("cell-r1").data_file("check") is not None
    # Who took the readings cannot approve them.
    approve = page.locator("form", has=page.get_by_role("button", name="Request approval"))
    approve.get_by_label("Checked by").select_option("carl")
    approve.get_by_role("button").click()
    expect(page.get_by_role("alert")).to_contain_text("carl")
    approve.get_by_label("Checked by").select_option("dora")
    approve.get_by_label("Approved by").select_option("anna")
    approve.get_by_role("button").click()
    expect(page.locator("[data-pending=approve]")).to_be_visible()
    settled(page)
    looked_at(page, "to be signed")
    handed_in(page, keys / "dora", tmp_path)
    expect(page.locator("[data-signers='1']")).to_be_visible()
    assert empty.registry.status("cell-r1").state == "candidate"
    page.get_by_role("link", name="Today").click()
    settled(page)
    assert page.locator("[data-request=cell-r1]").count() == 1
    # The second key is in the SSH agent of whoever runs the server.
    place = tmp_path / "agent"
    agent = subprocess.Popen(["ssh-agent", "-D", "-a", str(place)], stdout=subprocess.DEVNULL)
    try:
        monkeypatch.setenv("SSH_AUTH_SOCK", str(place))
        while not place.exists():
            page.wait_for_timeout(20)
        subprocess.run(["ssh-add", "-q", str(keys / "anna")], check=True, capture_output=True)
        page.locator("[data-request=cell-r1] a").click()
        page.get_by_role("button", name=re.compile("Sign as Anna")).click()
        page.wait_for_selector('[data-status="approved"]')
    finally:
        agent.terminate()
        agent.wait()
    entry = Registry(empty.registry.folder).ledger("cell").entries[-1]
    assert [row["by"] for row in entry.signatures] == ["dora", "anna"]
    page.close()


def enrolled(bench: Served, keys: Path) -> Path:
    """Enrol three people whose keys lie outside of the home; an approval takes two of them."""
    keys.mkdir()
    for name in (*PEOPLE, "safe"):
        subprocess.run(
            ["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-C", name, "-f", str(keys / name)], check=True
        )
    registry = Registry(bench.registry.folder, signers=(open_signer(keys / "anna", str),))
    for name, role in PEOPLE.items():
        enrol_person(
            registry, name, name=f"{name.title()} Example", roles=(role,), key=keys / f"{name}.pub",
            reason="first", recovery=open_signer(keys / "safe", str) if name == "anna" else None,
        )  # fmt: skip
    set_demand(registry, "approve", roles=("checker", "head"), signatures=2, reason="two keys")
    return keys


def handed_in(page: Page, key: Path, folder: Path) -> None:
    """Sign the request that the page hands out on another computer, and hand the answer in."""
    with page.expect_download() as download:
        page.get_by_role("link", name="Download the request").click()
    request = folder / "request.json"
    download.value.save_as(request)
    answer, _ = read_request(request).signed(open_signer(key, str))
    (folder / "answer.json").write_text(answer.text)
    page.get_by_label("The answer that it wrote").set_input_files(folder / "answer.json")
    page.get_by_role("button", name="Hand in the answer").click()
