"""A migration: newer homes refused, own templates kept, nothing undone over somebody's work."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from toolkit.cli.main import run
from toolkit.errors import ConfigError
from toolkit.files import sha256_file
from toolkit.lab.home import TEMPLATES, make_home
from toolkit.lab.upkeep.migrate import migrate, undo

RELEASED = Path(__file__).parents[2] / "released" / "0.1.0.zip"


@pytest.fixture
def home(tmp_path: Path) -> Path:
    shutil.unpack_archive(RELEASED, tmp_path)
    return tmp_path / "home"


def states(home: Path) -> dict[str, str]:
    return {file.place: file.state for file in migrate(home)[0]["files"]}


def test_a_template_that_the_laboratory_changed_is_its_own_and_stays(home: Path) -> None:
    style = home / TEMPLATES / "org.toml"
    style.write_text(style.read_text() + "# ours\n")
    digest = sha256_file(style)
    assert states(home)[f"{TEMPLATES}/org.toml"] == "own"
    assert sha256_file(style) == digest


@pytest.mark.parametrize(
    ("place", "old", "new"),
    [
        ("tests/t1/test.toml", "schema = 1", "schema = 2"),
        ("diagnoses/d1/diagnosis.json", '"schema": 1', '"schema": 2'),
        ("calibrations/press-7/press-7-r1.json", '"schema": 1', '"schema": 2'),
    ],
)
def test_a_home_with_a_file_of_a_newer_version_is_refused_and_unchanged(
    place: str, old: str, new: str, home: Path
) -> None:
    text = (home / place).read_text()
    assert old in text
    (home / place).write_text(text.replace(old, new))
    before = {path: sha256_file(path) for path in home.rglob("*") if path.is_file()}
    with pytest.raises(ConfigError, match="newer version") as caught:
        migrate(home)
    assert caught.value.rule == "newer-home"
    assert place in str(caught.value.where)
    assert {path: sha256_file(path) for path in home.rglob("*") if path.is_file()} == before


def test_a_damaged_ledger_is_refused_and_never_mended(home: Path) -> None:
    head = home / "calibrations" / "press-7" / "head.json"
    head.unlink()
    assert states(home)["calibrations/press-7/press-7-r1.json"] == "refused"
    assert not head.exists()


def test_undoing_is_refused_where_a_file_has_changed_since(home: Path) -> None:
    migrate(home)
    style = home / TEMPLATES / "org.toml"
    style.write_text("# ours\n")
    with pytest.raises(ConfigError) as caught:
        undo(home)
    assert caught.value.rule == "migration-changed"
    assert style.read_text() == "# ours\n"


def test_a_new_home_has_nothing_to_migrate_and_nothing_to_undo(tmp_path: Path) -> None:
    make_home(tmp_path / "home")
    assert set(states(tmp_path / "home").values()) == {"current"}
    with pytest.raises(ConfigError, match="no migration"):
        undo(tmp_path / "home")


def test_the_command_tells_what_a_dry_run_would_do(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        run(["migrate", str(home), "--dry-run", "--json"])
    assert ended.value.code == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["dry_run"]
    assert answer["migration"] is None
    written_by = {file["kind"]: file["written_by"] for file in answer["files"]}
    assert written_by["calibration record"] == "0.1.0"
    assert not (home / "migrations").exists()
