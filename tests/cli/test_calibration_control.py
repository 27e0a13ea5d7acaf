"""`toolkit calibration standard | chart | due` and `approve --recall`: JSON keys, exit codes, pictures."""

from __future__ import annotations

import datetime as dt
import json
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import typer

from tests import commands
from tests.built_once import built_once
from tests.calibration.control_factory import write_session
from toolkit.calibration.control.calibrate import calibrate
from toolkit.calibration.registry.approval import approve
from toolkit.calibration.registry.registry import Registry

Run = Callable[..., tuple[int, Any]]


def session(folder: Path, year: int, error: float) -> Path:
    """Write a session of a cell whose check load of 450 N is off by an error [N]."""
    resolution = "[cells.S]\nresolution = 0.0000001\n"
    return write_session(folder, dt.date(year, 3, 1), checks=(450.0,), check_errors=(error,), tail=resolution)


def _seven_years(home: Path) -> None:
    registry = Registry(home / "cal")
    for at, error in enumerate((0.0, 0.1, -0.1, 0.05, -0.05, 0.1, 0.8)):
        made = calibrate(session(home / f"s{at}", 2018 + at, error), registry)
        if at == 0:
            approve(registry, made.record.id, in_force_from=dt.date(2018, 3, 1), checked_by="B")


@pytest.fixture
def folder(tmp_path: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A registry of seven sessions; the newest check load is far off those before it."""
    seven_years = built_once(tmp_path_factory, "seven-years", _seven_years)
    return Path(shutil.copytree(seven_years / "cal", tmp_path / "cal"))


@pytest.fixture
def run(folder: Path) -> Run:
    return lambda *words: commands.answer("calibration", *words, "--calibrations", folder)


def test_the_chart_finds_the_newest_session_and_draws_it(run: Run, tmp_path: Path) -> None:
    picture = tmp_path / "chart.png"
    code, answer = run("chart", "cell", "--out", picture)
    assert (code, answer["schema"], answer["instrument"]) == (1, 1, "cell")
    (series,) = answer["series"]
    assert series["check_load"] == [{"load": "FY", "value": 450.0, "unit": "N"}]
    assert [point["record"] for point in series["points"]] == ["cell-r1"] * 6
    assert series["breaks"] == [{"rule": 1, "text": "one point beyond 3 sigma", "session": "cell-r7"}]
    assert answer["findings"][0]["rule"] == "chart"
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_the_svg_is_the_same_each_time(run: Run, tmp_path: Path) -> None:
    for name in ("a.svg", "b.svg"):
        assert run("chart", "cell", "--out", tmp_path / name)[0] == 1
    content = (tmp_path / "a.svg").read_bytes()
    assert b"<svg" in content
    assert content == (tmp_path / "b.svg").read_bytes()


@pytest.mark.parametrize(
    ("words", "rule"),
    [
        (["cell", "--out", "chart.pdf"], "output-name"),
        (["nothing"], "missing"),
        (["cell", "--load", "MZ"], "no-chart"),
    ],
)
def test_a_chart_that_cannot_be_made_is_exit_2(run: Run, words: list[str], rule: str) -> None:
    code, answer = run("chart", *words)
    assert (code, answer["error"]["rule"]) == (2, rule)
    assert all(answer["error"][part] for part in ("what", "where", "got", "expected", "next_step"))


def test_due_is_a_note_until_an_interval_is_set_and_exit_1_when_overdue(run: Run, folder: Path) -> None:
    code, answer = run("due", "--on", "2018-06-01")
    assert (code, answer["findings"][0]["rule"]) == (0, "recall-unknown")
    code, approved = run(
        "approve", "cell-r1", "--in-force-from", "2018-03-01", "--checked-by", "B", "--recall", "1 year",
        "--reason", "interval set",
    )  # fmt: skip
    assert (code, approved["recall"]) == (0, "1 year")
    assert run("history", "cell-r1")[1]["events"][-1]["recall"] == "1 year"
    code, answer = run("due", "cell", "--on", "2019-03-01")
    row = answer["instruments"][0]
    assert (code, row["due"], row["days_left"], row["overdue"]) == (0, "2019-03-01", 0, False)
    code, answer = run("due", "cell", "--on", "2019-03-04")
    assert (code, answer["instruments"][0]["days_left"]) == (1, -3)
    assert answer["findings"][0]["rule"] == "overdue"
    words = ("calibration", "due", "--on", "2019-03-04", "--calibrations", folder)
    assert "2019-03-01" in commands.said(*words).out


def test_due_before_any_record_was_in_force(run: Run) -> None:
    assert run("due", "cell", "--on", "2017-01-01")[0] == 2
    code, answer = run("due", "--on", "2017-01-01")
    assert (code, answer["instruments"]) == (1, [])
    assert answer["findings"][0]["rule"] == "no-record-in-force"


def test_a_recall_that_is_no_interval_is_exit_2(run: Run) -> None:
    code, answer = run(
        "approve", "cell-r2", "--in-force-from", "2019-03-01", "--checked-by", "B", "--recall", "soon"
    )
    assert (code, answer["error"]["rule"]) == (2, "recall")


def test_the_standards_of_a_record(run: Run, folder: Path) -> None:
    code, answer = run("standard", "cell-r1", "--standard", "e74")
    (one,) = answer["evaluations"]
    assert (code, one["class"], one["result"]["points"], one["result"]["runs"]) == (0, "AA", 30, 3)
    code, answer = run("standard", "cell-r1", "--standard", "iso376", "--preloads", "3")
    assert (code, answer["evaluations"][0]["class"]) == (0, None)
    assert any("rotation" in reason for reason in answer["evaluations"][0]["reasons"])
    for standard in ("e74", "iso376"):
        words = ("standard", "cell-r1", "--standard", standard, "--calibrations", folder)
        assert "lass" in commands.said("calibration", *words).out


@pytest.mark.parametrize(
    "words",
    [
        ["cell-r1", "--standard", "e75"],
        ["cell-r1", "--standard", "e74", "--load", "FX"],
        ["cell-r99", "--standard", "e74"],
    ],
)
def test_a_standard_that_cannot_be_applied_is_exit_2(run: Run, words: list[str]) -> None:
    code, answer = run("standard", *words)
    assert code == 2
    assert all(answer["error"][part] for part in ("what", "where", "expected", "next_step", "rule"))


def test_the_commands_import_nothing_heavy() -> None:
    import subprocess

    code = "import sys, toolkit.cli.calibration; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert not {"numpy", "matplotlib", "scipy"} & set(loaded.split())


def test_calibrate_answers_with_the_standards_and_what_the_history_says(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from toolkit.cli import calibrate as command

    root = typer.Typer()
    root.command()(command.command)
    path = session(tmp_path / "newest", 2026, -0.9)
    words = [str(path), "--calibrations", str(folder), "--json"]
    assert root(args=words, standalone_mode=False) == 1
    answer = json.loads(capsys.readouterr().out)
    assert "chart" in [one["rule"] for one in answer["findings"]]
    assert [one["standard"] for one in answer["standards"]] == ["e74", "iso376"]
    assert answer["standards"][0]["class"] == "AA"
