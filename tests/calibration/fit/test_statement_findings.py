"""What a session states that cannot be, or that its own rows contradict."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.calibration.fit.test_readings import LEVELS, found, run, single

REFERENCE = '[reference.uncertainty]\nF = { U = %s, k = 2, unit = "N" }\n'


def relabelled(path: Path, change: Callable[[str], str]) -> Path:
    data = path.with_name("loads.csv")
    head, *rows = data.read_text().splitlines()
    data.write_text("\n".join([head, *(change(row) for row in rows)]) + "\n")
    return path


@pytest.mark.parametrize(
    ("stated", "level"),
    [
        ('{ value = 21, unit = "K" }', "error"),
        ('{ value = 200, unit = "degC" }', "error"),
        ('{ value = 35, unit = "degC" }', "note"),
    ],
)
def test_a_temperature_at_which_no_cell_works_is_an_error(tmp_path: Path, stated: str, level: str) -> None:
    (told,) = found(run(tmp_path, single(tmp_path / "s", temperature=stated)), "temperature")
    assert told.startswith(level)
    assert ("21 degC would be within" in told) == ("K" in stated)


def test_a_session_before_strain_gauges_is_an_error(tmp_path: Path) -> None:
    (told,) = found(run(tmp_path, single(tmp_path / "s", date="1926-01-05")), "session-date")
    assert told.startswith("error")
    assert not found(
        run(tmp_path, single(tmp_path / "t", date="1986-01-05", instrument='"b"')), "session-date"
    )


def test_no_standard_has_an_uncertainty_of_zero(tmp_path: Path) -> None:
    (told,) = found(run(tmp_path, single(tmp_path / "s", REFERENCE % "0.0")), "reference-zero")
    assert told.startswith("error F")
    quiet = run(tmp_path, single(tmp_path / "t", REFERENCE % "0.1", instrument='"b"'))
    assert not found(quiet, "reference-zero")


def test_labels_against_the_loads_are_told_and_right_ones_are_not(tmp_path: Path) -> None:
    assert not found(run(tmp_path, single(tmp_path / "s")), "direction")

    def swapped(row: str) -> str:
        return re.sub("up$|down$", lambda m: {"up": "down", "down": "up"}[m[0]], row)

    def all_up(row: str) -> str:
        return row.replace("down", "up")

    for name, change in (("a", swapped), ("b", all_up)):
        path = relabelled(single(tmp_path / name, instrument=f'"{name}"'), change)
        (told,) = found(run(tmp_path, path), "direction")
        assert told.startswith("warning")
    # Row 13 of the first run is the second one that falls: its neighbours lie on either side of it.
    assert LEVELS[12] < LEVELS[11] < LEVELS[10]
    assert "rows 12, 13" in told


def test_up_may_mean_larger_numbers_below_zero(tmp_path: Path) -> None:
    def negative(row: str) -> str:
        value, force, number, label = row.split(",")
        other = {"up": "down", "down": "up"}[label]
        return f"{-float(value)!r},{-float(force)!r},{number},{other}"

    path = relabelled(single(tmp_path / "s"), negative)
    assert not found(run(tmp_path, path), "direction")


def test_a_resolution_that_the_digits_contradict_is_told(tmp_path: Path) -> None:
    tail = '[cells.S]\nresolution = { value = %s, unit = "mV/V" }\n'
    made = run(tmp_path, single(tmp_path / "s", tail % "0.5"))
    (told,) = found(made, "resolution")
    # Readings scatter by 1e-6 mV/V; rounding to 0.5 makes 0.5 / sqrt(12) = 0.14 mV/V.
    assert told.startswith("warning S")
    assert "alone makes 0.14" in told
    # 0.5 mV/V at 500 N/(mV/V) in each of the readings: U is over a tenth of 1000 N.
    assert [line.split()[:2] for line in found(made, "coarse-uncertainty")] == [["error", "F:"]]


def test_readings_in_whole_steps_and_means_of_them_are_not_contradicted(tmp_path: Path) -> None:
    tail = '[cells.S]\nresolution = { value = %s, unit = "mV/V" }\n'

    def rounded(row: str) -> str:
        value, remainder = row.split(",", 1)
        return f"{round(float(value), 5):.5f},{remainder}"

    whole = relabelled(single(tmp_path / "s", tail % "0.00001"), rounded)
    assert not found(run(tmp_path, whole), "resolution")
    means = run(tmp_path, single(tmp_path / "t", tail % "0.000001", instrument='"b"'))
    assert [line[:4] for line in found(means, "resolution")] == ["note"]
