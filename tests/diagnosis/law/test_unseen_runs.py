"""Laws that whole unseen runs show, fitted by ordinary least squares where the rest is beyond all noise."""

import numpy as np
import pandas as pd
import pytest

import toolkit.diagnosis.law.unseen_runs as unseen_runs
from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.fit.folds import folds_of, hold_out
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.law.trial import trials_of
from toolkit.diagnosis.search.screen import LinearisedFit
from toolkit.diagnosis.simulators.build_simulator import model_of

SIMULATOR = """
import pandas as pd
def simulate(inputs, p):
    return pd.DataFrame({"F": p["k"] * inputs["x"]})
"""
CASE = case_text(
    "python", parameters={"k": (5.0, "N/m", 5.0)}, inputs={"x": "m"}, outputs={"F": "N"},
)  # fmt: skip
SPRING, BRANCH, TIME = 4.0, 6.0, 12.0  # N/m, N/m, s


def drawn_out(rate, noise, seed):
    """Return a ramp to 0.1 m and back: a spring and a Maxwell branch, solved piece by piece.

    The branch's force obeys f' = BRANCH x' - f / TIME: for a steady x' it goes to BRANCH TIME x'.
    """
    half = 0.1 / rate
    t = np.linspace(0, 2 * half, 180)
    steady = BRANCH * TIME * rate
    top = steady * (1 - np.exp(-half / TIME))
    up, down = t <= half, t > half
    force = np.where(up, steady * (1 - np.exp(-t / TIME)), 0.0)
    force[down] = -steady + (top + steady) * np.exp(-(t[down] - half) / TIME)
    x = rate * np.where(up, t, 2 * half - t)
    rng = np.random.default_rng(seed)
    return pd.DataFrame({"t": t, "x": x, "F": SPRING * x + force + rng.normal(0, noise, t.size)})


def shown(folder, noise):
    tables = {f"r{i}__csv": drawn_out(rate, noise, i) for i, rate in enumerate((0.001, 0.003, 0.003, 0.006))}
    listed = "".join(f'[[recording.run]]\nfile = "r{i}.csv"\n' for i in range(4))
    case = read_case(write_case(folder, CASE + listed, simulator=SIMULATOR, **tables))
    problem = problem_of(case, model_of(case, None))
    base = fit(problem)
    folds = folds_of(problem, base)
    held, screen = hold_out(problem, folds, (), base), LinearisedFit.of(problem, base)
    trials = list(trials_of(problem, base, ("F",)))
    return unseen_runs.laws_on_unseen_runs(problem, folds, base, held, screen, trials, weight=3.0)


def test_a_branch_that_relaxes_is_the_law_that_takes_most_of_every_unseen_run(tmp_path, monkeypatch):
    monkeypatch.setattr(unseen_runs, "asked_of_unseen_runs", lambda *_: True)
    laws = shown(tmp_path, noise=0.002)
    best = max(laws, key=lambda law: law.gain)
    assert "lag(" in best.trial.applied.effect.name
    (law,) = best.fit.active
    assert law.values["tau"] == pytest.approx(TIME, rel=0.05)  # noqa: PD011  of a law
    # The law is exact: on rows that no fit has seen the sensor's noise alone is left.
    left = best.fit.simulated["F"] - best.held_out.simulated["F"] + best.fit.residual["F"]
    assert np.sqrt(np.mean(left**2)) == pytest.approx(0.002, rel=0.1)


def test_noise_has_no_law_even_where_unseen_runs_are_asked(tmp_path, monkeypatch):
    monkeypatch.setattr(unseen_runs, "asked_of_unseen_runs", lambda *_: True)
    assert shown(tmp_path, noise=30.0) == []


def test_what_noise_may_have_left_is_not_asked_of_unseen_runs(tmp_path):
    assert shown(tmp_path, noise=0.3) == []
