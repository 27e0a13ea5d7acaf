"""Homes, `init`, `doctor`, and the command's own manners."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests import commands
from toolkit.errors import ConfigError
from toolkit.lab.home import calibrations_folder, find_home
from toolkit.lab.upkeep import installation


def test_the_nearest_folder_upward_is_the_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("TOOLKIT_HOME", raising=False)
    (tmp_path / "calibrations").mkdir()
    deep = tmp_path / "a" / "b"
    deep.mkdir(parents=True)
    monkeypatch.chdir(deep)
    assert find_home() == tmp_path


def test_a_named_home_wins_over_the_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("one", "two"):
        (tmp_path / name / "calibrations").mkdir(parents=True)
    monkeypatch.setenv("TOOLKIT_HOME", str(tmp_path / "one"))
    assert find_home() == tmp_path / "one"
    assert find_home(tmp_path / "two") == tmp_path / "two"
    assert calibrations_folder(tmp_path / "two" / "calibrations") == tmp_path / "two" / "calibrations"


def test_no_home_is_an_error_that_names_init(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("TOOLKIT_HOME", raising=False)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigError, match="no laboratory home"):
        find_home()
    with pytest.raises(ConfigError):
        find_home(tmp_path)
    with pytest.raises(ConfigError):
        calibrations_folder(tmp_path / "nothing")


def test_init_makes_a_home_and_leaves_what_is_there(tmp_path: Path) -> None:
    home = tmp_path / "laboratory"
    code, answer = commands.answer("init", home)
    assert code == 0
    assert "report_templates/org.docx" in answer["written"]
    (home / "report_templates" / "org.docx").write_text("our own")
    assert commands.said("init", home).code == 0
    assert (home / "report_templates" / "org.docx").read_text() == "our own"
    assert list((home / "calibrations").iterdir()) == []


def test_doctor_names_the_command_that_mends(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "/nonexistent")
    monkeypatch.delenv("TOOLKIT_SOFFICE", raising=False)
    code, answer = commands.answer("doctor")
    assert code == 1
    assert installation.PACKAGES in answer["mend"]
    assert {c["name"] for c in answer["checks"] if not c["ok"]} >= {"soffice", "pdftotext"}


def test_doctor_looks_for_the_program_that_reports_use(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TOOLKIT_SOFFICE", str(tmp_path / "soffice"))
    code, answer = commands.answer("doctor")
    assert (code, answer["mend"]) == (1, "unset TOOLKIT_SOFFICE")
    assert [c["found"] for c in answer["checks"] if c["name"] == "soffice"] == [
        f"TOOLKIT_SOFFICE={tmp_path / 'soffice'}: no such file"
    ]


def test_doctor_finds_nothing_missing_after_set_up() -> None:
    code, answer = commands.answer("doctor")
    assert (code, answer["mend"]) == (0, None)


def test_wrong_words_end_with_2() -> None:
    assert commands.said("process").code == 2
    assert commands.said("nonsense").code == 2
    code, answer = commands.answer("process", "--nonsense", ".")
    assert (code, answer["error"]["rule"]) == (2, "usage")


def test_a_bug_ends_with_101(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installation, "_mending_command", lambda: 1 / 0)
    monkeypatch.setenv("PATH", "/nonexistent")
    code, _, error = commands.said("doctor")
    assert code == 101
    assert "this is a bug" in error
