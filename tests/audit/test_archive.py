"""An archive: every file once, the same answer with any number of workers, poison set aside."""

from __future__ import annotations

import datetime as dt
import json
import shutil
import zipfile
from pathlib import Path

import pytest

from tests import commands
from tests.recording.fig4_4 import write_fig4_4
from toolkit.audit.archive import audit_archive
from toolkit.calibration.registry.registry import Registry

HOME = Path(__file__).resolve().parents[2]
DATED = 'schema = 1\nmachine = "m15"\ndate = 2019-03-01\n'


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    root = tmp_path_factory.mktemp("archive")
    dated, undated = root / "2019" / "run", root / "loose"
    for folder in (dated, undated):
        folder.mkdir(parents=True)
    written = write_fig4_4(dated)
    (root / "2019" / "test.toml").write_text(DATED)
    shutil.copy(written[0], undated / "copy of a run")
    data = written[0].read_bytes()
    (root / "cut.xlsx").write_bytes(data[: len(data) // 2])
    (root / "empty").write_bytes(b"")
    (root / "notes.txt").write_text("nothing to see\n")
    (root / "own.json").write_text(json.dumps({"generator": "toolkit", "n": 1}))
    with zipfile.ZipFile(root / "bomb.xlsx", "w", zipfile.ZIP_DEFLATED) as bomb:
        bomb.writestr("xl/workbook.xml", b" " * (400 << 20))
    (root / "link.xlsx").symlink_to(written[0])
    return root


@pytest.fixture(scope="module")
def audited(archive):
    return audit_archive(archive, Registry(HOME / "calibrations"), known_at=dt.date(2026, 1, 1))


def test_every_regular_file_stands_once_and_links_and_own_results_do_not(archive, audited):
    assert [one.path for one in audited.files] == sorted(
        path.relative_to(archive).as_posix()
        for path in archive.rglob("*")
        if path.is_file() and not path.is_symlink() and path.name not in ("test.toml", "own.json")
    )


def test_the_recording_of_figure_4_4_was_computed_by_the_withdrawn_record(audited):
    dated = [one for one in audited.files if one.path.startswith("2019/")]
    assert dated
    for one in dated:
        assert (one.grade, one.record, one.in_force) == (
            "stale",
            "m15-r1",
            "m15-r2",
        )
        # the largest change is 2 |E5 coefficient| times the largest |E5| of the ten printed rows, in N
        E5 = 497.59  # lbf, printed in Figure 4.4
        assert one.repair.FY_max_abs_N == pytest.approx(2 * 1.0228 * E5 * 4.4482216152605, rel=1e-3)


def test_a_void_record_is_stale_without_a_date_too(audited):
    (loose,) = [one for one in audited.files if one.path.startswith("loose/")]
    assert (loose.grade, loose.date, loose.in_force, loose.repair) == (
        "stale",
        None,
        None,
        None,
    )
    assert audited.undated == 1


def test_what_cannot_be_read_is_set_aside_with_the_rule_first(audited):
    reasons = {one.path: one.reason for one in audited.files if one.grade == "unreadable"}
    assert set(reasons) == {"cut.xlsx", "empty", "bomb.xlsx"}
    assert [one.path for one in audited.files if one.grade == "no_recording"] == ["notes.txt"]
    assert reasons["bomb.xlsx"].startswith("inflation")
    assert reasons["cut.xlsx"].startswith("zip-truncated")
    assert all(":" in reason for reason in reasons.values())


def test_two_workers_give_the_same_answer(archive, audited):
    again = audit_archive(archive, Registry(HOME / "calibrations"), known_at=dt.date(2026, 1, 1), workers=2)
    assert again == audited


def test_a_test_toml_that_cannot_be_used_hides_no_recording(tmp_path):
    write_fig4_4(tmp_path)
    (tmp_path / "test.toml").write_text("date = 'some day'\n")
    made = audit_archive(tmp_path, Registry(HOME / "calibrations"))
    assert {one.grade for one in made.files} == {"stale"}
    # Figure 4.4 as it stands: its Fy is 1.5 of the load at -0.3 deg, whatever calibration wrote it.
    rules = {"test-toml", "identified-stale", "impossible-force"}
    assert {one.rule for one in made.findings if one.level != "note"} == rules


def test_the_command_answers_in_json_and_ends_with_1_where_a_file_is_not_right(archive):
    code, answer = commands.answer("audit", archive, "--calibrations", HOME / "calibrations")
    assert code == 1
    assert answer["schema"] == 1
    assert sum(answer["summary"]["grades"].values()) == answer["summary"]["files"] == len(answer["files"])
    assert "timing" in answer


def test_an_archive_that_is_no_folder_is_refused(tmp_path):
    from toolkit.errors import ConfigError

    with pytest.raises(ConfigError, match="archive"):
        audit_archive(tmp_path / "none", Registry(HOME / "calibrations"))
