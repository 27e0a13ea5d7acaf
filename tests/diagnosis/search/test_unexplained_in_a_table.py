"""What stays of readings without a time: their noise has no colour, and a bend of a few rows is no chance."""

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.fit.row_order import by_inputs
from toolkit.diagnosis.search.screen import LinearisedFit
from toolkit.diagnosis.search.unexplained import remainder
from toolkit.diagnosis.simulators.build_simulator import model_of

CASE = case_text(
    "python",
    time=None,
    parameters={"resistance": (3.2, "ohm", 0.5), "drop": (0.7, "V", 0.2)},
    inputs={"U": "V"},
    outputs={"I": "A"},
    runs=1,
)
COIL = """
import pandas as pd
def simulate(inputs, p):
    return pd.DataFrame({"I": (inputs["U"] - p["drop"]) / p["resistance"]})
"""
U = np.linspace(0.8, 9.4, 21)


@pytest.fixture
def left(tmp_path):
    def of(rest):
        table = pd.DataFrame({"U": U, "I": (U - 0.73) / 3.15 + rest})
        files = {"r0__csv": table, "r1__csv": None}
        ordered = by_inputs(read_case(write_case(tmp_path, CASE, simulator=COIL, **files)))
        assert ordered is not None
        problem = problem_of(ordered[0], model_of(ordered[0], None, None))
        base = fit(problem)
        return remainder(problem, LinearisedFit.of(problem, base), base, seed=1)

    return of


def test_a_bend_five_times_the_noise_is_left(left):
    # A coil that warms up: the current falls short with its square.
    bend = -0.0012 * (U - 5.0) ** 2 + np.random.default_rng(0).normal(0, 0.0012, len(U))
    assert {found.variables for found in left(bend)} >= {("U",)}


def test_white_readings_leave_nothing(left):
    assert [left(np.random.default_rng(seed).normal(0, 0.005, len(U))) for seed in range(10)] == [()] * 10
