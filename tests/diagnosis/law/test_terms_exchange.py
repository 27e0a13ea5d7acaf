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
from toolkit.diagnosis.search import search

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
