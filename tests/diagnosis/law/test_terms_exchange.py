"""What two bodies exchange is missing in the equations of both: one loses what the other has."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

from tests.diagnosis.case_text import case_text
from tests.diagnosis.law.test_learn import estimates
from toolkit.declared import json_value
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.law.terms import joint_terms_of
from toolkit.diagnosis.search import search
from toolkit.diagnosis.search.screen import LinearisedFit
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.diagnosis.simulators.case_code import WORKER_LIMITS, running

SIMULATOR = """
import numpy as np
def rhs(t, x, u, p):
    return np.array([
        (u["P"] - p["h"] * (x[0] - 20.0)) / 400.0,
        (u["Q"] - p["h"] * (x[1] - 20.0)) / 250.0,
    ])
def outputs(x, u, p):
    return {"T1": x[0], "T2": x[1]}
def initial(p):
    return np.array([20.0, 20.0])
"""
EXCHANGE = 0.35  # W/K, which the simulation does not have


def _heated(seed: int) -> pd.DataFrame:
    rng = np.random.default_rng(seed)
    t = np.arange(200) * 15.0
    heat = {name: np.repeat(rng.uniform(0, 40, 10), 20) for name in "PQ"}

    def rates(s, x):
        to = EXCHANGE * (x[0] - x[1])
        P, Q = (np.interp(s, t, heat[name]) for name in "PQ")
        return [(P - 0.5 * (x[0] - 20) - to) / 400, (Q - 0.5 * (x[1] - 20) + to) / 250]

    x = solve_ivp(rates, (0, t[-1]), [20.0, 20.0], t_eval=t, rtol=1e-8, max_step=15).y
    noise = rng.normal(0, 0.1, (2, len(t)))
    return pd.DataFrame({"t": t, **heat, "T1": x[0] + noise[0], "T2": x[1] + noise[1]})


def test_both_equations_have_it_with_the_size_that_each_body_gives_it(tmp_path, monkeypatch):
    monkeypatch.setattr(search, "candidates", lambda _: ())
    (tmp_path / "sim.py").write_text(SIMULATOR)
    (tmp_path / "case.toml").write_text(
        case_text(
            "ode", states=["x1", "x2"], parameters={"h": (0.5, "W/K", 0.03)}, inputs={"P": "W", "Q": "W"},
            outputs={"T1": "degC", "T2": "degC"}, runs=3,
        )
    )  # fmt: skip
    for i in range(3):
        _heated(i).to_csv(tmp_path / f"r{i}.csv", index=False)
    answer = json_value(diagnose(read_case(tmp_path / "case.toml"), None).diagnosis)
    laws = answer["laws"]
    assert [law["place"] for law in laws] == [{"kind": "state", "channel": name} for name in ("x1", "x2")]
    for law, size in zip(laws, (-EXCHANGE / 400, EXCHANGE / 250), strict=True):
        assert (law["form"], law["formula"], law["variables"]) == ("static", "a*(x1 - x2)", ["x1", "x2"])
        assert all(20 <= low < 40 < high for low, high in law["range"].values())
        value, low, high = estimates(law)["a"]
        assert low < size < high
        assert value == pytest.approx(size, rel=0.05)
    for output in answer["fit"]["held_out"]:
        assert output["with_laws_rmse"] == pytest.approx(0.1, rel=0.1)
        assert output["refitted_rmse"] > 0.5


LOST = (
    0.9,
    0.7,
    1.1,
)  # mW/K that each of three bodies of 1 J/K gives to the room, which the simulation lacks
APART = """
import numpy as np
def rhs(t, x, u, p):
    return np.array([p["c"] * u["P"], p["c"] * u["Q"], p["c"] * u["R"]]) / 1000.0
def outputs(x, u, p):
    return {"T1": x[0], "T2": x[1], "T3": x[2]}
def initial(p):
    return np.array([20.0, 20.0, 20.0])
