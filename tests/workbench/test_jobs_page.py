"""Jobs by their pages: an archive is audited, a wrong file seen, and repaired by who agrees to it."""

from __future__ import annotations

import re
import shutil
import time
from pathlib import Path

import pytest

from tests.workbench.conftest import ROOT, Answer, Served, plain, serving
from toolkit.files import sha256_file
from toolkit.lab.desk.holdings import archives_of, holding_id
from toolkit.lab.laboratory import example

ARCHIVE = holding_id("archive")


@pytest.fixture
def home(tmp_path: Path) -> Path:
    """A home with a real file whose Fy was computed with the wrong sign of E5."""
    shutil.copytree(ROOT / "calibrations", tmp_path / "lab" / "calibrations")
    test = tmp_path / "lab" / "archive" / "2019"
    test.mkdir(parents=True)
    shutil.copy(example("fig4_4"), test)
    (test / "test.toml").write_text('schema = 1\nmachine = "m15"\ndate = 2019-05-31\n')
    return tmp_path / "lab"


def done(bench: Served, started: Answer) -> Answer:
    """Return a job's page once it is over."""
    assert started.status == 303, plain(started.body)
    path = started.headers["location"].removeprefix(bench.place)
    end = time.monotonic() + 200
    while time.monotonic() < end:
        page = bench.page(f"{path}/state")
        if 'data-state="running"' not in page.body:
            return page
        time.sleep(0.1)
    raise AssertionError(plain(page.body))


def test_an_archive_is_audited_seen_and_repaired_with_consent(home: Path) -> None:
    original = home / "archive" / "2019" / "M15_fig4_4.xlsx"
    before = sha256_file(original)
    with serving(home) as bench:
        assert f'value="{ARCHIVE}"' in bench.page("/jobs").body
        page = done(bench, bench.send("/jobs/audit", {"archive": ARCHIVE}))
        assert 'class="bad" data-state="findings"' in page.body, "the file is wrong: nothing of it is good"
        assert 'class="bad" data-state="findings"' in bench.page("/jobs").body
        audit = re.search(r"/audit/([0-9a-f]{16})", page.body)
        assert audit is not None
        answer = bench.page(f"/audit/{audit[1]}/part/answer")
        assert answer.data(headline="wrong")[0] == "1"
        assert bench.send(f"/audit/{audit[1]}/repair", {}).status == 400
        assert not (home / "repaired").exists()
        page = done(bench, bench.send(f"/audit/{audit[1]}/repair", {"consent": "yes"}))
        assert "1 corrected copies" in page.body
        assert bench.page("/jobs").body.count("data-job=") == 2
    assert sha256_file(original) == before
    copies = [path for path in (home / "repaired" / "archive").rglob("*") if path.suffix in (".xlsx", ".csv")]
    assert len(copies) == 1


def test_a_second_job_is_told_what_runs_and_a_cancelled_one_says_so(home: Path) -> None:
    from toolkit.lab.desk.jobs import start_job

    with serving(home) as bench:
        job = start_job(home, kind="audit", title="waits", words=("open", ".", "--no-browser"))
        refused = bench.send("/jobs/audit", {"archive": ARCHIVE})
        assert refused.status == 400
        assert "audit of waits" in plain(refused.body)
        page = done(bench, bench.send(f"/job/{job}/cancel", {}))
        assert 'data-state="cancelled"' in page.body


def test_only_folders_of_the_home_are_audited_and_only_jobs_have_pages(home: Path) -> None:
    (home / "link").symlink_to("/etc")
    assert list(archives_of(home).values()) == ["archive"]
    with serving(home) as bench:
        for archive in ("archive", "../..", holding_id("calibrations"), holding_id("link"), ""):
            assert bench.send("/jobs/audit", {"archive": archive}).status == 404, archive
        for path in ("/job/..%2F..", "/job/20260101T000000-00000000", "/job/lock"):
            assert bench.page(path).status == 404, path
        assert bench.send(f"/audit/{holding_id('archive')}/repair", {"consent": "yes"}).status == 404
    assert not (home / "jobs").exists()


def test_a_job_that_was_interrupted_is_told_after_the_server_is_another_one(home: Path) -> None:
    from toolkit.lab.desk.jobs import FOLDER, Job, write_job

    place = home / FOLDER / "20260101T000000-00000001"
    place.mkdir(parents=True)
    write_job(place, Job(kind="audit", title="lost", words=("audit", "x"), started="2026-01-01T00:00:00Z"))
    with serving(home) as bench:
        assert 'data-state="interrupted"' in bench.page("/jobs").body
        page = bench.page(f"/job/{place.name}")
        assert (page.status, "hx-trigger" in page.body.split("<main")[1]) == (200, False)
