"""A wrong unit of an input or an output is found by the ratio of the units, before any law of a factor."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose

PISTON = """
def simulate(inputs, p):
    import pandas as pd
    return pd.DataFrame({"F": inputs["P"] * 0.1 * p["area"] + 0.0 * inputs["x"]})
"""
HEAD = case_text(
    "python", parameters={"area": (500.0, "mm^2", 5.0)}, inputs={"x": "mm", "P": "bar"},
    outputs={"F": "N"}, runs=2,
)  # fmt: skip
ROTOR = """
def initial(p):
    return [0.0]
def rhs(t, x, u, p):
    return [(p["gain"] * u["M"] - x[0]) / 0.5]
def outputs(x, u, p):
    return {"w": x[0]}
"""


def piston(seed: int, *, pressure: float = 1.0, force: float = 1.0) -> pd.DataFrame:
    """Return a piston of 503 mm^2 with its columns in other units than bar and N by these factors."""
    rng = np.random.default_rng(seed)
    t = np.arange(60) * 0.1
    bar = 4.0 + seed + 2.0 * np.sin(0.9 * t + seed)
    F = 50.3 * bar + rng.normal(0, 1.0, len(t))
    return pd.DataFrame({"t": t, "x": np.cos(t), "P": bar * pressure, "F": F * force})


ANOTHER = pytest.mark.campaign("another pair of units: one is named in every run")


@pytest.mark.parametrize(
    ("columns", "channel", "factor", "told"),
    [
        ({"pressure": 100.0}, "P", 100.0, "kPa read as bar"),
        pytest.param({"pressure": 14.503774}, "P", 14.503774, "psi read as bar", marks=ANOTHER),
    ],
)
def test_an_input_in_another_unit_is_named_with_both_units(tmp_path, columns, channel, factor, told):
    runs = {f"r{seed}__csv": piston(seed, **columns) for seed in (0, 1)}
    answer = diagnose(read_case(write_case(tmp_path, HEAD, simulator=PISTON, **runs)), None).diagnosis
    names = [effect for effect in answer.effects if effect.name == "unit_error"]
    assert len(names) == 1
    both = {channel, "F"}  # of a force in proportion to one pressure, the other number may be wrong as well
    assert names[0].key.channel in both
    (parameter,) = (each for each in names[0].parameters if each.name == "factor")
    assert parameter.value == pytest.approx(factor, rel=1e-3) or names[0].key.channel == "F"
    assert told in names[0].statement


def test_the_inputs_of_an_equation_are_asked_for_their_units(tmp_path):
    rng = np.random.default_rng(3)
    t = np.arange(120) * 0.05
    moment = 2.0 + np.sin(1.3 * t)
    w = np.zeros(len(t))
    for i in range(1, len(t)):
        w[i] = w[i - 1] + 0.05 * (3.0 * moment[i - 1] - w[i - 1]) / 0.5
    run = pd.DataFrame({"t": t, "M": moment / (4.4482216 * 0.3048), "w": w + rng.normal(0, 0.02, len(t))})
    head = """schema = 1
[simulation]
kind = "ode"
path = "sim.py"
states = ["w"]
[simulation.parameters.gain]
value = 3.0
unit = "1/(N*m*s)"
sd = 0.1
[recording]
time = "t"
[recording.channels]
t = { unit = "s", role = "time" }
M = { unit = "N*m", role = "input" }
w = { unit = "rad/s", role = "output" }
[[recording.run]]
file = "r0.csv"
"""
    path = write_case(tmp_path, head, simulator=ROTOR, r0__csv=run, r1__csv=None)
    answer = diagnose(read_case(path), None).diagnosis
    (effect,) = answer.effects
    assert (effect.name, effect.key.channel) == ("unit_error", "M")
    assert "lbf*ft read as N*m" in effect.statement


def test_a_simulation_that_is_only_a_little_wrong_is_asked_for_no_unit(tmp_path):
    from toolkit.diagnosis.fit.problem import problem_of
    from toolkit.diagnosis.search.search import _as_declared
    from toolkit.diagnosis.search.wrong_units import wrong_units
    from toolkit.diagnosis.simulators.build_simulator import model_of

    runs = {f"r{seed}__csv": piston(seed) for seed in (0, 1)}
    case = read_case(write_case(tmp_path, HEAD, simulator=PISTON, **runs))
    problem = problem_of(case, model_of(case, None, None))
    declared = _as_declared(problem)
    assert wrong_units(problem, (declared, declared)) == ()


def test_an_input_that_lost_its_sign_is_named_though_it_drives_little_of_the_output(tmp_path):
    simulator = PISTON.replace("0.0 * inputs", "8.0 * inputs")
    runs = {}
    for seed in (0, 1):
        frame = piston(seed)
        frame["F"] -= 8.0 * frame["x"]  # recorded against the way of the simulation
        runs[f"r{seed}__csv"] = frame
    answer = diagnose(read_case(write_case(tmp_path, HEAD, simulator=simulator, **runs)), None).diagnosis
    assert [(effect.name, effect.key.channel) for effect in answer.effects] == [("channel_sign", "x")]
