"""A template and a case handed in through their pages: kept and told about, or refused there."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.lab.desk.test_uploads import CASE, ORG, contents
from tests.workbench.conftest import Answer, Served, serving
from toolkit.lab.desk.holdings import holding_id
from toolkit.lab.desk.previews import template_findings
from toolkit.lab.desk.versions import version_of
from toolkit.trust.people import Person
from toolkit.workbench.app import application
from toolkit.workbench.guard import Keys


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Served]:
    (tmp_path / "home" / "calibrations").mkdir(parents=True)
    with serving(tmp_path / "home") as served:
        yield served


def sent(bench: Served, path: str, files: list[tuple[str, bytes]], **fields: str) -> Answer:
    return bench.upload(path, [("files", name, data) for name, data in files], **fields)


def test_a_template_is_kept_and_its_page_says_what_template_check_says(bench: Served) -> None:
    answer = sent(bench, "/templates", [("own.docx", ORG)])
    own = holding_id("report_templates/own.docx")
    assert (answer.status, answer.headers["location"]) == (303, f"{bench.place}/templates#{own}")
    assert f'id="{own}"' in bench.page("/templates").body
    findings = template_findings(bench.home / "report_templates" / "own.docx")
    told = bench.page(f"/template/{own}/check").body
    assert re.findall(r'data-rule="([^"]+)"', told) == [finding["rule"] for finding in findings]
    again = sent(bench, "/templates", [("own.docx", ORG + b"x")])
    assert (again.status, "consent to replace it" in again.body) == (400, True)
    assert contents(bench.home) == {"report_templates/own.docx": ORG}


def test_a_template_that_was_replaced_meanwhile_is_not_replaced_unseen(bench: Served) -> None:
    sent(bench, "/templates", [("own.docx", ORG)])
    (bench.home / "report_templates" / "own.toml").write_text("")
    old = version_of(bench.home / "report_templates")
    assert f'name="version" value="{old}"' in bench.page("/templates").body
    (bench.home / "report_templates" / "own.toml").write_text("# another\n")
    refused = sent(bench, "/templates", [("own.docx", ORG)], replace="yes", version=old)
    assert (refused.status, "SHA-256" in refused.body) == (409, False), "the two are the same"
    style = sent(bench, "/templates", [("own.docx", ORG), ("own.toml", b"")], replace="yes", version=old)
    assert (style.status, "SHA-256" in style.body) == (409, True)
    assert (bench.home / "report_templates" / "own.toml").read_text() == "# another\n"
    now = version_of(bench.home / "report_templates")
    assert sent(bench, "/templates", [("own.docx", ORG)], replace="yes", version=now).status == 303
    assert sent(bench, "/templates", [("new.docx", ORG)]).status == 303, "it replaces nothing"


def test_what_is_no_template_is_refused_on_the_page(bench: Served) -> None:
    answer = sent(bench, "/templates", [("own.docx", b"no zip")])
    assert (answer.status, "own.docx" in answer.body, 'type="file"' in answer.body) == (400, True, True)
    assert contents(bench.home) == {}


def test_a_case_is_kept_and_can_be_diagnosed(bench: Served) -> None:
    answer = sent(bench, "/diagnoses", CASE)
    case = holding_id("cases/case-1")
    assert (answer.status, answer.headers["location"]) == (303, f"{bench.place}/diagnoses#{case}")
    assert f"/case/{case}/diagnose" in bench.page("/diagnoses/list").body
    refused = sent(bench, "/diagnoses", CASE[:2])
    assert (refused.status, "r0.csv" in refused.body) == (400, True)


def test_a_case_comes_from_this_computer_alone(bench: Served) -> None:
    # A case brings code that may read whatever the server's user reads.
    keys = Keys()
    person = Person(id="anna", name="Anna", roles=("head",), keys=())
    bench.guard.app, bench.guard.keys = application(bench.home, bench.registry, keys, person=person), keys
    bench.cookie = f"toolkit={keys.cookie}"
    assert "case.toml and every file" not in bench.page("/diagnoses").body
    assert sent(bench, "/diagnoses", CASE).status == 404
    assert bench.upload("/case", [("recordings", *CASE[2])], kind="columns").status == 404
    assert sent(bench, "/templates", [("own.docx", ORG)]).status == 303
    assert not (bench.home / "cases").exists()
