"""Many questions of a simulator cross to its worker at once; each has the answer that it has alone."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.cases import write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.diagnosis.simulators.case_code import WORKER_LIMITS, running
from toolkit.errors import FitError

CASE = """schema = 1
[simulation]
kind = "python"
path = "sim.py"
[simulation.parameters]
k = { value = 2.0, unit = "1/s", sd = 1.0 }
[recording]
time = "t"
[recording.channels]
t = { unit = "s", role = "time" }
F = { unit = "N", role = "output" }
[[recording.run]]
file = "r0.csv"
[[recording.run]]
file = "r1.csv"
"""
SIMULATOR = """
def simulate(inputs, p):
    import numpy as np, pandas as pd
    if p["k"] > 5:
        raise ValueError("too quick")
    return pd.DataFrame({"F": np.exp(-p["k"] * inputs["t"].to_numpy())})
"""


def test_all_runs_of_all_sets_cross_at_once_and_a_set_that_fails_is_told_alone(tmp_path: Path) -> None:
    tables = {f"r{k}__csv": pd.DataFrame({"t": (t := np.linspace(0, 1 + k, 9 + k)), "F": t}) for k in (0, 1)}
    case = read_case(write_case(tmp_path, CASE, simulator=SIMULATOR, **tables))
    crossed = Counter[str]()
    with running(case, WORKER_LIMITS) as code:
        assert code is not None
        problem = problem_of(case, model_of(case, None, code))
        arrays = code.arrays

        def counted(name: str, *arguments: object) -> object:
            crossed[name] += 1
            return arrays(name, *arguments)  # type: ignore[arg-type]

        code.arrays = counted  # type: ignore[assignment,method-assign]
        problem.prepare([((k,), ()) for k in (1.0, 2.0, 3.0, 9.0)])
        for k in (1.0, 2.0, 3.0):
            t = np.concatenate([run.t for run in problem.runs])
            np.testing.assert_allclose(problem.simulate((k,), ())["F"], np.exp(-k * t))
        assert crossed == {"calls": 1}
        with pytest.raises(FitError, match="too quick"):
            problem.simulate((9.0,), ())
