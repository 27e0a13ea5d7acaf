"""Laws in the equation of a state: what is concealed there is found by its place, variables and size."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

from tests.diagnosis.case_text import case_text
from tests.diagnosis.law.test_learn import estimates, run
from toolkit.declared import json_value
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose

SIMULATOR = """
import numpy as np
def rhs(t, x, u, p):
    return np.array([x[1], (u["F"] - p["k"] * x[0] - p["d"] * x[1]) / p["m"]])
def outputs(x, u, p):
    return {"X": x[0]}
def initial(p):
    return np.array([0.0, 0.0])
"""
HEAD = case_text(
    "ode", title="A mass on a spring", states=["x", "v"], force_terms={"v": "N/kg"},
    parameters={"k": (40.0, "N/m", 2.0), "d": (1.0, "N*s/m", 0.2), "m": (2.0, "kg")},
    inputs={"F": "N"}, outputs={"X": "m"},
)  # fmt: skip


def _recorded(seed: int) -> pd.DataFrame:
    """A latch at 0.3 m pushes back: 6 exp(-((x - 0.3)/0.12)^2) N/kg; k is 41, d 1.05, the noise 4 mm."""
    rng = np.random.default_rng(seed)
    t = np.arange(160) * 0.04
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


LATCH = pytest.mark.campaign(
    "a bump over a covariate is learned in every run, and so is a law in the equation of a state"
)


@LATCH
def test_its_place_is_the_state_and_its_variable_the_position(answer):
    law = answer["laws"][0]
    assert law["place"] == {"kind": "state", "channel": "v"}
    assert (law["form"], law["variables"]) == ("static", ["x"])
    assert law["formula"] == "a*exp(-(((x - c)/w)**2))"


@LATCH
def test_its_size_is_that_which_was_concealed(answer):
    law = answer["laws"][0]
    units = {each["name"]: each["unit"] for each in law["parameters"]}
    assert (units["a"], units["c"]) == ("N/kg", "m")
    for name, truth in (("a", 6.0), ("c", 0.3), ("w", 0.12)):
        value, low, high = estimates(law)[name]
        assert value == pytest.approx(truth, rel=0.05)
        assert high - low < 0.2 * truth


@LATCH
def test_with_it_only_the_noise_is_left(answer):
    (fit,) = answer["fit"]["held_out"]
    assert fit["with_laws_rmse"] == pytest.approx(0.004, rel=0.1)
    assert fit["refitted_rmse"] > 0.02


HIDDEN = {
    "a factor of the force that grows with the position": lambda x, _v, F, _t, _run: 0.25 * F * x,
    "a force that grows with its square": lambda _x, _v, F, _t, _run: 0.002 * F * abs(F),
    "a damper that acts one way": lambda _x, v, _F, _t, _run: 0.9 * max(v, 0.0),
    "a push in one run": lambda _x, _v, _F, t, run: -5.0 if run == 1 and 3 < t < 5.5 else 0.0,
}
"""What is concealed in the speed's equation [N/kg], as it is taken from the rate."""


def _moved(hidden, seed: int, number: int, rows: int) -> pd.DataFrame:
    """A mass on a spring whose k is 41 and d 1.05 with a concealed term, for 10 s; the noise is 4 mm."""
    rng = np.random.default_rng(1000 * seed + number)
    t = np.arange(rows) * (10 / rows)
    phase = rng.uniform(0, 6, 3)
    force = sum(a * np.sin(w * t + p) for a, w, p in zip((12, 9, 6), (3.1, 5.2, 1.3), phase, strict=True))

    def rates(s: float, x: np.ndarray) -> list[float]:
        F = float(np.interp(s, t, force))
        return [x[1], (F - 41 * x[0] - 1.05 * x[1]) / 2 - hidden(x[0], x[1], F, s, number)]

    y = solve_ivp(rates, (0, t[-1]), [0, 0], t_eval=t, rtol=1e-8, atol=1e-10, max_step=0.02).y
    return pd.DataFrame({"t": t, "F": force, "X": y[0] + rng.normal(0, 0.004, len(t))})


def _diagnosed(folder: Path, hidden, seed: int = 0, rows: int = 250) -> dict:
    (folder / "sim.py").write_text(SIMULATOR)
    runs = "".join(f'[[recording.run]]\nfile = "r{i}.csv"\n' for i in range(3))
    (folder / "case.toml").write_text(HEAD + runs)
    for i in range(3):
        _moved(hidden, seed, i, rows).to_csv(folder / f"r{i}.csv", index=False)
    return json_value(diagnose(read_case(folder / "case.toml"), None).diagnosis)


@pytest.mark.campaign(
    "a product of two signals is learned in every run, and so is a law in a state's equation"
)
def test_a_law_of_an_input_and_a_state_is_learned(tmp_path):
    answer = _diagnosed(tmp_path, HIDDEN["a factor of the force that grows with the position"])
    (law,) = answer["laws"]
    assert (answer["effects"], law["place"], law["formula"]) == (
        [],
        {"kind": "state", "channel": "v"},
        "a*x*F",
    )
    assert (law["form"], law["variables"]) == ("static", ["x", "F"])
    value, low, high = estimates(law)["a"]
    assert low < -0.25 < high  # what is added to the rate, where the hidden terms are what resists
    assert value == pytest.approx(-0.25, rel=0.01)
    assert law["parameters"][0]["unit"] == "1/(kg*m)"  # of N/kg by m N
    (fit,) = answer["fit"]["held_out"]
    assert fit["with_laws_rmse"] == pytest.approx(0.004, rel=0.05)
    assert fit["refitted_rmse"] > 0.02


def test_an_effect_that_only_imitates_a_law_is_not_named(tmp_path):
    # A wrong sensitivity of the force takes most of its square's answer, and the law takes all of it.
    answer = _diagnosed(tmp_path, HIDDEN["a force that grows with its square"], rows=125)
    assert (answer["verdict"], answer["effects"]) == ("unknown", [])
    (law,) = answer["laws"]
    assert (law["place"], law["formula"]) == ({"kind": "state", "channel": "v"}, "a*F*abs(F)")
    assert estimates(law)["a"][0] == pytest.approx(-0.002, rel=0.02)


@pytest.mark.campaign("the law whose imitator is not named stands for it: this search takes the most steps")
def test_several_effects_that_leave_more_than_noise_give_way_to_one_law(tmp_path):
    answer = _diagnosed(tmp_path, HIDDEN["a damper that acts one way"])
    assert (answer["verdict"], answer["effects"]) == ("unknown", [])
    (law,) = answer["laws"]
    assert (law["formula"], law["variables"]) == ("a*max(v - c, 0)", ["v"])
    for name, truth in (("a", -0.9), ("c", 0.0)):
        _, low, high = estimates(law)[name]
        assert low < truth < high


@pytest.mark.campaign("a second event: one of an output is held in every run, and a law in a state as well")
def test_a_push_in_one_run_is_told_with_its_run_and_its_times(tmp_path):
    answer = _diagnosed(tmp_path, HIDDEN["a push in one run"])
    law = answer["laws"][0]
    assert (law["form"], law["place"]) == ("event", {"kind": "state", "channel": "v"})
    start, end = (float(each) for each in law["formula"].split(", ")[1:3])
    assert start == pytest.approx(3.0, abs=0.04)  # a row
    assert end == pytest.approx(5.5, abs=0.04)
    assert law["parameters"][0]["runs"] == ["r1.csv"]
    assert law["parameters"][0]["value"] == pytest.approx(5.0, rel=0.02)