"""


@pytest.fixture
def losing(tmp_path):
    return _losing(tmp_path, LOST)


def _losing(tmp_path, lost):
    """Return a case of three bodies that lose heat to the room."""
    (tmp_path / "sim.py").write_text(APART)
    (tmp_path / "case.toml").write_text(
        case_text(
            "ode", states=["x1", "x2", "x3"], parameters={"c": (1.0, "1", 0.02)},
            inputs={"P": "mW", "Q": "mW", "R": "mW", "room": "degC"},
            outputs={"T1": "degC", "T2": "degC", "T3": "degC"}, runs=2,
        )
    )  # fmt: skip
    for run in range(2):
        rng = np.random.default_rng(run)
        t = np.arange(100) * 15.0
        heat = np.repeat(rng.uniform(0, 40, (3, 10)), 10, axis=1)
        room = 20 + 2 * np.sin(2 * np.pi * t / 1500 + run)

        def rates(s, x, t=t, heat=heat, room=room):
            into = np.array([np.interp(s, t, each) for each in heat])
            return (into - np.array(lost) * (x - np.interp(s, t, room))) / 1000

        x = solve_ivp(rates, (0, t[-1]), [20.0] * 3, t_eval=t, rtol=1e-8, max_step=15).y
        x = x + rng.normal(0, 0.1, x.shape)
        columns = dict(zip(("P", "Q", "R", "T1", "T2", "T3"), (*heat, *x), strict=True))
        pd.DataFrame({"t": t, "room": room, **columns}).to_csv(tmp_path / f"r{run}.csv", index=False)
    return read_case(tmp_path / "case.toml")


def test_what_all_bodies_lose_to_the_room_is_looked_at_as_one_law_in_all_of_their_equations(losing):
    """Of none of them alone does a loss explain much of all that is off."""
    with running(losing, WORKER_LIMITS) as code:
        problem = problem_of(losing, model_of(losing, None, code))
        base = fit(problem)
        trials = list(joint_terms_of(problem, base, LinearisedFit.of(problem, base)))
    lost = [trial for trial in trials if trial.applied.effect.name == "law enters: a*([itself] - [room])"]
    assert [[part.applied.channel for part in trial.parts] for trial in lost] == [["x1", "x2", "x3"]]
    assert lost[0].gain > 20
    sizes = [dict(applied.values)["a"] for applied in lost[0].together]
    assert min(sizes) > 0  # a loss, by its linear answer: a law is taken from the rate


def test_of_bodies_that_are_alike_one_size_is_fitted(tmp_path):
    """Three sizes would be as many ways to take the same for a gain or for another loss."""
    losing = _losing(tmp_path, (0.9, 0.9, 0.9))
    with running(losing, WORKER_LIMITS) as code:
        problem = problem_of(losing, model_of(losing, None, code))
        base = fit(problem)
        trials = list(joint_terms_of(problem, base, LinearisedFit.of(problem, base)))
        (lost,) = [
            trial for trial in trials if trial.applied.effect.name == "law enters: a*([itself] - [room])"
        ]
        made = fit(problem, lost.together)
    first = lost.applied.key
    assert [part.applied.sized_as for part in lost.parts] == [None, first, first]
    assert lost.cost == 1
    sizes = {dict(applied.values)["a"] for applied in made.active}
    assert len(sizes) == 1
    sd = made.covariance[1, 1] ** 0.5
    assert made.covariance.shape == (2, 2)  # the heat's factor, and one loss
    assert abs(sizes.pop() - 0.9e-3) < 3 * sd < 0.1e-3


@pytest.mark.campaign("30 s of a whole diagnosis: an exchange holds laws of several equations in every run")
def test_its_sizes_are_what_every_body_loses(losing, monkeypatch):
    monkeypatch.setattr(search, "candidates", lambda _: ())
    answer = json_value(diagnose(losing, None).diagnosis)
    laws = [law for law in answer["laws"] if law["formula"].endswith("- room)")]
    assert [law["place"]["channel"] for law in laws] == ["x1", "x2", "x3"]
    for law, size in zip(laws, LOST, strict=True):
        value, low, high = estimates(law)["a"]
        assert low < -size / 1000 < high
        assert value == pytest.approx(-size / 1000, rel=0.1)
