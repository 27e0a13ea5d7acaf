"""What a simulation is off by without any effect gets no name; what is left out does, however small."""

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.cases import write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose

CASE = """schema = 1
title = "A cell"
[simulation]
kind = "python"
path = "sim.py"
[recording.channels]
L = { unit = "N", role = "input" }
F = { unit = "N", role = "output" }
"""
SIMULATOR = """
import pandas as pd
def simulate(inputs, p):
    return pd.DataFrame({"F": inputs["L"]})
"""


def answered(folder, *, noise, gain=1.004):
    text, frames = CASE, {}
    for k in range(3):
        rng = np.random.default_rng(k)
        load = rng.uniform(-100, 100, 120)
        frames[f"r{k}__csv"] = pd.DataFrame({"L": load, "F": gain * load + rng.normal(0, noise, 120)})
        text += f'[[recording.run]]\nfile = "r{k}.csv"\n'
    case = read_case(write_case(folder, text, simulator=SIMULATOR, **frames))
    return diagnose(case, None).diagnosis


@pytest.mark.parametrize(("noise", "verdict"), [(0.7, "unknown"), (0.02, "equivalent")])
def test_four_thousandths_are_named_where_they_are_nearly_all_above_the_noise(tmp_path, noise, verdict):
    answer = answered(tmp_path, noise=noise)
    assert answer.verdict == verdict
    classes = [{effect.name, *effect.equivalent_to} for effect in answer.effects]
    assert all("sensitivity_error" in each for each in classes)
    assert bool(classes) is (verdict == "equivalent")
