"""Equal recordings: a copy is refused, a coarse gauge that reads the same again is not."""

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import write_case
from toolkit.diagnosis.answer.case_findings import case_findings
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.errors import ConfigError

PRESSURES = np.array([5.0, 10, 15, 35, 55, 75, 95])
GAUGE = """
import pandas as pd
def simulate(inputs, p):
    return pd.DataFrame({"reading": p["gain"] * inputs["p"]})
"""


def gauge_case(folder, *readings):
    """Write a pressure gauge on dead weights, a run for each row of readings [psi]."""
    text = case_text(
        "python", parameters={"gain": (1.0, "1", 0.1)}, inputs={"p": "psi"}, outputs={"reading": "psi"},
        runs=len(readings),
    )  # fmt: skip
    time = np.arange(7.0)
    tables = {
        f"r{number}__csv": pd.DataFrame({"t": time, "p": PRESSURES, "reading": PRESSURES + np.array(errors)})
        for number, errors in enumerate(readings)
    }
    return write_case(folder, text, simulator=GAUGE, **tables)


# Readings in whole psi: of seven, one or two differ from run to run.
WHOLE = [-1, 0, -1, -1, 0, 0, -1]
ONE_OFF, TWO_OFF = [1, 0, -1, -1, 0, 0, -1], [0, 0, 0, -1, 0, 0, -1]


def test_a_coarse_gauge_may_read_the_same_again_and_the_answer_says_so(tmp_path):
    case = read_case(gauge_case(tmp_path, WHOLE, ONE_OFF, WHOLE, TWO_OFF))
    assert len(case.runs) == 4
    finding, *_ = case_findings(problem_of(case, model_of(case, None)))
    assert (finding.rule, finding.where, finding.level) == ("case-equal-runs", "r2.csv", "warning")
    assert "that of r0.csv" in finding.message


def test_a_fine_gauge_may_not(tmp_path):
    fine = [list(0.1 * np.random.default_rng(seed).normal(size=7)) for seed in range(3)]
    with pytest.raises(ConfigError, match="stands twice"):
        read_case(gauge_case(tmp_path, fine[0], fine[1], fine[0], fine[2]))


def test_where_no_other_run_says_how_often_readings_repeat_equal_runs_are_a_copy(tmp_path):
    with pytest.raises(ConfigError, match="stands twice"):
        read_case(gauge_case(tmp_path, WHOLE, WHOLE, ONE_OFF))
