"""Work on tests, archives and cases, done in a real browser from an empty home."""

from __future__ import annotations

import re
import shutil
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import BrowserContext, Page, expect

from tests.workbench.conftest import ROOT, Served, serving
from tests.workbench.test_app import opened, settled
from tests.workbench.test_app_tasks import looked_at, photographed
from tests.workbench.test_diagnosis_page import CASE_FILES
from toolkit.files import sha256_file
from toolkit.lab.desk.holdings import holding_id
from toolkit.lab.home import make_home
from toolkit.lab.laboratory import example

STATED = 'schema = 1\nmachine = "m15"\ndate = 2019-05-31\n'
"""The day of the packaged recording, which was computed by the record with the wrong sign of E5, m15-r1."""


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Served]:
    """An empty home, into which the packaged records of the machine were brought."""
    home = tmp_path / "home"
    make_home(home)
    shutil.copytree(ROOT / "calibrations", home / "calibrations", dirs_exist_ok=True)
    with serving(home) as served:
        yield served


def put_recording(folder: Path) -> Path:
    """Put the packaged recording with its statements into a folder, as a machine's computer does."""
    folder.mkdir(parents=True)
    (folder / "test.toml").write_text(STATED)
    return Path(shutil.copy(example("fig4_4"), folder))


def ended(page: Page) -> None:
    """Wait on a job's page for its end."""
    expect(page.locator("[data-state]").first).not_to_have_attribute("data-state", "running", timeout=300_000)


def own_template(path: Path, *, tag: str) -> Path:
    """Write the packaged template as a laboratory's own, with another tag in the place of the title's."""
    with zipfile.ZipFile(ROOT / "report_templates" / "org.docx") as source, zipfile.ZipFile(path, "w") as own:
        for member in source.infolist():
            data = source.read(member)
            if member.filename == "word/document.xml":
                data = data.replace(b"tk:report.title", tag.encode())
            own.writestr(member, data)
    return path


@pytest.mark.campaign("a whole work in the browser: every run holds the pages of templates and reports")
def test_make_a_report_from_an_own_template(browser: BrowserContext, bench: Served, tmp_path: Path) -> None:
    put_recording(bench.home / "tests" / "few")
    page = opened(browser, bench, [], [])
    page.get_by_role("link", name="Templates", exact=True).click()
    # The template has a tag that nobody knows: its page says which, and where.
    files = page.get_by_label("A Word template")
    files.set_input_files(own_template(tmp_path / "own.docx", tag="tk:report.titel"))
    page.get_by_role("button", name="Add and check").click()
    own = page.locator(f"[data-template='{holding_id('report_templates/own.docx')}']")
    settled(page)
    expect(own.locator("[data-rule=unknown-tag]").first).to_contain_text("report.titel")
    # Its pages carry the number of each finding where it stands.
    own.get_by_role("button", name="See its pages").click()
    expect(own.locator("[data-page] .mark-number").first).to_be_visible(timeout=60_000)
    expect(own.locator("[data-page='1'] figcaption")).to_contain_text("unknown-tag")
    page.wait_for_load_state("networkidle")
    photographed(page, "templates")
    looked_at(page, "templates")
    # Mended, it takes the place of the first one, with consent.
    files.set_input_files(own_template(tmp_path / "own.docx", tag="tk:report.title"))
    page.get_by_role("button", name="Add and check").click()
    expect(page.get_by_role("alert")).to_contain_text("a file of this name")
    files.set_input_files(tmp_path / "own.docx")
    page.get_by_label("Replace the template").check()
    page.get_by_role("button", name="Add and check").click()
    settled(page)
    assert own.locator("[data-rule=unknown-tag]").count() == 0
    # The report by it: seen with its holes, then issued with them.
    page.get_by_role("link", name="Tests", exact=True).click()
    page.get_by_role("link", name="tests/few").click()
    page.get_by_role("link", name="Report").click()
    page.get_by_label("Template").select_option(label="own.docx")
    page.get_by_role("button", name="See its pages").click()
    ended(page)
    page.locator("main").get_by_role("link").first.click()
    settled(page)
    expect(page.locator(".hole").first).to_be_visible()
    photographed(page, "report")
    looked_at(page, "report")
    page.get_by_label("Issue it with its holes").check()
    page.get_by_role("button", name="Issue the report").click()
    ended(page)
    delivered = bench.home / "reports" / "tests" / "few"
    assert {path.name for path in delivered.iterdir()} >= {"report.docx", "report.pdf", "manifest.json"}
    page.close()


