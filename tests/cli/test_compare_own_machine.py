"""A test on a machine of its own definition is used from any folder, by commands that read whole tests."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import Any

import pytest

from tests import commands
from tests.cli.test_compare import maker
from toolkit.lab.desk.holdings import Reported, holdings_of, rows_of_tests
from toolkit.lab.home import packaged_home
from toolkit.machine.definition import machine_file

CALIBRATIONS = packaged_home() / "calibrations"


def toolkit(*words: object) -> tuple[int, dict[str, Any]]:
    return commands.answer(*words, "--calibrations", CALIBRATIONS)


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory, virtual_test: Path) -> Path:
    """A folder with a machine's definition, a test that names it by its path, and the test reduced there."""
    folder = tmp_path_factory.mktemp("own")
    (folder / "machines").mkdir()
    # Windows writes lines so; the definition's own text says nothing else than the packaged one.
    text = machine_file("m15-virtual").read_text().replace("\n", "\r\n")
    (folder / "machines" / "own rig.toml").write_bytes(text.encode())
    shutil.copytree(virtual_test, folder / "test")
    toml = folder / "test" / "test.toml"
    toml.write_text(toml.read_text().replace('"m15-virtual"', '"../machines/own rig.toml"'))
    before = Path.cwd()
    os.chdir(folder)
    try:
        assert toolkit("process", "test", "--out", "reduced.xlsx")[0] in (0, 1)
    finally:
        os.chdir(before)
    return folder


def test_a_reduced_test_is_compared_without_its_machines_file(
    home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    moved = tmp_path / "elsewhere"
    moved.mkdir()
    shutil.copy(home / "reduced.xlsx", moved / "a.xlsx")
    monkeypatch.chdir(moved)
    table = maker(moved / "maker.csv")
    assert toolkit("compare", "a.xlsx", table)[0] in (0, 1)


@pytest.mark.campaign(
    "a plan of another laboratory's machine: a plan by the virtual one is made in every run"
)
def test_a_reduced_test_is_planned_by_without_its_machines_file(
    home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copy(home / "reduced.xlsx", tmp_path / "a.xlsx")
    code, planned = toolkit("plan", "test", "--like", "a.xlsx", "--u", "conicity", "--load", "833 lbf")
    assert (code, planned["machine"]) == (0, "m15-virtual")


@pytest.mark.campaign("a plan by the folder of the test: a plan by the virtual machine is made in every run")
def test_a_test_by_a_path_is_planned_by(home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    asked = ("--u", "conicity", "--load", "833 lbf", "--out", "p")
    assert toolkit("plan", "test", "--like", home / "test", *asked)[0] == 0
    assert 'machine = "m15-virtual"' in (tmp_path / "p" / "plan.toml").read_text()


def test_the_workbench_names_the_machine_and_no_path(home: Path) -> None:
    holdings = holdings_of(home)
    rows = list(rows_of_tests(holdings, holdings.places["test"], Reported()))
    assert [row["machine"] for row in rows] == ["m15-virtual"]
