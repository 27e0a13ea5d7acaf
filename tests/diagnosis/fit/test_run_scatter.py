"""Values and intervals of a fit hold zeros and gains that move from run to run."""

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.fit.folds import folds_of, hold_out
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.fit.run_scatter import held_out_beside_scatter, with_run_scatter
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effect

RATE, NOISE = 0.6, 0.5  # N/min and N
SIMULATOR = """
import pandas as pd
def simulate(inputs, p):
    return pd.DataFrame({"F": inputs["L"]})
"""


def case_of(folder, seed, *, zero_sd, gain_sd, runs=5):
    rng, text, frames = np.random.default_rng(seed), "", {"r1__csv": None}
    for k in range(runs):
        t = np.arange(80) * 2.0
        load = 50 + 50 * np.sin(0.05 * t + k)
        force = (1 + gain_sd * rng.normal()) * load + zero_sd * rng.normal() + RATE * t / 60
        frames[f"r{k}__csv"] = pd.DataFrame({"t": t, "L": load, "F": force + rng.normal(0, NOISE, 80)})
        text += f'[[recording.run]]\nfile = "r{k}.csv"\n'
    head = case_text("python", title="A cell", inputs={"L": "N"}, outputs={"F": "N"})
    return read_case(write_case(folder, head + text, simulator=SIMULATOR, **frames))


def drift_beside_scatter(folder, seed, **sizes):
    """Return the fitted drift, its standard uncertainty, and the scatter that was taken up."""
    case = case_of(folder, seed, **sizes)
    problem = problem_of(case, model_of(case, None, None))
    drift = AppliedEffect(effect=effect("zero_drift"), channel="F", values={"rate": 0.5})
    made, scatter = with_run_scatter(problem, fit(problem, (drift,)))
    return dict(made.active[0].values)["rate"], float(np.sqrt(made.covariance[0, 0])), scatter


MORE = pytest.mark.campaign("30 draws in place of 12")


@pytest.mark.parametrize(("draws", "least"), [(12, 9), pytest.param(30, 25, marks=MORE)])
def test_intervals_cover_where_zeros_and_gains_of_the_runs_scatter(tmp_path, draws, least):
    drifts = [drift_beside_scatter(tmp_path / str(k), k, zero_sd=0.6, gain_sd=0.004) for k in range(draws)]
    covered = sum(abs(rate - RATE) < 1.96 * sd for rate, sd, _ in drifts)
    # Of 30 intervals of 95 % fewer than 25 cover in three draws of a thousand, of 12 fewer than 9 in two.
    assert covered >= least
    # As sure as the rows within the runs allow, however far these lie apart: a slope about each run's own
    # zero has 0.5 N / sqrt(400) over the 0.77 min by which times scatter.
    assert np.median([sd for _, sd, _ in drifts]) < 2.5 * 0.5 / np.sqrt(400) / 0.77
    zeros = [scatter[0].zero_sd for _, _, scatter in drifts if scatter]
    assert len(zeros) > 0.8 * draws
    assert np.sqrt(np.mean(np.square(zeros))) == pytest.approx(0.6, rel=0.3)


@pytest.mark.campaign("the null of a scatter that intervals cover in every run")
def test_runs_that_are_alike_leave_the_fit_as_it_is(tmp_path):
    scatters = [drift_beside_scatter(tmp_path / str(k), k, zero_sd=0.0, gain_sd=0.0)[2] for k in range(20)]
    assert sum(bool(scatter) for scatter in scatters) <= 2


def test_two_runs_tell_no_scatter(tmp_path):
    assert drift_beside_scatter(tmp_path, 0, zero_sd=5.0, gain_sd=0.0, runs=2)[2] == ()


def test_a_run_that_an_effect_is_bound_to_has_that_effect_and_no_scatter(tmp_path):
    case = case_of(tmp_path, 3, zero_sd=0.0, gain_sd=0.0)
    frame = pd.read_csv(tmp_path / "r2.csv")
    frame["F"] += 4.0
    frame.to_csv(tmp_path / "r2.csv", index=False)
    case = read_case(case.path)
    problem = problem_of(case, model_of(case, None, None))
    offset = AppliedEffect(
        effect=effect("zero_offset"), channel="F", values={"offset": -3.0}, runs=frozenset({"r2.csv"})
    )
    drift = AppliedEffect(effect=effect("zero_drift"), channel="F", values={"rate": 0.5})
    made, scatter = with_run_scatter(problem, fit(problem, (offset, drift)))
    assert scatter == ()
    assert abs(dict(made.active[0].values)["offset"]) == pytest.approx(4.0, abs=0.3)


def test_unseen_rows_are_told_by_fits_that_have_their_values_as_the_told_one(tmp_path):
    case = case_of(tmp_path, 0, zero_sd=0.6, gain_sd=0.004)
    problem = problem_of(case, model_of(case, None, None))
    drift = AppliedEffect(effect=effect("zero_drift"), channel="F", values={"rate": 0.5})
    made = fit(problem, (drift,))
    folds = folds_of(problem, made)
    held_out = hold_out(problem, folds, made.active, made)
    told = held_out_beside_scatter(problem, held_out)
    assert told.scores == held_out.scores
    for k, rows in enumerate(problem.slices):
        four = problem_of(case, model_of(case, None, None))
        for i in range(rows.start, rows.stop):
            four.kept["F"][i] = False
        beside = with_run_scatter(four, held_out.fits[k][1])[0]
        assert told.simulated["F"][rows] == pytest.approx(beside.simulated["F"][rows], abs=1e-9)
    assert np.abs(told.simulated["F"] - held_out.simulated["F"]).max() > 1e-3


def test_unseen_rows_of_runs_that_are_alike_stay(tmp_path):
    case = case_of(tmp_path, 1, zero_sd=0.0, gain_sd=0.0)
    problem = problem_of(case, model_of(case, None, None))
    made = fit(problem, ())
    folds = folds_of(problem, made)
    held_out = hold_out(problem, folds, (), made)
    told = held_out_beside_scatter(problem, held_out)
    assert np.array_equal(told.simulated["F"], held_out.simulated["F"])
