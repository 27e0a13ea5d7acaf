"""A report by its pages: previewed with its holes marked, then issued; templates say what check says."""

from __future__ import annotations

import contextlib
import http.client
import json
import re
import shutil
from pathlib import Path

import pytest

from tests.report.template_factory import make, p
from tests.workbench.conftest import ROOT, Served, plain, serving
from tests.workbench.test_home_page import command
from tests.workbench.test_jobs_page import done
from toolkit.lab.desk.holdings import holding_id
from toolkit.lab.desk.previews import templates_of
from toolkit.lab.laboratory import example

TEST = holding_id("tests/few")
ORG = holding_id("report_templates/org.docx")


@pytest.fixture
def home(tmp_path: Path) -> Path:
    """A home with one template and a test of one real file, which lacks most of what a report tells."""
    lab = tmp_path / "lab"
    shutil.copytree(ROOT / "calibrations", lab / "calibrations")
    (lab / "report_templates").mkdir()
    for name in ("org.docx", "org.toml"):
        shutil.copy(ROOT / "report_templates" / name, lab / "report_templates")
    (lab / "tests" / "few").mkdir(parents=True)
    shutil.copy(example("fig4_4"), lab / "tests" / "few")
    (lab / "tests" / "few" / "test.toml").write_text('schema = 1\nmachine = "m15"\ndate = 2019-05-31\n')
    return lab


def previewed(bench: Served) -> None:
    page = done(bench, bench.send(f"/test/{TEST}/report/preview", {"template": ORG}))
    assert re.search(r'data-state="(clean|findings)"', page.body), plain(page.body)
    assert f"/test/{TEST}/report" in page.body


def picture(
    bench: Served, number: int, address: str = f"/test/{TEST}/report"
) -> tuple[int, str | None, bytes]:
    connection = http.client.HTTPConnection("127.0.0.1", bench.port, timeout=60)
    with contextlib.closing(connection):
        headers = {"Host": bench.guard.authority, "Cookie": bench.cookie}
        connection.request("GET", f"{bench.place}{address}/page/{number}.png", headers=headers)
        answer = connection.getresponse()
        return answer.status, answer.headers["content-type"], answer.read()[:6]


def test_a_template_is_seen_page_by_page_and_only_those_of_the_home(home: Path) -> None:
    with serving(home) as bench:
        pages = bench.page(f"/template/{ORG}/pages")
        count = pages.body.count("data-page=")
        assert (pages.status, count > 1) == (200, True)
        assert picture(bench, count, f"/template/{ORG}")[:2] == (200, "image/png")
        assert picture(bench, count + 9, f"/template/{ORG}")[0] == 400
        # It is printed once: what is there is shown again.
        (printed,) = (home / "jobs" / "templates").iterdir()
        before = printed.stat().st_mtime_ns
        assert bench.page(f"/template/{ORG}/pages").body == pages.body
        assert printed.stat().st_mtime_ns == before
        assert bench.page(f"/template/{TEST}/pages").status == 404
        assert picture(bench, 1, f"/template/{TEST}")[0] == 404


