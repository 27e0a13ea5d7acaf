"""Single rows that stand far off are left out of every fit; what answers a sharp move of an input is kept."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from toolkit.diagnosis.case.case import Run
from toolkit.diagnosis.fit.problem import Problem, without_outliers

T = np.arange(400) * 0.05
RAMP = np.interp(T % 5.0, [0.0, 2.4, 2.5, 4.9, 5.0], [0.0, 8.0, 0.0, -8.0, 0.0])  # jumps back within two rows


def problem_of(observed, driver=RAMP):
    run = Run(name="r", t=T, columns={"SA": driver}, conditions={}, declared={}, simulated={})
    case = SimpleNamespace(drivers=(SimpleNamespace(name="SA", role="input"),), has_order=True)
    whole = np.ones(len(T), dtype=bool)
    return Problem(
        case=case, model=None, runs=(run,), free=(), known={}, observed={"FY": observed}, kept={"FY": whole},
        floor={"FY": 1e-6}, slices=(slice(0, len(T)),),
    )  # fmt: skip


@pytest.fixture
def noise():
    return np.random.default_rng(3).normal(size=len(T))


def test_a_row_far_off_its_neighbours_is_left_out(noise):
    noise[[120, 233]] += 40.0
    kept = without_outliers(problem_of(noise), {"FY": noise}).kept["FY"]
    assert np.flatnonzero(~kept).tolist() == [120, 233]


def test_the_row_that_a_simulation_starts_from_is_no_outlier(noise):
    """It begins where the recording does, and is off from the next row on."""
    off = 40.0 + noise
    off[0] = 0.0
    off[200] += 80.0
    kept = without_outliers(problem_of(off), {"FY": off}).kept["FY"]
    assert np.flatnonzero(~kept).tolist() == [200]


def test_what_answers_a_sharp_move_is_no_outlier(noise):
    sharp = np.flatnonzero(np.abs(np.diff(RAMP)) > 3)
    noise[sharp] += 40.0
    assert without_outliers(problem_of(noise), {"FY": noise}).kept["FY"].all()


@pytest.mark.parametrize(("reading", "left_out"), [(-8_384_677.0, [120]), (2.0, [])])
def test_a_value_that_an_input_cannot_have_is_no_sharp_move(noise, reading, left_out):
    driver = 0.1 * RAMP
    driver[120] = reading
    recorded = RAMP + 0.1 * noise  # smooth, and without an answer to that reading
    residual = 0.1 * noise - 10.0 * (driver - 0.1 * RAMP)
    residual[120] = -10.0 * (driver[120] - 0.1 * RAMP[120])
    kept = without_outliers(problem_of(recorded, driver), {"FY": residual}).kept["FY"]
    assert np.flatnonzero(~kept).tolist() == left_out


@pytest.mark.parametrize(("missed", "left_out"), [(-3.0, []), (12.0, [120]), (-12.0, [120])])
def test_the_row_in_which_a_heater_is_switched_lies_between_its_neighbours(missed, left_out):
    """A block heated from row 120 on: over that row it rises by 9.8 K, and by 9.3 K over the next."""
    noise = np.random.default_rng(3).normal(0, 0.05, len(T))
    at = np.arange(len(T))
    simulated = 40 + np.where(at < 120, 0.0, 200 * (1 - np.exp(-(at - 119) / 20)))
    observed = simulated + noise
    observed[120] += missed
    residual = {"FY": observed - simulated}
    kept = without_outliers(problem_of(observed, np.where(at < 120, 0.25, 0.85)), residual).kept["FY"]
    assert np.flatnonzero(~kept).tolist() == left_out


def readings_of(residuals, loads):
    """Loadings of a table without an order: each run has the same loads, (runs, loads)."""
    runs = tuple(
        Run(
            name=f"r{k}",
            t=np.arange(len(loads)),
            columns={"p": loads},
            conditions={},
            declared={},
            simulated={},
        )
        for k in range(len(residuals))
    )
    observed = np.concatenate(residuals)
    case = SimpleNamespace(drivers=(SimpleNamespace(name="p", role="input"),), has_order=False)
    slices = tuple(slice(k * len(loads), (k + 1) * len(loads)) for k in range(len(residuals)))
    return Problem(
        case=case, model=None, runs=runs, free=(), known={}, observed={"U": observed},
        kept={"U": np.ones(len(observed), dtype=bool)}, floor={"U": 1e-6}, slices=slices,
    )  # fmt: skip


LOADS = np.array([5.0, 10, 15, 35, 55, 75, 95, 105, 125, 145, 165, 175])


def test_a_reading_is_far_off_beside_the_readings_at_its_own_inputs():
    """Nine loadings of a transducer: a run of twelve rows has no scatter of its own, all of them have."""
    residuals = np.random.default_rng(5).normal(size=(9, len(LOADS)))
    residuals[4] *= 0.02  # quieter by chance than the others: its last reading lies in the middle of theirs
    residuals[4, -1] = -1.0
    residuals[2, [4, 11]] = 60.0, -28.0  # two misreadings in one run are no pattern of the table
    problem = readings_of(residuals, LOADS)
    kept = without_outliers(problem, {"U": np.concatenate(residuals)}).kept["U"]
    assert np.flatnonzero(~kept).tolist() == [28, 35]


def test_short_runs_of_readings_have_a_scatter_together():
    """Runs of six readings: none is long enough for itself."""
    residuals = np.random.default_rng(6).normal(size=(8, 6))
    residuals[3, 2] = -40.0
    problem = readings_of(residuals, LOADS[:6])
    kept = without_outliers(problem, {"U": np.concatenate(residuals)}).kept["U"]
    assert np.flatnonzero(~kept).tolist() == [20]


def slow_of(size, seed=4):
    """A moment that stands, rises within three rows to its peak and sinks again, with noise."""
    course = np.interp(np.arange(len(T)), [0, 198, 201, 260, 399], [50.0, 50.0, 243.0, 60.0, 40.0])
    return course, course + np.random.default_rng(seed).normal(0, size, len(T))


def test_on_a_ramp_of_the_recording_it_is_the_simulation_that_jumps():
    """A launch of a car, -99, -231, -243, -207 N m from row to row: a wrong gain shows in it alone."""
    _, observed = slow_of(0.5)
    residual = np.random.default_rng(8).normal(0, 0.5, len(T))
    residual[[199, 200, 201]] += 12.0, 25.0, 30.0  # the third is the peak itself
    kept = without_outliers(problem_of(observed, np.zeros(len(T))), {"FY": residual}).kept["FY"]
    assert kept.all()


@pytest.mark.parametrize("rows", [[120], [120, 121], [399], [0], [199]])
def test_a_spike_of_a_smooth_recording_is_left_out(rows):
    """One reading and two, the first row and the last, and on the ramp itself."""
    course, observed = slow_of(0.5)
    observed[rows] += 90.0
    kept = without_outliers(problem_of(observed, np.zeros(len(T))), {"FY": observed - course}).kept["FY"]
    assert np.flatnonzero(~kept).tolist() == rows


def test_a_reading_off_by_less_than_the_mismatch_scatters_is_an_outlier_of_a_quiet_sensor():
    """An oscilloscope's single readings 0.6 V off, which rows that stand still to 0.2 V lead nowhere near."""
    observed = np.round(5 * (15 + np.sin(T / 3))) / 5
    observed[[50, 200]] += 0.6
    residual = np.random.default_rng(9).normal(0, 0.08, len(T))
    residual[[50, 200]] += 1.5
    problem = replace(problem_of(observed, np.zeros(len(T))), floor={"FY": 0.2 / np.sqrt(12)})
    assert np.flatnonzero(~without_outliers(problem, {"FY": residual}).kept["FY"]).tolist() == [50, 200]


def test_a_spike_of_a_quick_recording_is_told_by_the_simulation_that_follows_it():
    """Three rows to a period: every value lies far off its neighbours, a spike between two of them too."""
    course = 100 * np.sin(2 * np.pi * np.arange(len(T)) / 3.1)
    observed = course + np.random.default_rng(7).normal(size=len(T))
    row = 100 + int(np.argmin(course[100:110]))
    observed[row] += 30.0
    kept = without_outliers(problem_of(observed, np.zeros(len(T))), {"FY": observed - course}).kept["FY"]
    assert np.flatnonzero(~kept).tolist() == [row]