@pytest.mark.campaign(
    "a whole work in the browser: every run holds an audit and its repair by their requests"
)
def test_find_why_a_file_is_wrong_and_repair_it(browser: BrowserContext, bench: Served) -> None:
    original = put_recording(bench.home / "archive" / "2019")
    before = sha256_file(original)
    page = opened(browser, bench, [], [])
    page.get_by_role("link", name="Jobs", exact=True).click()
    page.get_by_label("Folder of this home").select_option(label="archive")
    page.get_by_role("button", name="Start").click()
    ended(page)
    page.locator("main a[href*='/audit/']").first.click()
    settled(page)
    # The first line says what is wrong and why; the file shows both curves.
    expect(page.locator("[data-headline=wrong]")).to_contain_text("1 file carries a wrong Fy or Mz")
    expect(page.locator("[data-headline=wrong]")).to_contain_text("not in force (m15-r1)")
    photographed(page, "archive")
    looked_at(page, "archive")
    page.locator("[data-file] a").first.click()
    expect(page.locator(".curves canvas").first).to_be_visible()
    photographed(page, "file")
    looked_at(page, "file")
    page.get_by_role("link", name="All files of this audit").click()
    settled(page)
    page.get_by_text("Repair: corrected copies").click()
    page.get_by_label("I agree that these copies are written").check()
    page.get_by_role("button", name="Write corrected copies").click()
    ended(page)
    expect(page.locator("main")).to_contain_text(re.compile("1 corrected cop"))
    assert sha256_file(original) == before
    copies = [path for path in (bench.home / "repaired").rglob("*") if path.suffix in (".xlsx", ".csv")]
    assert len(copies) == 1
    page.close()


@pytest.mark.campaign("a whole work in the browser: every run holds the pages of a case and of its answer")
def test_learn_what_a_simulation_lacks(browser: BrowserContext, bench: Served, tmp_path: Path) -> None:
    for name, data in CASE_FILES:
        (tmp_path / name).write_bytes(data)
    page = opened(browser, bench, [], [])
    page.get_by_role("link", name="Diagnoses", exact=True).click()
    page.get_by_label("case.toml and every file").set_input_files([tmp_path / name for name, _ in CASE_FILES])
    page.get_by_role("button", name="Add the case").click()
    page.get_by_role("button", name="Diagnose: cases/case-1").click()
    ended(page)
    page.locator("main a[href*='/diagnosis/']").first.click()
    expect(page.locator("[data-verdict=named]")).to_be_visible()
    expect(page.locator("[data-effect=nonlinearity]")).to_be_visible()
    photographed(page, "diagnosis")
    looked_at(page, "diagnosis")
    # Without the effect the simulation is as far off as before; with it, it is not.
    page.get_by_role("link", name="Switch its effects").click()
    left = page.locator("[data-rmse=F] data")
    expect(left).to_be_visible(timeout=30_000)
    fitted = float(left.get_attribute("value") or "nan")
    effect = page.locator("fieldset[data-effect^=nonlinearity]")
    effect.get_by_label("acts").uncheck()
    expect(left).not_to_have_attribute("value", str(fitted), timeout=30_000)
    assert float(left.get_attribute("value") or "nan") > 4 * fitted
    photographed(page, "model")
    looked_at(page, "model")
    # A chart stays what it is while colours change, and its zoom while sizes do.
    chart = page.locator(".curves .u-over").first
    expect(chart).to_be_visible()
    drawn = chart.evaluate_handle("over => over")
    for scheme in ("dark", "light"):
        page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
        page.evaluate("() => new Promise(drawn => requestAnimationFrame(() => requestAnimationFrame(drawn)))")
        assert drawn.evaluate("over => over.isConnected"), scheme
    chart.scroll_into_view_if_needed()
    box = chart.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 60, box["y"] + 60)
    page.mouse.down()
    page.mouse.move(box["x"] + 200, box["y"] + 160, steps=5)
    page.mouse.up()
    curves = page.locator(".curves").first
    expect(curves).to_have_attribute("data-shows", re.compile(r"\S"))
    page.wait_for_timeout(300)
    shown = str(curves.get_attribute("data-shows"))
    assert float(shown.split()[1]) < 60
    effect.get_by_label("acts").check()
    expect(left).to_have_attribute("value", str(fitted), timeout=30_000)
    expect(curves).to_have_attribute("data-shows", shown)
    # What is no number is told; the sizes of the answer simulate as before.
    page.locator("input[name^=size-0]").first.fill("")
    expect(page.locator("#trial")).to_contain_text("a size is no number", timeout=30_000)
    page.reload()
    expect(left).to_have_attribute("value", str(fitted), timeout=30_000)
    page.get_by_role("button", name="Keep this as a model").click()
    kept = page.locator("[data-kept]")
    expect(kept).to_be_visible()
    assert (bench.home / str(kept.get_attribute("data-kept"))).is_file()
    page.close()
