"""A continuous test is split into what was planned, and a sweep's two directions cancel their lag."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.tires.test_field_file import CONDITIONS, SWEEP, TAU_S, belt_test, truth, write_mat
from toolkit.errors import ToolkitError
from toolkit.tires.field_file import read_field_file
from toolkit.tires.sweeps import Sweeps, levels, split, split_file


@pytest.fixture(scope="module")
def sweeps(tmp_path_factory: pytest.TempPathFactory) -> Sweeps:
    return split_file(write_mat(tmp_path_factory.mktemp("field") / "run.mat", belt_test()))


def test_every_condition_of_the_plan_is_found_with_both_directions(sweeps: Sweeps) -> None:
    found = {
        (round(np.degrees(s.inclination_rad or 0), 1), round((s.pressure_Pa or 0) / 1e3), round(s.load_N, -2))
        for s in sweeps.sweeps
    }
    assert found == {(ia, p, fz) for ia, p, fz in CONDITIONS}
    for direction in ("up", "down"):
        assert sum(s.direction == direction for s in sweeps.sweeps) == len(CONDITIONS)
    assert sum(s.samples for s in sweeps.sweeps) + sweeps.left_out == sweeps.samples
    assert 0 < sweeps.left_out < 0.2 * sweeps.samples  # the ways between levels, and no more


def test_the_two_directions_cancel_the_lag_that_each_has(sweeps: Sweeps) -> None:
    table = sweeps.table
    near = np.abs(table["SA"]) < np.radians(1.0)
    expected = truth(table["SA"], table["FZ"], table["IA"], table["P"])
    error = (table["FY"] - expected)[near]
    slope = -(truth(1e-4, 1000.0) - truth(-1e-4, 1000.0)) / 2e-4  # N/rad
    lag = SWEEP * TAU_S * slope  # by which one direction alone is wrong at 1000 N
    assert np.quantile(np.abs(error), 0.5) > 0.3 * lag
    assert abs(np.mean(error)) < 0.05 * lag


def test_levels_do_not_depend_on_units_or_order(sweeps: Sweeps) -> None:
    rng = np.random.default_rng(3)
    values = np.repeat([200.0, 400.0, 1000.0], 300) + rng.normal(0, 8, 900)
    at, medians = levels(values, 40.0)
    assert np.allclose(medians, [200, 400, 1000], atol=3)
    scaled, again = levels(values / 4.448, 40.0 / 4.448)
    np.testing.assert_array_equal(scaled, at)
    np.testing.assert_allclose(again * 4.448, medians)
    order = rng.permutation(900)
    np.testing.assert_array_equal(levels(values[order], 40.0)[0], at[order])


def test_one_level_and_a_ramp() -> None:
    at, medians = levels(np.full(50, 3.0), 0.5)
    assert (medians.tolist(), set(at.tolist())) == ([3.0], {0})
    at, _ = levels(np.concatenate([np.zeros(500), np.linspace(0, 10, 60), np.full(500, 10.0)]), 0.5)
    assert set(at[520:540].tolist()) == {-1}


def test_a_driven_test_is_swept_in_slip_ratio_at_levels_of_slip_angle(tmp_path: Path) -> None:
    channels = belt_test()
    slip = channels["SA"] / 8 * 0.15
    angle = np.where(np.arange(len(slip)) < len(slip) // 2, 0.0, -4.0)
    FX = 1.2 * np.abs(channels["FZ"]) * np.sin(1.5 * np.arctan(12 * slip))
    path = write_mat(tmp_path / "drive.mat", channels | {"SL": slip, "SA": angle, "FX": FX})
    driven = split_file(path)
    assert driven.swept == "KAPPA"
    assert sorted({round(float(a)) for a in np.degrees(driven.table["SA"])}) == [-4, 0]
    expected = 1.2 * driven.table["FZ"] * np.sin(1.5 * np.arctan(12 * driven.table["KAPPA"]))
    assert np.max(np.abs(driven.table["FX"] - expected)) < 25  # N: the curve's bend within a bin of 0.01


def test_axes_by_word_and_what_is_no_sweep(tmp_path: Path) -> None:
    path = write_mat(tmp_path / "run.mat", belt_test())
    assert split_file(path, "adapted-SAE").table.axes == "adapted-SAE"
    with pytest.raises(ToolkitError) as caught:
        split_file(path, "sideways")
    assert caught.value.rule == "unknown-axes"
    few = {name: values[:2] for name, values in belt_test().items()}
    with pytest.raises(ToolkitError) as caught:
        split(read_field_file(write_mat(tmp_path / "few.mat", few)))
    assert caught.value.rule == "no-curve"


def test_speeds_are_conditions_of_their_own(tmp_path: Path) -> None:
    slow, fast = belt_test(), belt_test()
    fast["V"], fast["FY"], fast["ET"] = 2 * fast["V"], 0.9 * fast["FY"], fast["ET"] + 2 * fast["ET"][-1]
    both = {name: np.concatenate([slow[name], fast[name]]) for name in slow}
    sweeps = split_file(write_mat(tmp_path / "run.mat", both))
    assert {round((s.speed_m_s or 0) * 3.6) for s in sweeps.sweeps} == {40, 80}
    assert sum(s.direction == "up" for s in sweeps.sweeps) == 2 * len(CONDITIONS)
    table = sweeps.table
    near = np.abs(table["SA"]) < np.radians(1.0)
    for speed, factor in ((40, 1.0), (80, 0.9)):
        rows = near & (np.rint(table["V"] * 3.6) == speed)
        expected = factor * truth(table["SA"], table["FZ"], table["IA"], table["P"])
        assert abs(np.mean((table["FY"] - expected)[rows])) < 5.0
