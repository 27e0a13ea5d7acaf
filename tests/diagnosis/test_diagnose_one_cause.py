"""A cause keeps its name: in the runs of a condition, in its own unit, beside laws of its own formula."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import write_case
from toolkit.diagnosis.answer.answer import Diagnosis
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose

BALANCE = """schema = 1
[simulation]
kind = "ode"
path = "sim.py"
states = ["x", "v"]
force_terms = { v = "V/s^2" }
[simulation.parameters]
stiffness = { value = 10.0, unit = "1/s^2", sd = 0.05 }
damping = { value = 0.006, unit = "1/s", sd = 0.003, bounds = [0.0, 0.5] }
[recording]
time = "t"
[recording.channels]
t = { unit = "s", role = "time" }
x = { unit = "V", role = "output" }
"""
SWING = """
def rhs(t, x, u, p):
    return [x[1], -p["stiffness"] * x[0] - p["damping"] * x[1]]
def outputs(x, u, p):
    return {"x": x[0]}
def initial(p, run):
    return [run["start"], 0.0]
"""
JOINT = """
import pandas as pd
def simulate(inputs, p):
    return pd.DataFrame({"current": p["J"] * inputs["acc"] + p["b"] * inputs["w"]})
"""
CELL = """
import pandas as pd
def simulate(inputs, p):
    return pd.DataFrame({"s" + a: p["k" + a] * inputs["f" + a] + p["z" + a] for a in "xyz"})
"""


def answer(folder: Path, toml: str, simulator: str, frames: dict[str, pd.DataFrame]) -> Diagnosis:
    """Diagnose a case of these tables."""
    return diagnose(read_case(write_case(folder, toml, simulator=simulator, **frames)), None).diagnosis


def joint() -> dict[str, pd.DataFrame]:
    """Return a joint swept to and fro: dry friction of 1.3 A that turns within 0.03 rad/s."""
    frames, t = {}, np.arange(0.0, 20.0, 0.05)
    for k in range(3):
        rng = np.random.default_rng(k)
        first, second = rng.uniform(0.4, 0.9), rng.uniform(1.4, 2.2)
        w = 0.5 * np.sin(first * t + k) + 0.2 * np.sin(second * t)
        acc = 0.5 * first * np.cos(first * t + k) + 0.2 * second * np.cos(second * t)
        current = 0.55 * acc + 2.2 * w - 1.5 * w**3 + 1.3 * np.tanh(w / 0.03) + rng.normal(0, 0.1, t.size)
        frames[f"r{k}__csv"] = pd.DataFrame({"t": t, "w": w, "acc": acc, "current": current})
    return frames


def test_a_brake_of_some_runs_is_damping_there(tmp_path: Path) -> None:
    """A free balance that decays at 0.0058 1/s, and at 0.064 1/s with a magnet beside its vane."""
    t, toml, frames = np.arange(0.0, 40.0, 0.1), BALANCE, {}
    for k, (start, brake) in enumerate([(0.20, "off"), (0.17, "off"), (0.07, "on"), (0.12, "on")]):
        rate = 0.0058 + (0.058 if brake == "on" else 0.0)
        turning = np.sqrt(10.0 - rate**2 / 4)
        swing = np.cos(turning * t) + rate / 2 / turning * np.sin(turning * t)
        noise = np.random.default_rng(k).normal(0, 3e-4, t.size)
        frames[f"r{k}__csv"] = pd.DataFrame({"t": t, "x": start * np.exp(-rate / 2 * t) * swing + noise})
        toml += f'[[recording.run]]\nfile = "r{k}.csv"\nbrake = "{brake}"\nstart = {start}\n'
    (effect,) = answer(tmp_path, toml, SWING, frames).effects
    assert effect.name == "viscous_damping"
    (viscous,) = effect.parameters
    assert viscous.runs == ("r2.csv", "r3.csv")
    assert viscous.ci95 is not None
    assert viscous.ci95[0] < 0.058 < viscous.ci95[1]


def test_friction_in_a_motors_current_is_named_though_it_is_soft(tmp_path: Path) -> None:
    toml = case_text(
        "python", parameters={"J": (0.5, "A*s^2/rad", 0.2), "b": (2.5, "A*s/rad", 1.5)},
        inputs={"w": "rad/s", "acc": "rad/s^2"}, outputs={"current": "A"}, runs=3,
    )  # fmt: skip
    effects = {effect.name: effect for effect in answer(tmp_path, toml, JOINT, joint()).effects}
    assert "coulomb_friction" in effects
    coulomb = next(each for each in effects["coulomb_friction"].parameters if each.name == "coulomb")
    assert 1.1 < coulomb.value < 1.5


def test_a_leak_of_the_load_is_named_beside_a_law_in_another_output(tmp_path: Path) -> None:
    """Weights along one axis at a time: 1 % of z stands in x, 1.8 % in y, and z is bent by x."""
    parameters = {f"k{a}": (1.68, "1/g", 0.05) for a in "xyz"} | {f"z{a}": (100.0, "1", 15.0) for a in "xyz"}
    toml = case_text(
        "python", parameters=parameters, inputs={f"f{a}": "g" for a in "xyz"},
        outputs={f"s{a}": "1" for a in "xyz"}, runs=2, time=None,
    )  # fmt: skip
    frames = {}
    for k, weights in enumerate([(0, 100, 200, 500, 1000, -500, -1000), (0, 150, 400, 800, -250, -800)]):
        rng = np.random.default_rng(k)
        f = {a: np.concatenate([np.where(a == on, weights, 0) for on in "xyz"]).astype(float) for a in "xyz"}
        s = {a: 1.69 * f[a] + 105 + rng.normal(0, 1.5, f[a].size) for a in "xyz"}
        s["x"] = s["x"] - 0.0106 * 1.69 * f["z"]
        s["y"] = s["y"] - 0.0178 * 1.69 * f["z"]
        s["z"] = s["z"] - 2e-5 * f["x"] ** 2
        frames[f"r{k}__csv"] = pd.DataFrame({f"f{a}": f[a] for a in "xyz"} | {f"s{a}": s[a] for a in "xyz"})
    effects = answer(tmp_path, toml, CELL, frames).effects
    assert {(effect.name, effect.channel) for effect in effects} == {("crosstalk", "sx"), ("crosstalk", "sy")}
