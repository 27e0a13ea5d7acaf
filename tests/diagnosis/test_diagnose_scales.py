"""The answer does not depend on where a scale has its zero, and a bent thermometer is no missing physics."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.cases import write_case
from toolkit.diagnosis.answer.answer import Diagnosis
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.search import search

COOLING = """
def initial(p, run):
    return [run["T"]]
def rhs(t, x, u, p):
    return [-p["k"] * (x[0] - p["room"])]
def outputs(x, u, p):
    return {"T": x[0]}
"""


def cup(zero: float, unit: str, folder) -> Diagnosis:
    """Return the answer for a cup of hot water with a second mass, held against Newton's law of cooling."""
    t = np.linspace(0.0, 5400.0, 19)
    water, wall = 71.0, 14.0
    fast, slow = np.exp(-t / 500.0), np.exp(-t / 3600.0)
    T = np.round(22.0 + (water - wall) * slow + wall * fast, 1) + zero
    head = f"""schema = 1
[simulation]
kind = "ode"
path = "sim.py"
states = ["T"]
[simulation.parameters.k]
value = 3.0e-4
unit = "1/s"
sd = 1.0e-4
[simulation.parameters.room]
value = {22.0 + zero}
unit = "{unit}"
sd = 1.5
[recording]
time = "t"
[recording.channels]
t = {{ unit = "s", role = "time" }}
T = {{ unit = "{unit}", role = "output", sd = 0.2 }}
[[recording.run]]
file = "r0.csv"
"""
    run = pd.DataFrame({"t": t, "T": T})
    path = write_case(folder, head, simulator=COOLING, r0__csv=run, r1__csv=None)
    return diagnose(read_case(path), None).diagnosis


WHOLE = pytest.mark.campaign(
    "with the search of names: that two masses have none is held of a mug in every run"
)


@pytest.mark.parametrize("names", [False, pytest.param(True, marks=WHOLE)])
def test_the_same_temperatures_in_kelvin_and_in_celsius_have_the_same_answer(tmp_path, monkeypatch, names):
    if not names:
        monkeypatch.setattr(search, "candidates", lambda _: ())
    in_celsius, in_kelvin = cup(0.0, "degC", tmp_path / "c"), cup(273.15, "K", tmp_path / "k")
    assert in_celsius.verdict == in_kelvin.verdict == "unknown"
    assert [law.formula for law in in_celsius.laws] == [law.formula for law in in_kelvin.laws]
    sizes = [
        [parameter.value for law in answer.laws for parameter in law.parameters]
        for answer in (in_celsius, in_kelvin)
    ]
    assert sizes[0] == pytest.approx(sizes[1], rel=0.02)
