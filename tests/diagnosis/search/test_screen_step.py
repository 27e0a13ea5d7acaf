"""What a look sees from where: a refit without an effect may have gone where it no longer helps."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import CELL, cell_case, write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.search import screen_step
from toolkit.diagnosis.search.candidates import candidates
from toolkit.diagnosis.search.screen_step import from_declared, look, masked
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.effects.effect import Effect

SPEED = """
import pandas as pd
def simulate(inputs, p):
    return pd.DataFrame({"n": p["gain"] * inputs["u"] + p["zero"]})
"""
CASE = case_text(
    "python", parameters={"gain": (1.0, "1", 0.3), "zero": (0.0, "1/s", 0.5)}, inputs={"u": "1/s"},
    outputs={"n": "1/s"},
)  # fmt: skip


def speeds(folder, *, unsigned):
    """Return a speed sensor that may have lost its sign; the refit without that goes to a constant."""
    text, frames = CASE, {}
    for k in range(3):
        t = np.arange(300) * 0.1
        u = np.sin(0.7 * t + k) + 0.5 * np.sin(1.9 * t)
        n = 1.05 * u
        n = (np.abs(n) if unsigned else n) + np.random.default_rng(k).normal(0, 0.02, t.size)
        frames[f"r{k}__csv"] = pd.DataFrame({"t": t, "u": u, "n": n})
        text += f'[[recording.run]]\nfile = "r{k}.csv"\n'
    return read_case(write_case(folder, text, simulator=SPEED, **frames))


def looks(case):
    problem = problem_of(case, model_of(case, None, None))
    base = fit(problem)
    view = look(problem, base, candidates(problem), turn=0, seed=1)
    seen = from_declared(problem, base, view)
    return [{trial.candidate.name for trial in each.significant} for each in (view, seen)], view, seen


def test_a_lost_sign_is_seen_from_the_declared_values(tmp_path):
    (from_refit, both), _, seen = looks(speeds(tmp_path, unsigned=True))
    assert "rectification" not in from_refit
    assert both >= from_refit | {"rectification"}
    assert seen.p_of[id(seen.significant[0])] < 0.003


def test_where_a_refit_does_harm_all_effects_are_seen_from_the_declared_values_and_begin_there(
    tmp_path, monkeypatch
):
    case = speeds(tmp_path, unsigned=True)
    problem = problem_of(case, model_of(case, None, None))
    base = fit(problem)
    listed = [each for each in candidates(problem) if each.name == "rectification"]
    view = look(problem, base, listed, turn=0, seed=1)
    monkeypatch.setattr(Effect, "misleads", False)
    assert from_declared(problem, base, view) is view
    (seen,) = from_declared(problem, base, view, of_all=True).significant
    assert (seen.candidate.name, seen.p) == ("rectification", (1.0, 0.0))


def test_a_refit_that_stays_near_its_priors_is_looked_at_from_there_alone(tmp_path):
    _, view, seen = looks(speeds(tmp_path, unsigned=False))
    assert seen is view


@pytest.mark.campaign("a whole diagnosis: a lost sign is seen from the declared values in every run")
def test_an_unsigned_sensor_is_named(tmp_path):
    answer = diagnose(speeds(tmp_path, unsigned=True), None).diagnosis
    assert [effect.name for effect in answer.effects] == ["rectification"]
    assert answer.fit.held_out[0].augmented_rmse < 0.03


def test_no_twin_of_what_a_refit_masks_is_left_out(tmp_path, monkeypatch):
    """F = gain L: an error of the sensitivity and a leak of L into F are one response, with one gain."""
    rng = np.random.default_rng(1)
    L = rng.permutation(np.linspace(-90.0, 90.0, 60))
    frame = pd.DataFrame({"t": np.arange(60) * 1.0, "L": L, "F": 0.95 * L + rng.normal(0, 0.5, 60)})
    text = cell_case(0.005) + '[[recording.run]]\nfile = "r0.csv"\n'
    case = read_case(write_case(tmp_path, text, simulator=CELL, r0__csv=frame, r1__csv=None))
    problem = problem_of(case, model_of(case, None, None))
    twins = [each for each in candidates(problem) if each.name in ("crosstalk", "sensitivity_error")]
    monkeypatch.setattr(screen_step, "PRIORS", replace(screen_step.PRIORS, masked=1))
    names = {key[0] for key in masked(problem, fit(problem), twins)}
    assert names == {"crosstalk", "sensitivity_error"}
