"""An equation with inputs as they are without what they were recorded with: near the one as recorded."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.search.candidates import candidates
from toolkit.diagnosis.simulators import ode
from toolkit.diagnosis.simulators.build_simulator import model_of

FORCED = """
import numpy as np
def rhs(t, x, u, p):
    return [x[1], p["gain"] * u["F"] - 20.0 * np.sin(x[0]) - 0.2 * x[1]]
def outputs(x, u, p):
    return {"angle": x[0]}
def initial(p, run):
    return [1.5, 0.0]
"""


@pytest.mark.parametrize("error", [0.01, -0.05])
def test_with_other_inputs_an_equation_begins_where_it_was_with_those_recorded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: float
) -> None:
    """A gain error of the input is a gain of the simulation, and asks for no integration from row to row."""
    text = case_text(
        "ode", states=["angle", "rate"], force_terms={"rate": "1/s^2"}, parameters={"gain": (1.0, "1", 0.1)},
        inputs={"F": "N"}, outputs={"angle": "rad"}, runs=2,
    )  # fmt: skip
    t = np.arange(0.0, 20.0, 0.02)
    frames = [pd.DataFrame({"t": t, "F": 3 * np.sin(w * t), "angle": np.cos(4 * t)}) for w in (3.0, 4.1)]
    case = read_case(write_case(tmp_path, text, simulator=FORCED, r0__csv=frames[0], r1__csv=frames[1]))
    model = model_of(case, None)
    problem = problem_of(case, model)
    problem.simulate([1.0], ())
    (gain,) = (
        each.active
        for each in candidates(problem)
        if (each.name, each.active.channel) == ("sensitivity_error", "F")
    )
    applied = replace(gain, values={gain.effect.names[0]: error})

    def row_by_row(*_: Any) -> None:
        raise AssertionError

    monkeypatch.setattr(ode, "integrate", row_by_row)
    shown = problem.simulate([1.0], (applied,))["angle"]
    monkeypatch.undo()
    exact = np.concatenate([model.simulate(run, {"gain": 1 / (1 + error)}, ())["angle"] for run in case.runs])
    assert np.ptp(shown - problem.simulate([1.0], ())["angle"]) > 0.01
    np.testing.assert_allclose(shown, exact, atol=2e-5)
