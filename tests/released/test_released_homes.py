"""`toolkit migrate` walks the home of every release: checked, converted, done twice, undone."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from toolkit.errors import RecordingError
from toolkit.files import sha256_file
from toolkit.lab.home import TEMPLATES, packaged_home
from toolkit.lab.upkeep.kept_files import MIGRATIONS
from toolkit.lab.upkeep.migrate import migrate, undo
from toolkit.testfile import read_test_file

RELEASES = sorted(Path(__file__).parent.glob("*.zip"))


@pytest.fixture(params=RELEASES, ids=lambda path: path.stem)
def home(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """A release's home with its case and its reduced test in it."""
    shutil.unpack_archive(request.param, tmp_path)
    shutil.move(tmp_path / "case", tmp_path / "home" / "case")
    shutil.move(tmp_path / "test.xlsx", tmp_path / "home" / "test.xlsx")
    return tmp_path / "home"


def contents(home: Path) -> dict[str, str]:
    files = (path for path in home.rglob("*") if path.is_file())
    return {
        path.relative_to(home).as_posix(): sha256_file(path)
        for path in files
        if MIGRATIONS not in path.relative_to(home).parts
    }


def states(run: Callable[[], tuple[object, str]]) -> dict[str, str]:
    answer, _ = run()
    assert isinstance(answer, dict)
    return {file.place: file.state for file in answer["files"]}


def test_a_home_is_checked_converted_left_alone_and_put_back(home: Path) -> None:
    before = contents(home)
    looked = states(lambda: migrate(home, dry_run=True))
    assert contents(home) == before
    assert {
        looked[f"calibrations/{name}.json"] for name in ("press-7/press-7-r1", "m15-virtual/m15-virtual-r1")
    } == {"current"}
    assert {looked["test.xlsx"], looked["case/CASE.toml"], looked["case/answer/model.toml"]} == {"current"}
    assert set(looked.values()) <= {"current", "to migrate"}
    shipped = {place for place, state in looked.items() if state == "to migrate"}

    done = states(lambda: migrate(home))
    assert {place for place, state in done.items() if state == "migrated"} == shipped
    after = contents(home)
    assert {place for place in before if before[place] != after[place]} == shipped
    assert {after[place] for place in shipped} == {
        sha256_file(packaged_home() / TEMPLATES / Path(place).name) for place in shipped
    }

    assert set(states(lambda: migrate(home)).values()) == {"current"}
    assert contents(home) == after
    if shipped:
        undo(home)
        assert contents(home) == before


def test_the_templates_of_0_1_0_become_todays(tmp_path: Path) -> None:
    shutil.unpack_archive(Path(__file__).with_name("0.1.0.zip"), tmp_path)
    looked = states(lambda: migrate(tmp_path / "home", dry_run=True))
    assert {place for place, state in looked.items() if state == "to migrate"} == {
        f"{TEMPLATES}/{name}" for name in ("certificate.docx", "org.docx", "org.toml")
    }


def test_a_reduced_test_of_the_first_builds_is_told_as_such_and_not_as_changed(tmp_path: Path) -> None:
    shutil.unpack_archive(Path(__file__).with_name("0.1.0.zip"), tmp_path)
    with pytest.raises(RecordingError) as caught:
        read_test_file(tmp_path / "older_test.xlsx")
    assert caught.value.rule == "older-test-file"
