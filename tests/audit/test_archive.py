"""An archive: every file once, the same answer with any number of workers, poison set aside."""

from __future__ import annotations

import datetime as dt
import json
import os
import shutil
import zipfile
from pathlib import Path

import pytest

from tests import commands
from tests.recording.fig4_4 import write_fig4_4
from toolkit.audit.archive import audit_archive, inventory
from toolkit.calibration.registry.registry import Registry
from toolkit.errors import ConfigError

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


def _shut(monkeypatch: pytest.MonkeyPatch, folder: Path, error: OSError) -> None:
    """Let a folder be one that nobody may list, or that is gone when it is listed."""
    scandir = os.scandir

    def listed(path):
        if Path(path) == folder:
            raise error
        return scandir(path)

    monkeypatch.setattr(os, "scandir", listed)


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (PermissionError(13, "Permission denied"), "Permission denied"),
        (FileNotFoundError(2, "No such file or directory"), "No such file or directory"),
    ],
)
def test_a_folder_that_cannot_be_listed_is_told_and_the_others_are_audited(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: OSError, said: str
) -> None:
    root = tmp_path / "archive"
    for name in ("a", "shut/below", "z"):
        (root / name).mkdir(parents=True)
        (root / name / "notes.txt").write_text("nothing to see\n")
    monkeypatch.chdir(tmp_path)
    _shut(monkeypatch, Path("archive/shut"), error)
    code, answer = commands.answer("audit", "archive", "--calibrations", HOME / "calibrations")
    assert code == 1
    assert [file["path"] for file in answer["files"]] == ["a/notes.txt", "z/notes.txt"]
    (finding,) = [one for one in answer["findings"] if one["rule"] == "unreadable-folder"]
    assert (finding["where"], finding["level"]) == ("shut", "warning")
    assert said in finding["message"]
    _, text, _ = commands.said("audit", "archive", "--calibrations", HOME / "calibrations")
    assert f"shut: {finding['message']}" in text


def test_an_archive_that_cannot_be_listed_cannot_be_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _shut(monkeypatch, tmp_path, PermissionError(13, "Permission denied"))
    with pytest.raises(ConfigError) as refusal:
        inventory(tmp_path)
    assert (refusal.value.rule, refusal.value.exit_code) == ("archive", 2)


def test_a_folder_of_reports_that_cannot_be_listed_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("archive", "reports/2019", "reports/shut"):
        (tmp_path / name).mkdir(parents=True)
    (tmp_path / "archive" / "notes.txt").write_text("nothing to see\n")
    (tmp_path / "reports" / "2019" / "tire A.pdf").write_bytes(b"x")
    monkeypatch.chdir(tmp_path)
    _shut(monkeypatch, Path("reports/shut"), PermissionError(13, "Permission denied", "reports/shut"))
    code, answer = commands.answer(
        "audit", "archive", "--reports", "reports", "--calibrations", HOME / "calibrations"
    )
    assert code == 1
    assert [report["report"] for report in answer["reports"]] == ["2019/tire A.pdf"]
    (finding,) = [one for one in answer["findings"] if one["level"] != "note"]
    assert (finding["rule"], finding["where"]) == ("unreadable-folder", "reports/shut")
