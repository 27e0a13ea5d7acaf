"""A body that the equation does not have: its law remembers, in the equation of the body it hangs on."""

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
    return np.array([(u["P"] - p["h"] * (x[0] - 20.0)) / p["C"]])
def outputs(x, u, p):
    return {"T": x[0]}
def initial(p):
    return np.array([20.0])
"""
EXCHANGE, SECOND = 0.8, 300.0  # W/K and J/K of a second body, which no equation has


def _heated(seed: int) -> pd.DataFrame:
    rng = np.random.default_rng(seed)
    t = np.arange(300) * 10.0
    power = np.repeat(rng.uniform(0, 60, 15), 20)

    def rates(s, y):
        to = EXCHANGE * (y[0] - y[1])
        return [(np.interp(s, t, power) - 0.52 * (y[0] - 20) - to) / 405, to / SECOND]

    y = solve_ivp(rates, (0, t[-1]), [20.0, 20.0], t_eval=t, rtol=1e-8, max_step=10).y[0]
    return pd.DataFrame({"t": t, "P": power, "T": y + rng.normal(0, 0.1, len(t))})


def test_a_second_body_is_learned_as_what_follows_the_first(tmp_path, monkeypatch):
    monkeypatch.setattr(search, "candidates", lambda _: ())
    (tmp_path / "sim.py").write_text(SIMULATOR)
    (tmp_path / "case.toml").write_text(
        case_text(
            "ode", states=["x"], parameters={"h": (0.5, "W/K", 0.05), "C": (400.0, "J/K", 20.0)},
            inputs={"P": "W"}, outputs={"T": "degC"}, runs=3,
        )
    )  # fmt: skip
    for i in range(3):
        _heated(i).to_csv(tmp_path / f"r{i}.csv", index=False)
    answer = json_value(diagnose(read_case(tmp_path / "case.toml"), None).diagnosis)
    law = answer["laws"][0]
    assert law["place"] == {"kind": "state", "channel": "x"}
    assert (law["form"], law["variables"]) == ("mode", ["x"])
    assert law["formula"] == "a*(x - lag(x, tau))"
    # What the second body takes is EXCHANGE (T - T2), and T2 follows with SECOND/EXCHANGE.
    for name, truth in (("a", -EXCHANGE / 405), ("tau", SECOND / EXCHANGE)):
        _, low, high = estimates(law)[name]
        assert low < truth < high
    assert law["memory_s"] == pytest.approx(SECOND / EXCHANGE, rel=0.15)
    (held_out,) = answer["fit"]["held_out"]
    assert held_out["with_laws_rmse"] == pytest.approx(0.1, rel=0.1)
    assert held_out["refitted_rmse"] > 0.3