def test_a_report_is_seen_with_its_holes_before_it_is_issued(home: Path) -> None:
    turn = '<w:p><w:r><w:br w:type="page"/></w:r></w:p>'
    required = p("{{tk:report.id}}, {{tk:test.name}}, {{tk:calibration.id}}")
    body = required + turn + p("{{tk:tire.size}}, {{tk:test.operator}}")
    make(home / "report_templates", body, name="org.docx")
    with serving(home) as bench:
        assert "No preview was made yet" in bench.page(f"/test/{TEST}/report/part").body
        assert bench.page(f"/test/{TEST}/report/page/1.png").status == 404
        previewed(bench)
        folder = home / "jobs" / "previews" / TEST
        manifest = json.loads((folder / "manifest.json").read_text())
        assert manifest["missing"]
        part = bench.page(f"/test/{TEST}/report/part")
        assert f'data-missing="{len(manifest["missing"])}"' in part.body
        for tag in manifest["missing"]:
            assert f"<code>{tag}</code>" in part.body
        sheets = len(re.findall(r'class="sheet"', part.body))
        assert sheets > 1
        assert part.body.count('class="hole"') >= 1
        status, kind, begin = picture(bench, 1)
        assert (status, kind, begin) == (200, "image/png", b"\x89PNG\r\n")
        assert bench.page(f"/test/{TEST}/report/page/0.png").status == 404
        assert bench.page(f"/test/{TEST}/report/page/999.png").status == 400
        # A preview is no report: the test still has none.
        assert bench.page("/agenda/work").data(count="tests") == ["1"]

        issued = done(bench, bench.send(f"/test/{TEST}/report/issue", {"template": ORG}))
        assert 'data-state="refused"' in issued.body
        assert "--allow-missing" in issued.body
        assert not (home / "reports").exists()
        form = {"template": ORG, "holes": "yes"}
        issued = done(bench, bench.send(f"/test/{TEST}/report/issue", form))
        assert re.search(r'data-state="(clean|findings)"', issued.body), plain(issued.body)
        delivered = home / "reports" / "tests" / "few"
        assert {path.name for path in delivered.iterdir()} >= {"report.docx", "report.pdf", "manifest.json"}
        assert json.loads((delivered / "manifest.json").read_text())["ledger"] is not None
        assert bench.page("/agenda/work").data(count="tests") == ["0"]


def test_templates_say_what_template_check_says(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    template = home / "report_templates" / "org.docx"
    (home / "report_templates" / "broken.docx").write_bytes(b"no zip")
    (home / "report_templates" / "link.docx").symlink_to(template)
    with serving(home) as bench:
        page = bench.page("/templates")
        assert f'data-template="{ORG}"' in page.body
        assert "link.docx" not in page.body
        told = bench.page(f"/template/{ORG}/check")
        findings = command(capsys, "template", "check", template)["findings"]
        assert [*re.findall(r'data-rule="([^"]+)"', told.body)] == [one["rule"] for one in findings]
        broken = holding_id("report_templates/broken.docx")
        refused = bench.page(f"/template/{broken}/check", HX_Request="true")
        assert (refused.status, "broken.docx" in refused.body) == (400, True)


def test_a_test_is_offered_the_templates_of_reports_alone(home: Path) -> None:
    for name in ("certificate.docx", "plan.docx", "audit.docx", "pruefbericht.docx"):
        shutil.copy(ROOT / "report_templates" / name, home / "report_templates")
    (home / "report_templates" / "broken.docx").write_bytes(b"no zip")
    assert list(templates_of(home, "report").values()) == ["org.docx", "pruefbericht.docx"]
    assert list(templates_of(home, "plan").values()) == ["plan.docx"]
    with serving(home) as bench:
        body = bench.page(f"/test/{TEST}/report").body
        assert re.findall(r"<option[^>]*>([^<]*)</option>", body) == ["org.docx", "pruefbericht.docx"]
        other = {"template": holding_id("report_templates/certificate.docx")}
        assert bench.send(f"/test/{TEST}/report/preview", other).status == 404
        body = bench.page("/plans/list").body
        assert "plan.docx" in body
        assert "certificate.docx" not in body


def test_only_templates_and_tests_of_the_home_make_reports(home: Path) -> None:
    with serving(home) as bench:
        for template in ("org.docx", "../org.docx", "", holding_id("report_templates/org.toml")):
            answer = bench.send(f"/test/{TEST}/report/preview", {"template": template})
            assert answer.status == 404, template
        assert bench.send(f"/test/{TEST}/report/publish", {"template": ORG}).status == 404
        assert bench.page(f"/test/{holding_id('tests')}/report").status == 404
        assert bench.page("/template/org.docx/check").status == 404
    assert not (home / "jobs").exists()
