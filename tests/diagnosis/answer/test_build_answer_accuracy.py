"""What a simulation is off by without any effect gets no name; what is left out does, however small.

Zeros that move from run to run are no effect's, one that stands is.
"""

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose

CASE = case_text("python", title="A cell", time=None, inputs={"L": "N"}, outputs={"F": "N"})
SIMULATOR = """
import pandas as pd
def simulate(inputs, p):
    return pd.DataFrame({"F": inputs["L"]})
"""


def answered(folder, *, noise, gain=1.004, zeros=(0.0, 0.0, 0.0)):
    text, frames = CASE, {}
    for k, zero in enumerate(zeros):
        rng = np.random.default_rng(k)
        load = rng.uniform(-100, 100, 120)
        force = gain * load + zero + rng.normal(0, noise, 120)
        frames[f"r{k}__csv"] = pd.DataFrame({"L": load, "F": force})
        text += f'[[recording.run]]\nfile = "r{k}.csv"\n'
    case = read_case(write_case(folder, text, simulator=SIMULATOR, **frames))
    return diagnose(case, None).diagnosis


@pytest.mark.campaign("a small effect at the edge of the noise: larger ones are named in every run")
@pytest.mark.parametrize(("noise", "verdict"), [(0.7, "unknown"), (0.02, "equivalent")])
def test_four_thousandths_are_named_where_they_are_nearly_all_above_the_noise(tmp_path, noise, verdict):
    answer = answered(tmp_path, noise=noise)
    assert answer.verdict == verdict
    classes = [{effect.name, *effect.equivalent_to} for effect in answer.effects]
    assert all("sensitivity_error" in each for each in classes)
    assert bool(classes) is (verdict == "equivalent")


@pytest.mark.parametrize(
    ("zeros", "named"),
    [
        ((-0.4,) * 5, True),
        ((0.21, -0.46, 0.33, 0.02, -0.25), False),
        # of three, one constant takes nine tenths by chance
        ((0.46, 0.33, 0.40), False),
        ((0.01, -0.02, -0.52), False),
    ],
)
def test_a_zero_is_named_where_it_stands_and_not_where_it_moves(tmp_path, zeros, named):
    answer = answered(tmp_path, noise=0.1, gain=1.0, zeros=zeros)
    assert bool(answer.effects) is named
    for effect in answer.effects:
        assert "zero_offset" in {effect.name, *effect.equivalent_to}
        assert effect.parameters[0].value == pytest.approx(-0.4, abs=0.02)
