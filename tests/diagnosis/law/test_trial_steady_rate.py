"""What a law may be told of: a rate that never varied is a number, and of forms that are one the shortest."""

from __future__ import annotations

from types import SimpleNamespace as Of

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.law.learn import _simplest_first
from toolkit.diagnosis.law.trial import signals_of
from toolkit.diagnosis.simulators.build_simulator import model_of

RUBBER = """
import pandas as pd
def simulate(inputs, p):
    return pd.DataFrame({"F": p["k"] * inputs["strain"]})
"""


@pytest.mark.parametrize(("pulled", "has_rate"), [("ramp", False), ("stairs", True), ("swing", True)])
def test_a_rate_of_one_value_is_no_signal_and_has_no_past(tmp_path, pulled, has_rate):
    (tmp_path / "sim.py").write_text(RUBBER)
    (tmp_path / "case.toml").write_text(
        case_text(
            "python", function="simulate", parameters={"k": (5.0, "N", 1.0)}, inputs={"strain": "1"},
            outputs={"F": "N"}, runs=1,
        )
    )  # fmt: skip
    t = np.arange(400) * 0.1
    strain = {"ramp": 0.0424 * t, "stairs": np.floor(t / 10) * 0.4, "swing": np.sin(0.3 * t)}[pulled]
    table = pd.DataFrame({"t": t, "strain": strain, "F": 5 * strain + 0.3 * strain**2})
    table.to_csv(tmp_path / "r0.csv", index=False)
    case = read_case(tmp_path / "case.toml")
    problem = problem_of(case, model_of(case, None))
    signals = {signal.name: signal for signal in signals_of(problem, fit(problem), "F")}
    assert ("dstrain/dt" in signals) is has_rate
    # A memory of a ramp is a curve of where it is.
    assert signals["strain"].remembered is has_rate
    assert signals["F"].remembered is has_rate


def test_of_laws_that_are_one_on_the_rows_the_shortest_is_told():
    """A heading of +1 and -1 is its own product with its size."""
    trials = [
        Of(applied=Of(effect=Of(name=f"law enters: {text}")), cost=1)
        for text in ("a*[heading]*abs([heading])", "a*[heading]", "a*[heading]**3")
    ]
    fitted = [(-10.0 + 1e-9 * k, trial, None) for k, trial in enumerate(trials)]
    assert _simplest_first(fitted)[0][1] is trials[1]
