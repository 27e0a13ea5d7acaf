"""Laws in the equation of a state: what is concealed there is found by its place, variables and size."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

from tests.diagnosis.law.test_learn import estimates, run

SIMULATOR = """
import numpy as np
def rhs(t, x, u, p):
    return np.array([x[1], (u["F"] - p["k"] * x[0] - p["d"] * x[1]) / p["m"]])
def outputs(x, u, p):
    return {"X": x[0]}
def initial(p):
    return np.array([0.0, 0.0])
"""
HEAD = """schema = 1
title = "A mass on a spring"
[simulation]
kind = "ode"
path = "sim.py"
states = ["x", "v"]
force_terms = { v = "N/kg" }
[simulation.parameters.k]
value = 40.0
unit = "N/m"
sd = 2.0
[simulation.parameters.d]
value = 1.0
unit = "N*s/m"
sd = 0.2
[simulation.parameters.m]
value = 2.0
unit = "kg"
[recording]
time = "t"
[recording.channels]
t = { unit = "s", role = "time" }
F = { unit = "N", role = "input" }
X = { unit = "m", role = "output" }
"""


def _recorded(seed: int) -> pd.DataFrame:
    """A latch at 0.3 m pushes back: 6 exp(-((x - 0.3)/0.12)^2) N/kg; k is 41, d 1.05, the noise 4 mm."""
    rng = np.random.default_rng(seed)
    t = np.arange(250) * 0.04
    phase = rng.uniform(0, 6, 3)
    force = sum(a * np.sin(w * t + p) for a, w, p in zip((12, 9, 6), (3.1, 5.2, 1.3), phase, strict=True))

    def rates(s: float, x: np.ndarray) -> list[float]:
        latch = 6 * np.exp(-(((x[0] - 0.3) / 0.12) ** 2))
        return [x[1], (np.interp(s, t, force) - 41 * x[0] - 1.05 * x[1]) / 2 - latch]

    moved = solve_ivp(rates, (0, t[-1]), [0, 0], t_eval=t, rtol=1e-8, atol=1e-10, max_step=0.04)
    return pd.DataFrame({"t": t, "F": force, "X": moved.y[0] + rng.normal(0, 0.004, len(t))})


@pytest.fixture(scope="module")
def answer(tmp_path_factory: pytest.TempPathFactory) -> dict:
    folder: Path = tmp_path_factory.mktemp("latch")
    (folder / "sim.py").write_text(SIMULATOR)
    (folder / "case.toml").write_text(
        HEAD + "".join(f'[[recording.run]]\nfile = "r{i}.csv"\n' for i in range(3))
    )
    for i in range(3):
        _recorded(i).to_csv(folder / f"r{i}.csv", index=False)
    return json.loads(run("diagnose", folder / "case.toml", "--out", folder / "out", "--json").output)


def test_its_place_is_the_state_and_its_variable_the_position(answer):
    law = answer["laws"][0]
    assert law["place"] == {"kind": "state", "channel": "v"}
    assert (law["form"], law["variables"]) == ("static", ["x"])
    assert law["formula"] == "a*exp(-(((x - c)/w)**2))"


def test_its_size_is_that_which_was_concealed(answer):
    law = answer["laws"][0]
    units = {each["name"]: each["unit"] for each in law["parameters"]}
    assert (units["a"], units["c"]) == ("N/kg", "m")
    for name, truth in (("a", 6.0), ("c", 0.3), ("w", 0.12)):
        value, low, high = estimates(law)[name]
        assert value == pytest.approx(truth, rel=0.05)
        assert high - low < 0.2 * truth


def test_with_it_only_the_noise_is_left(answer):
    (fit,) = answer["fit"]["held_out"]
    assert fit["with_laws_rmse"] == pytest.approx(0.004, rel=0.1)
    assert fit["refitted_rmse"] > 0.02
