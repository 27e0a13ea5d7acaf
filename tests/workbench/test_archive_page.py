"""An archive's page: its first line, windows of its files, one file; only ids and numbers lead there."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.benchmarks.archive_factory import KNOWN_AT, make_archive
from tests.workbench.conftest import Served, plain, serving
from toolkit.lab.desk.holdings import holding_id
from toolkit.lab.laboratory import open_laboratory

ALL = holding_id("audits/all")


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """A server of a home with an audit."""
    home = tmp_path_factory.mktemp("archived") / "lab"
    made = make_archive(home, files=40, rows=100)
    if made.calibrations != home / "calibrations":
        made.calibrations.rename(home / "calibrations")
    open_laboratory(calibrations=home / "calibrations").audit_archive(
        made.folder, out=home / "audits" / "all", known_at=KNOWN_AT
    )
    with serving(home) as bench:
        yield bench


def lines(bench: Served) -> list[dict[str, object]]:
    text = (bench.home / "audits" / "all" / "audit.jsonl").read_text()
    return [json.loads(line) for line in text.splitlines()[1:]]


def test_the_audits_of_a_home_are_listed_with_their_state(archive: Served) -> None:
    page = archive.page("/audits/list")
    assert f'data-audit="{ALL}"' in page.body
    assert "audits/all finished" in plain(page.body)


def test_the_first_line_answers(archive: Served) -> None:
    part = archive.page(f"/audit/{ALL}/part/answer")
    answers = lines(archive)
    changed = [
        line for line in answers
        if line["grade"] not in ("exact", "rounding") and line["repair"] and any(line["repair"].values())  # type: ignore[attr-defined]
    ]  # fmt: skip
    # Where the cells may be what is wrong, nothing says that Fy and Mz are.
    wrong = [line for line in changed if line["sides"] is None or line["sides"]["side"] == "forces"]  # type: ignore[index]
    assert 0 < len(wrong) < len(changed)
    assert int(part.data(headline="wrong")[0]) == len(wrong)
    assert part.data(headline="disputed") == [str(len(changed) - len(wrong))]
    largest = max(line["repair"]["FY_max_abs_N"] for line in wrong)  # type: ignore[index]
    assert float(part.data(headline="wrong")[1]) == largest
    assert re.search(
        r"files? carr(y|ies) a wrong Fy or Mz, up to .* cause: .* from \d{4}-\d\d to", plain(part.body)
    )
    for grade in {str(line["grade"]) for line in answers}:
        assert int(part.data(count=grade)[0]) == sum(line["grade"] == grade for line in answers)
    assert part.body.count("<svg") == 1


def test_windows_hold_every_file_once(archive: Served) -> None:
    windows = archive.page(f"/audit/{ALL}/windows?order=path")
    assert windows.data(count="files") == [str(len(lines(archive)))]
    rows = archive.page(f"/audit/{ALL}/window/0?order=path")
    assert re.findall(r'data-file="(\d+)"', rows.body) == [str(n) for n in range(len(lines(archive)))]
    only = archive.page(f"/audit/{ALL}/windows?grade=stale&grade=nonsense")
    assert only.data(count="files") == [str(sum(line["grade"] == "stale" for line in lines(archive)))]
    beyond = archive.page(f"/audit/{ALL}/window/9999")
    assert (beyond.status, "data-file" in beyond.body) == (200, False)


def test_a_file_stands_beside_the_record_in_force(archive: Served) -> None:
    answers = lines(archive)
    at = next(n for n, line in enumerate(answers) if line["grade"] == "sign_variant")
    page = archive.page(f"/audit/{ALL}/file/{at}")
    repair = answers[at]["repair"]
    assert {repair["FY_max_abs_N"], repair["MZ_max_abs_Nm"]} <= {float(v) for v in page.data()}  # type: ignore[index]
    assert page.body.count("data-curves") == 2
    assert str(answers[at]["variant"]) in page.body
    unreadable = next((n for n, line in enumerate(answers) if line["grade"] == "unreadable"), None)
    if unreadable is not None:
        assert archive.page(f"/audit/{ALL}/file/{unreadable}").status == 200


def test_only_ids_and_numbers_have_pages(archive: Served) -> None:
    for path in (
        "/audit/all", f"/audit/{holding_id('audits')}", f"/audit/{ALL}/file/100000", f"/audit/{ALL}/file/-1",
        f"/audit/{ALL}/file/x", f"/audit/{ALL}/part/x", "/audit/..%2Faudits%2Fall/part/answer",
    ):  # fmt: skip
        assert archive.page(path).status == 404, path


def test_an_answer_that_cannot_be_read_says_so(archive: Served) -> None:
    folder: Path = archive.home / "audits" / "broken"
    folder.mkdir()
    (folder / "audit.jsonl").write_text("no json\n")
    broken = archive.page(f"/audit/{holding_id('audits/broken')}/part/answer", HX_Request="true")
    assert broken.status == 400
    assert "cannot be read" in broken.body
    (folder / "audit.jsonl").unlink()
    folder.rmdir()
