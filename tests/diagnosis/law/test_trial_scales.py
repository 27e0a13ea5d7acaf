"""Laws of what drives a tire: their responses are those of the tire itself, and only a tire has them."""

from __future__ import annotations

import dataclasses

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import CELL, write_case
from tests.diagnosis.tire_case import python_tire
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.law.ranking import all_responses
from toolkit.diagnosis.law.trial import scales_of
from toolkit.diagnosis.simulators.build_simulator import model_of


def _based(path):
    case = read_case(path)
    problem = problem_of(case, model_of(case, None))
    return problem, fit(problem, plain=True)


def test_a_tire_answers_to_a_law_of_its_friction_as_it_was_foretold(tmp_path):
    problem, base = _based(python_tire(tmp_path))
    trials = [trial for trial in scales_of(problem, base) if trial.signals[0].name == "FZ"]
    assert {trial.applied.effect.name.split(":")[0] for trial in trials} == {
        "law scales friction",
        "law scales stiffness",
    }
    straight = next(trial for trial in trials if trial.shape.text == "a*{x}")
    (response,) = all_responses(problem, base, [straight])
    small = 1e-9  # 1/N: of 5000 N a change of the friction by 5e-6
    sizes = dict(straight.applied.values) | {"a": small}
    law = dataclasses.replace(straight.applied, values=sizes)
    moved = problem.simulate(base.p, (*base.active, law))
    for name in ("FY", "MZ"):
        change = (moved[name] - base.simulated[name]) / small
        assert np.ptp(change) > 0
        np.testing.assert_allclose(response[name][:, 0], change, atol=2e-3 * np.abs(change).max())


def test_the_slip_angle_is_the_curve_and_no_grip(tmp_path):
    problem, base = _based(python_tire(tmp_path))
    assert {trial.signals[0].name for trial in scales_of(problem, base)} == {"FZ", "time"}


@pytest.mark.parametrize("unit", ["N", "mV"])
def test_what_is_no_tire_has_no_friction_to_scale(tmp_path, unit):
    head = case_text(
        "python", parameters={"gain": (1.0, "1", 0.005)}, inputs={"L": unit}, outputs={"F": "N"}, runs=2
    )
    L = np.linspace(0, 10, 60)
    runs = {
        f"r{k}__csv": pd.DataFrame({"t": 0.1 * np.arange(60), "L": L, "F": L + 0.01 * k}) for k in range(2)
    }
    problem, base = _based(write_case(tmp_path, head, simulator=CELL, **runs))
    assert list(scales_of(problem, base)) == []
