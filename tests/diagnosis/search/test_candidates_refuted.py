"""A recording beyond what an effect can show refutes it: a channel that lost its sign reads no minus."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import CELL, write_case
from toolkit.diagnosis.answer import power
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.search.candidates import candidates
from toolkit.diagnosis.simulators.build_simulator import model_of

HEAD = case_text(
    "python", parameters={"gain": (1.0, "1", 0.005)}, inputs={"L": "N"}, outputs={"F": "N"}, runs=2
)


@pytest.mark.parametrize(
    ("lowest", "noise", "there"),
    [
        (0.0, 0.1, True),  # its noise goes below zero, and nothing else
        (0.0, 3.0, True),
        (-5.5, 0.3, False),  # a servo that begins below zero
        (-0.05, 0.3, True),  # a zero that is off by less than its noise
        (-100.0, 0.3, False),
    ],
)
def test_a_channel_that_reads_below_zero_has_its_sign(tmp_path, lowest, noise, there):
    rng, t, runs = np.random.default_rng(5), np.arange(300) * 0.02, {}
    for k in range(2):
        L = lowest + (100.0 - lowest) * np.clip((t - 0.5) / 4, 0, 1) + 0.01 * k
        runs[f"r{k}__csv"] = pd.DataFrame({"t": t, "L": L, "F": L + rng.normal(0, noise, 300)})
    case = read_case(write_case(tmp_path, HEAD, simulator=CELL, **runs))
    names = {(each.name, each.active.channel) for each in candidates(problem_of(case, model_of(case, None)))}
    assert (("rectification", "F") in names) is there


def test_what_the_recording_refutes_is_said_to_be_refuted(tmp_path):
    rng, t, runs = np.random.default_rng(5), np.arange(120) * 0.02, {}
    for k in range(2):
        L = 50 * np.sin(3 * t + k)
        runs[f"r{k}__csv"] = pd.DataFrame({"t": t, "L": L, "F": L + rng.normal(0, 0.3, 120)})
    case = read_case(write_case(tmp_path, HEAD, simulator=CELL, **runs))
    absent = {each.name: each for each in diagnose(case, None).diagnosis.not_found}
    assert (absent["rectification"].observable, absent["rectification"].why) == (False, power.REFUTED)
