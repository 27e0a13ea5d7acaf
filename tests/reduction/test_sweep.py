"""Recordings in time on their way: named in test.toml, cut at small slip, processed, kept, read again."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from toolkit.cli.main import run
from toolkit.errors import ToolkitError
from toolkit.lab.home import packaged_home
from toolkit.lab.tire_tests.resolve import Basis, Resolved, resolve_test
from toolkit.simulation.plan import read_plan
from toolkit.simulation.run import simulate
from toolkit.simulation.write import write_test
from toolkit.testfile import read_test_file, write_test_file
from toolkit.testfile.layout import content_hash

LENGTH = 0.45
STEPS = (0, 1, -1, 2, -2, 4, -4, 6)
PLAN = """schema = 1
kind = "test"
date = 2026-03-18
machine = "m15-virtual"
seed = 7
slip_angles = { value = [0, 1, -1, 2, -2, 4, -4, 6], unit = "deg" }
loads = { value = [833], unit = "lbf" }
rotations = ["forward"]
effects = ["relaxation=0.45m"]
"""
SWEEP = """[[run]]
sweep = true
slip_angles = {{ value = [1.4, -1.4, 1.4, -1.4, 0], unit = "deg" }}
speed = {{ value = {speed}, unit = "km/h" }}
steer_rate = {{ value = {rate}, unit = "deg/s" }}
dwell = {{ value = 0.02, unit = "s" }}
"""


def made(folder: Path, *speeds: float) -> Path:
    """Return a test at one load, of settled steps and a sweep at each speed [km/h]."""
    settled = "".join(f'[[run]]\nslip_angles = {{ value = [{angle}], unit = "deg" }}\n' for angle in STEPS)
    swept = "".join(SWEEP.format(speed=speed, rate=speed / 6) for speed in speeds)
    path = folder / "plan.toml"
    path.write_text(PLAN + settled + swept, encoding="utf-8")
    write_test(simulate(read_plan(path)), folder / "test")
    return folder / "test"


def resolved(folder: Path) -> Resolved:
    return resolve_test(folder, Basis(calibrations=packaged_home() / "calibrations"))


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made(tmp_path_factory.mktemp("swept"), 4.0, 12.0)


def test_sweeps_give_the_length_and_no_condition(swept: Path, tmp_path: Path) -> None:
    result = resolved(swept).result
    assert len(result.reduced.conditions) == len(STEPS)
    (row,) = result.characteristics.of("relaxation_length")
    assert row.estimate is not None
    # The length is that at the tire's nominal load, of 4000 N; it goes with the stiffness.
    assert row.estimate.value == pytest.approx(LENGTH, rel=0.06)
    assert {round(3.6 * sweep.speed_m_s) for sweep in result.characteristics.sweeps} == {4, 12}
    path = tmp_path / "test.xlsx"
    write_test_file(path, result)
    again = read_test_file(path)
    assert again.characteristics.sweeps == result.characteristics.sweeps
    assert content_hash(again) == content_hash(result)
    assert again.characteristics.of("relaxation_length") == result.characteristics.of("relaxation_length")


def test_the_answer_has_each_sweep(swept: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        run(["process", str(swept), "--json", "--calibrations", str(packaged_home() / "calibrations")])
    answer = json.loads(capsys.readouterr().out)
    assert [sweep["file"] for sweep in answer["sweeps"]] == ["FM_run_10.xlsx", "FM_run_9.xlsx"]
    (entry,) = answer["characteristics"]["transient"]
    lengths = [sweep["apparent_length"]["value"] for sweep in answer["sweeps"]]
    assert entry["relaxation_length"]["value"] == pytest.approx(np.mean(lengths), rel=0.05)


def test_a_sweep_without_time_is_named(swept: Path, tmp_path: Path) -> None:
    test = made(tmp_path, 4.0)
    text = (test / "test.toml").read_text(encoding="utf-8")
    # One of the settled recordings, whose files have no column of time.
    named = text.replace(
        '"FM_run_9.xlsx" =', '"FM_run_8.xlsx" = { value = 4, unit = "km/h" }\n"FM_run_9.xlsx" ='
    )
    (test / "test.toml").write_text(named, encoding="utf-8")
    result = resolved(test).result
    unused = [finding for finding in result.findings if finding.rule == "sweep-unused"]
    assert [finding.where for finding in unused] == ["FM_run_8.xlsx"]
    assert "t [s]" in unused[0].message
    assert "sweep-one-speed" in {finding.rule for finding in result.findings}


def test_a_file_that_is_not_there_and_a_test_of_sweeps_alone_are_refused(tmp_path: Path) -> None:
    test = made(tmp_path, 4.0)
    text = (test / "test.toml").read_text(encoding="utf-8")
    (test / "test.toml").write_text(text.replace("FM_run_9", "FM_run_99"), encoding="utf-8")
    with pytest.raises(ToolkitError, match="names a file that is not there"):
        resolved(test)
    (test / "test.toml").write_text(text, encoding="utf-8")
    for number in range(1, 9):
        (test / f"FM_run_{number}.xlsx").unlink()
    with pytest.raises(ToolkitError, match="every recording of the test is a sweep"):
        resolved(test)


def test_moves_that_roll_too_little_near_zero_say_nothing(tmp_path: Path) -> None:
    # From one side to the other at 4 deg/s and 4 km/h: 3 deg take 0.75 s, in which 0.8 m are rolled.
    plan = (PLAN + SWEEP.format(speed=4, rate=4)).replace("[1.4, -1.4, 1.4, -1.4, 0]", "[6, -6, 6, -6, 6]")
    settled = "".join(f'[[run]]\nslip_angles = {{ value = [{angle}], unit = "deg" }}\n' for angle in STEPS)
    (tmp_path / "plan.toml").write_text(plan + settled, encoding="utf-8")
    write_test(simulate(read_plan(tmp_path / "plan.toml")), tmp_path / "test")
    result = resolved(tmp_path / "test").result
    (finding,) = (finding for finding in result.findings if finding.rule == "sweep-unused")
    assert "3 m are rolled" in finding.message
    assert result.characteristics.sweeps == ()
